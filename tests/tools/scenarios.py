"""Scenarios for tests: the files of examples/scenarios, and small ones made on the spot."""

from pathlib import Path
from typing import Any

from syncplan.planning.judged_team import PlanFinding
from syncplan.planning.plans import Plan
from syncplan.scenario.loading import load_scenario, scenario_from
from syncplan.scenario.specification import Scenario
from tests.tools.on_paper import plan

FILES = Path(__file__).parents[2] / "examples" / "scenarios"
BAD_FILES = FILES / "bad"
LANDMARKS = [[190.0, 0.0], [190.0, 70.0]]
"""Two landmarks that the second vehicle of a small scenario sees, and none too near."""


def example(name: str) -> Scenario:
    """Return the scenario of examples/scenarios/<name>.yaml."""
    return load_scenario(FILES / f"{name}.yaml")


def circling(**changes: Any) -> dict[str, Any]:
    """Return an orbit of 20 m at 0.2 rad/s with some of its keys replaced."""
    return {"radius_m": 20.0, "angular_rate_rad_s": 0.2, **changes}


def document(**changes: Any) -> dict[str, Any]:
    """Return a small valid scenario with some of its top keys replaced; None removes a key."""
    base: dict[str, Any] = {
        "orbit": circling(direction="ccw"),
        "formation": {"centers_m": [[0.0, 0.0], [70.0, 0.0]]},
        "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
    }
    base.update(changes)
    return {key: value for key, value in base.items() if value is not None}


def small(**changes: Any) -> Scenario:
    """Return the scenario of `document(**changes)`."""
    return scenario_from(document(**changes))


def planned(**changes: Any) -> Plan:
    """Return the plan of `small(**changes)`, its errors not predicted."""
    return plan(small(**changes), bound="never")


def shared_circles(per_circle: int) -> dict[str, Any]:
    """Return six circles of several vehicles each: few vehicles, and sightings at every sample.

    Four on each circle take about 3 s to plan, eight 40 s.
    """
    centres = [[0, 0], [70, 0], [140, 0], [140, 70], [70, 70], [0, 70]]
    return document(
        formation={"centers_m": [centre for centre in centres for _ in range(per_circle)]},
        landmarks_m=LANDMARKS,
        duration_s=200.0,
    )


EVERYTHING: dict[str, dict[str, Any]] = {
    "motion": {
        "speed_scale_sigma": 0.02,
        "turn_rate_bias_sigma_rad_s": 0.005,
        "clock_offset_sigma_s": 0.05,
    },
    "wind": {"sigma_mps": 1.0, "gust_sigma_mps": 0.2, "gust_time_s": 7.0},
    "sensor": {
        "bearing_bias_sigma_rad": 0.02,
        "bearing_walk": {"sigma_rad": 0.03, "time_s": 9.0},
        "range_sigma_m": 0.3,
        "detection_probability": 0.8,
        "interval_s": 0.2,
    },
}
"""Every error and every kind of sighting of a target."""


def changed(name: str, **keys: Any) -> Scenario:
    """Return an example with some keys changed; sections are merged."""
    base = example(name).model_dump(exclude_none=True)
    for key, value in keys.items():
        merged = isinstance(value, dict)
        base[key] = {**base.get(key, {}), **value} if merged else value
    return scenario_from(base)


def findings_of(judged: Plan, code: str) -> list[PlanFinding]:
    """Return the findings of a plan that have this code."""
    return [one for one in judged.verdict.findings if one.code == code]
