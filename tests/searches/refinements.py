"""Search for a refinement that breaks something, or does not improve.

Teams are of 4 to 8 vehicles on a random tree or a shaken grid, of both senses, with equal or mixed
radii; some have limited views, a least separation, an area, or radii that may change. Fails where
the result breaks what the plan met, or does worse. It is judged without the package's windows,
rows, bounds or distances: positions at many instants in plain NumPy, sightings by comparing
distances and angles sample by sample, areas by their edges. The error is that of the filter's
covariance recursion in `tests.tools.dense_models`, by the windows that `sight_lines` looks at.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from syncplan.arrays import Array
from syncplan.orbits.error_states import layout_of
from syncplan.planning.plans import Plan
from syncplan.scenario.loading import scenario_from
from tests.searches import Search
from tests.tools.dense_models import dense_covariances
from tests.tools.on_paper import plan, refine
from tests.tools.sampled_rows import (
    paths_of,
    rank_of,
    rooms_of,
    sampled_rows,
    scaled,
)
from tests.tools.scenario_draws import draw_centers, draw_landmarks

__all__ = [
    "NEAR_SHARE",
    "ROUNDING",
    "SEARCH",
    "STARTS",
    "Equip",
    "Refined",
    "draw",
    "draw_plan",
    "faults_of",
    "landmark_passes",
]


INSTANTS = 20_000
BOX_M = 5.0
ROUNDING = 2e-6
NEAR_SHARE = 0.1
STARTS = 2
SHOWN = 10


@dataclass(frozen=True, slots=True)
class Refined:
    """What became of a plan: gain is the objective's relative fall."""

    size: int
    improved: bool
    gain: float
    reason: str


# --- drawing --------------------------------------------------------------------------------------

Equip = Callable[[dict[str, Any], np.random.Generator], None]


def as_drawn(document: dict[str, Any], generator: np.random.Generator) -> None:
    """Add no key to a document."""


def draw_plan(number: int, sizes: tuple[int, int] = (4, 8), equip: Equip = as_drawn) -> Plan:
    """Return the plan of a feasible scenario, of the fewest to the most vehicles of `sizes`.

    `equip` adds keys to the document drawn. Feasible: the plan meets whatever is asked of it, and
    half of the links or more are in contact.
    """
    generator = np.random.default_rng([number, 20260])
    while True:
        document = _document(generator, sizes)
        equip(document, generator)
        drawn = plan(scenario_from(document))
        kept = len(drawn.links)
        if not drawn.too_close and kept >= len(drawn.dropped_links) and kept and _within(drawn):
            return drawn


def _document(generator: np.random.Generator, sizes: tuple[int, int]) -> dict[str, Any]:
    count = int(generator.integers(sizes[0], sizes[1] + 1))
    radii = np.full(count, 20.0)
    if generator.random() < 0.6:
        radii = generator.uniform(14.0, 26.0, count)
    reach = generator.uniform(30.0, 50.0)
    centers = draw_centers(generator, radii, reach, trees=0.5, clear=0.25)
    landmarks = draw_landmarks(generator, centers, radii, reach, most=4)
    sensor: Any = {"range_m": reach, "bearing_sigma_rad": 0.1, "sample_time_s": 0.2}
    if generator.random() < 0.35:
        sensor = [
            dict(sensor, fov_deg=generator.uniform(160.0, 360.0), boresight_deg=side)
            for side in generator.choice([0.0, 60.0, -60.0], count)
        ]
    elif generator.random() < 0.3:
        sensor = [dict(sensor, range_m=reach * generator.uniform(0.85, 1.15)) for _ in radii]
    direction: Any = str(generator.choice(["ccw", "cw", "alternate", "mixed", "alternate"]))
    if direction == "mixed":
        direction = generator.choice(["ccw", "cw"], count).tolist()
    document: dict[str, Any] = {
        "orbit": {
            "radius_m": radii.tolist(),
            "angular_rate_rad_s": float(generator.uniform(0.15, 0.4)),
            "direction": direction,
        },
        "formation": {"centers_m": centers.tolist()},
        "landmarks_m": landmarks.tolist(),
        "sensor": sensor,
        "duration_s": 120.0,
    }
    if generator.random() < 0.5:
        document["min_separation_m"] = float(generator.uniform(3.0, 12.0))
    if generator.random() < 0.35:
        low = (centers - radii[:, None]).min(axis=0) - generator.uniform(0.5, 8.0, 2)
        high = (centers + radii[:, None]).max(axis=0) + generator.uniform(0.5, 8.0, 2)
        corners = [low.tolist(), [high[0], low[1]], high.tolist(), [low[0], high[1]]]
        document["area_m"] = corners
    if generator.random() < 0.3:
        least, most = radii.min() * 0.9, radii.max() * 1.1
        document["refine"] = {
            "vary": ["phases", "centers", "radii"],
            "radius_m": [float(least), float(most)],
            "center_box_m": BOX_M,
        }
    else:
        document["refine"] = {"center_box_m": BOX_M}
    if generator.random() < 0.25:
        document["window_s"] = float(
            2.0 * np.pi / document["orbit"]["angular_rate_rad_s"] * generator.uniform(0.6, 2.0)
        )
    objectives = ["logdet", "min_eigenvalue", "trace", "worst_predicted_rms"]
    if generator.random() < 0.4:
        document["refine"]["objective"] = str(generator.choice(objectives))
    return document


def _within(given: Plan) -> bool:
    area = given.scenario.area_m
    return area is None or not _outside(np.array(area), given)


# --- looking at the result ------------------------------------------------------------------------


def faults_of(before: Plan, after: Plan) -> list[str]:
    """Return what the result violates that the input met, or does worse than it; none is right."""
    faults = [
        *_circle_faults(before, after),
        *_separation_faults(before, after),
        *_landmark_faults(before, after),
        *_contact_faults(before, after),
    ]
    old, new = sampled_rows(before), sampled_rows(after)
    scale = float(before.orbits.radii.mean())
    rank_before = rank_of(old, scale)
    rank_after = rank_of(new, float(after.orbits.radii.mean()))
    if rank_after < rank_before:
        faults.append(f"rank {rank_before} became {rank_after}")
    if before.certificate.holds and not after.certificate.holds:
        faults.append("certificate lost")
    record = after.refinement
    assert record is not None
    if record.cleared:
        return faults
    full = 3 * before.orbits.count
    if rank_before == full:
        bound_before, bound_after = _window_bound(old), _window_bound(new)
        if bound_after > bound_before * (1.0 + 1e-5):
            faults.append(f"window bound {bound_before:.6g} became {bound_after:.6g}")
    cost_before = _cost(before, record.objective, old, scale, rank_before == full)
    cost_after = _cost(after, record.objective, new, scale, rank_after == full)
    if cost_after > cost_before + 1e-7 * abs(cost_before):
        faults.append(f"{record.objective} {cost_before:.8g} became {cost_after:.8g}")
    if record.improved and not cost_after < cost_before:
        faults.append(f"{record.objective} is said to improve: {cost_before} to {cost_after}")
    reported = record.after.cost(record.objective)
    if math.isfinite(cost_after) and abs(reported - cost_after) > 1e-5 * abs(cost_after):
        faults.append(f"{record.objective} is reported as {reported:.8g}, is {cost_after:.8g}")
    return faults


def _circle_faults(before: Plan, after: Plan) -> list[str]:
    old, new = before.orbits, after.orbits
    options = after.refinement.options if after.refinement else None
    assert options is not None
    faults = []
    moved = np.abs(new.centers - old.centers).max()
    if moved > BOX_M * (1.0 + ROUNDING):
        faults.append(f"a centre moved {moved} m")
    if "radii" not in options.vary and np.any(new.radii != old.radii):
        faults.append("a radius changed")
    if options.radius_m is not None:
        least, most = options.radius_m
        if new.radii.min() < least * (1 - ROUNDING) or new.radii.max() > most * (1 + ROUNDING):
            faults.append(f"radii {new.radii} outside {least} to {most}")
    if np.any(new.senses != old.senses) or new.rate != old.rate:
        faults.append("senses or rate changed")
    if after.scenario.area_m is not None:
        faults += _outside(np.array(after.scenario.area_m), after)
    return faults


def _outside(corners: Array, given: Plan) -> list[str]:
    area, faults = shapely.Polygon(corners), []
    for k, center in enumerate(shapely.points(given.orbits.centers)):
        away = shapely.distance(area.boundary, center)
        if not area.contains(center) or away < given.orbits.radii[k] * (1.0 - ROUNDING):
            faults.append(f"circle of v{k + 1} leaves the area: {away} m from an edge")
    return faults


def _turn(given: Plan) -> Array:
    """(INSTANTS, n, 2) m."""
    period = 2.0 * np.pi / given.orbits.rate
    return paths_of(given, np.arange(INSTANTS, dtype=np.float64) * (period / INSTANTS))


def _least_distances(given: Plan) -> Array:
    path = _turn(given)
    a, b = np.triu_indices(given.orbits.count, 1)
    return np.array(
        [float(np.hypot(*(path[:, i] - path[:, j]).T).min()) for i, j in zip(a, b, strict=True)]
    )


def _separation_faults(before: Plan, after: Plan) -> list[str]:
    floor = before.scenario.min_separation_m or NEAR_SHARE * float(after.orbits.radii.mean())
    old, new = _least_distances(before), _least_distances(after)
    bad = (new < floor * (1.0 - ROUNDING)) & (old >= floor)
    return [f"separation {new[k]:.6g} m, asked {floor:.6g} m" for k in np.flatnonzero(bad)]


def landmark_passes(given: Plan) -> Array:
    """Return (n, m) m: how near each vehicle passes each landmark, at many instants of a turn."""
    path = _turn(given)
    passes = [
        np.hypot(*(path - landmark).transpose(2, 0, 1)).min(axis=0) for landmark in given.landmarks
    ]
    return np.array(passes).reshape(len(passes), given.orbits.count).T


def _landmark_faults(before: Plan, after: Plan) -> list[str]:
    """Passes that are nearer than asked and than before."""
    stated = before.scenario.landmark_clearance_m
    asked = NEAR_SHARE * float(after.orbits.radii.mean()) if stated is None else stated
    old, new = landmark_passes(before), landmark_passes(after)
    bad = (new < asked * (1.0 - ROUNDING)) & (new < old - ROUNDING)
    return [f"a landmark passed at {away:.6g} m, asked {asked:.6g} m" for away in new[bad]]


def _contact_faults(before: Plan, after: Plan) -> list[str]:
    """Kept links and landmarks: as many samples in contact as their rank needs, or as there were.

    Over the window, or a period if that is longer. They also keep a fiftieth of the range as a
    margin, or as much of it as the input had.
    """
    names, step = before.scenario.vehicle_names, before.scenario.sample_time
    span = max(before.scenario.window, before.scenario.period)
    times = np.arange(math.ceil(span / step - 1e-9), dtype=np.float64) * step
    old, new = rooms_of(before, times), rooms_of(after, times)
    n = before.orbits.count
    ranges = np.array([sensor.range_m for sensor in before.scenario.sensors])
    wanted = [(link.a, link.b, 3) for link in before.links]
    wanted += [(link.a, link.b, 2) for link in before.landmark_links]
    faults = []
    for a, b, samples in wanted:
        both = [
            np.maximum(room[:, a, b], room[:, b, a] if b < n else -np.inf) for room in (old, new)
        ]
        best = [np.sort(room)[::-1] for room in both]
        count = min(samples, int(np.count_nonzero(best[0] >= 0.0)))
        if count == 0:
            continue
        reach = max(ranges[a], ranges[b]) if b < n else ranges[a]
        least = min(0.02 * reach, best[0][count - 1])
        if best[1][count - 1] < least - ROUNDING * reach:
            faults.append(
                f"contact of {names[a]} and {b} at {count} samples: room {best[1][count - 1]:.6g} "
                f"m, had {best[0][count - 1]:.6g}, asked {least:.6g}"
            )
    return faults


# --- figures --------------------------------------------------------------------------------------


def _window_bound(rows: Array) -> float:
    inverse = np.linalg.pinv(rows, rcond=1e-13)
    variance = np.sum(inverse**2, axis=1).reshape(-1, 3)[:, :2].sum(axis=1)
    return float(np.sqrt(variance.max()))


def _cost(given: Plan, objective: str, rows: Array, scale: float, observable: bool) -> float:
    values = np.linalg.svd(scaled(rows, scale), compute_uv=False) ** 2
    if objective == "trace":
        return -float(values.sum())
    if objective == "logdet":
        return -float(np.log(values).sum()) if observable else math.inf
    if objective == "min_eigenvalue":
        return -float(values[-1]) if observable else 0.0
    rms = _predicted(given)
    return float(rms.max() if objective == "worst_predicted_rms" else np.sqrt(np.mean(rms**2)))


def _predicted(given: Plan) -> Array:
    """(n,) m: RMS of the filter's covariance over the run's second half, in each moment's state."""
    team, layout = given.team, layout_of(given.team)
    steps = math.floor(given.scenario.duration_s / given.scenario.sample_time + 1e-6)
    covariances = enumerate(dense_covariances(team, layout, steps))
    late = [P.diagonal()[: 3 * team.count] for k, P in covariances if 2 * k > steps]
    variances = np.mean(late, axis=0).reshape(-1, 3)
    return np.asarray(np.sqrt(variances[:, 0] + variances[:, 1]))


# --- the search -----------------------------------------------------------------------------------


def draw(
    number: int, sizes: tuple[int, int] = (4, 8), equip: Equip = as_drawn
) -> tuple[list[str], Refined]:
    """Return what is wrong with the refinement of a scenario, and what it gained."""
    before = draw_plan(number, sizes, equip)
    after = refine(before, workers=1, starts=STARTS, time_limit_s=3600.0)
    record = after.refinement
    assert record is not None
    cost, refined_cost = (which.cost(record.objective) for which in (record.before, record.after))
    compared = math.isfinite(cost) and cost != 0.0
    return faults_of(before, after), Refined(
        size=before.scenario.size,
        improved=record.improved,
        gain=(cost - refined_cost) / abs(cost) if compared else math.inf,
        reason=f"{record.objective}: {record.reason}" if record.reason else record.objective,
    )


def judge(cases: Mapping[int, Refined], chance: float) -> list[str]:
    """Print how many improved, and the cases that gained least."""
    print(f"{sum(case.improved for case in cases.values())} of {len(cases)} improved; least gains:")
    for number, case in sorted(cases.items(), key=lambda item: item[1].gain)[:SHOWN]:
        print(f"  {number:>4}: {100.0 * case.gain:.3g} %, {case.size} vehicles, {case.reason}")
    return []


SEARCH = Search(draw, judge, draws=4)
