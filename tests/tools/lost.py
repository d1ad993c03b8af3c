"""Drawn scenarios for losses, and each reduced scenario planned from scratch on the same orbits."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from syncplan.planning.loss_study import RemainingTeam
from syncplan.planning.planner import judge
from syncplan.planning.plans import Plan
from syncplan.scenario.loading import scenario_from
from tests.tools.on_paper import plan
from tests.tools.sampled_rows import rank_of, sampled_rows

SMALLEST_RANGE_M = 1e-6

LEFT_OUT = ("single-point-of-failure",)
"""Findings that the verdict on a loss leaves out."""


def drawn_plan(generator: np.random.Generator, most_vehicles: int = 6) -> Plan:
    """Return the plan of a team of 1 to `most_vehicles` with 0 to 4 landmarks.

    Some radii, ranges and fields of view differ, some links are listed, some phases are arbitrary.
    """
    scenario = scenario_from(_document(generator, most_vehicles))
    made = plan(scenario, margin_bound=False, pilot=False)
    if generator.random() < 0.5:
        phases = generator.uniform(0.0, 2.0 * np.pi, made.team.count)
        return judge(scenario, replace(made.orbits, phases=phases))
    return made


def from_scratch(whole: Plan, lost: Sequence[str]) -> Plan:
    """Return the plan of the reduced scenario, written out by hand, on the orbits that are left."""
    values = whole.scenario.model_dump(mode="json", exclude_none=True)
    names, gone = whole.scenario.vehicle_names, set(lost)
    left = [k for k, name in enumerate(names) if name not in gone]
    sensors = _each(values["sensor"], len(names))
    for k, name in enumerate(names):
        if f"sensor:{name}" in gone:
            sensors[k] = {**sensors[k], "range_m": SMALLEST_RANGE_M}
    blind = {name for name in names if f"sensor:{name}" in gone}
    links = [
        pair
        for pair in values["formation"].get("links", [])
        if not gone.intersection(pair) and not blind.issuperset(pair)
    ]
    values["formation"] = {
        "centers_m": {names[k]: values["formation"]["centers_m"][k] for k in left},
        **({"links": links} if "links" in values["formation"] else {}),
    }
    values["orbit"]["radius_m"] = [_each(values["orbit"]["radius_m"], len(names))[k] for k in left]
    values["sensor"] = [sensors[k] for k in left]
    values["landmarks_m"] = {
        name: place
        for name, place in zip(whole.scenario.landmark_names, whole.scenario.landmarks, strict=True)
        if name not in gone
    }
    return judge(scenario_from(values), whole.orbits.only(np.array(left)))


def differences(found: RemainingTeam, expected: Plan, tolerance: float = 1e-6) -> list[str]:
    """Return in what an outcome differs from a plan; predicted errors by a share of themselves.

    After a loss, cures name no desynchronisation that was sought for the team that is left.
    """
    wrong = []
    findings = replace(expected, sufficient_desync=None).verdict.findings
    pairs: dict[str, tuple[Any, Any]] = {
        "vehicles": (list(found.predicted_rms_m.vehicles), expected.scenario.vehicle_names),
        "rank": (found.rank, expected.observability.rank),
        "state_dim": (found.state_dim, expected.observability.state_dim),
        "observable": (found.observable, expected.observable),
        "go": (found.verdict.go, expected.verdict.go),
        "modes": (
            [one.description for one in found.unobservable],
            [one.description for one in expected.unobservable],
        ),
        "findings": (
            found.verdict.findings,
            tuple(finding for finding in findings if finding.code not in LEFT_OUT),
        ),
        "note": (found.predicted_rms_m.note, expected.prediction.note),
    }
    wrong += [f"{key}: {a} != {b}" for key, (a, b) in pairs.items() if a != b]
    a, b = list(found.predicted_rms_m.vehicles.values()), expected.prediction.rms
    if (None in a) != (b is None):
        wrong.append("predicted errors: one is missing")
    elif b is not None and not np.allclose(np.array(a, float), b, rtol=tolerance, atol=0.0):
        wrong.append(f"predicted errors: {a} != {b}")
    return wrong


def independent_rank(whole: Plan, blind: set[int]) -> int:
    """Return the rank of a team's sightings over the window, by sampling; `blind` see nothing."""
    return rank_of(sampled_rows(whole, blind), float(whole.orbits.radii.mean()))


def _document(generator: np.random.Generator, most_vehicles: int) -> dict[str, Any]:
    count = int(generator.integers(1, most_vehicles + 1))
    radius, spacing = 20.0, float(generator.uniform(50.0, 75.0))
    grid = [(float(k % 3) * spacing, float(k // 3) * spacing) for k in range(count)]
    centers = [[x + generator.normal(0.0, 3.0), y + generator.normal(0.0, 3.0)] for x, y in grid]
    reach = generator.uniform(35.0, 60.0, count)
    narrow = generator.random() < 0.3
    document: dict[str, Any] = {
        "orbit": {
            "radius_m": radius
            if generator.random() < 0.5
            else [float(value) for value in generator.uniform(14.0, 24.0, count)],
            "angular_rate_rad_s": 0.2,
            "direction": str(generator.choice(["ccw", "alternate"])),
        },
        "formation": {"centers_m": centers},
        "landmarks_m": [
            [float(value) for value in generator.uniform(-60.0, 190.0, 2)]
            for _ in range(int(generator.integers(0, 5)))
        ],
        "sensor": [
            {
                "range_m": float(one if generator.random() < 0.3 else reach[0]),
                "fov_deg": 200.0 if narrow else 360.0,
                "sample_time_s": 0.5,
            }
            for one in reach
        ],
        "duration_s": 60.0,
    }
    if count > 1 and generator.random() < 0.3:
        names = [f"v{k + 1}" for k in range(count)]
        near = [
            [names[a], names[b]]
            for a in range(count)
            for b in range(a)
            if np.hypot(*(np.array(centers[a]) - centers[b])) < spacing * 1.2
        ]
        document["formation"]["links"] = near
        document["sensor"] = {"range_m": 90.0, "sample_time_s": 0.5}
    return document


def _each(value: Any, count: int) -> list[Any]:
    return list(value) if isinstance(value, list) else [value] * count
