"""Search for a refinement that breaks something, or does not improve.

Teams are of 4 to 8 vehicles on a random tree or a shaken grid, of both senses, with equal or mixed
radii; some have limited views, a least separation, an area, or radii that may change. Fails where
the result breaks what the plan met, or does worse. It is judged without the package's windows,
rows, bounds or distances: positions at many instants in plain NumPy, sightings by comparing
distances and angles sample by sample, areas by their edges, the error by the filter's covariance
recursion.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from syncplan.arrays import Array
from syncplan.planning.planner import Plan, plan
from syncplan.refinement.refiner import refine
from syncplan.scenario.loading import scenario_from
from tests.searches import Search
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
RANK_TOLERANCE = 1e-8
NEAR_SHARE = 0.1
NEAREST = 1e-3
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
    old, new = _rows(before), _rows(after)
    scale = float(before.orbits.radii.mean())
    rank_before = _rank(old, float(before.orbits.radii.mean()))
    rank_after = _rank(new, float(after.orbits.radii.mean()))
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
    faults = []
    tail, head = corners, np.roll(corners, -1, axis=0)
    for k, (center, radius) in enumerate(
        zip(given.orbits.centers, given.orbits.radii, strict=True)
    ):
        along = head - tail
        share = np.sum((center - tail) * along, axis=1) / np.sum(along**2, axis=1)
        nearest = tail + np.clip(share, 0.0, 1.0)[:, None] * along
        away = float(np.hypot(*(center - nearest).T).min())
        crosses = (tail[:, 1] > center[1]) != (head[:, 1] > center[1])
        with np.errstate(divide="ignore", invalid="ignore"):
            at = tail[:, 0] + (center[1] - tail[:, 1]) / along[:, 1] * along[:, 0]
        inside = np.count_nonzero(crosses & (center[0] < at)) % 2 == 1
        if not inside or away < radius * (1.0 - ROUNDING):
            faults.append(f"circle of v{k + 1} leaves the area: {away} m from an edge")
    return faults


def _paths(given: Plan, times: Array) -> Array:
    """(k, n, 2) m."""
    orbits = given.orbits
    angle = orbits.phases + orbits.senses * orbits.rate * times[:, None]
    return np.asarray(
        orbits.centers + orbits.radii[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    )


def _least_distances(given: Plan) -> Array:
    period = 2.0 * np.pi / given.orbits.rate
    path = _paths(given, np.arange(INSTANTS, dtype=np.float64) * (period / INSTANTS))
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
    period = 2.0 * np.pi / given.orbits.rate
    path = _paths(given, np.arange(INSTANTS, dtype=np.float64) * (period / INSTANTS))
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


def _rooms(given: Plan, times: Array) -> Array:
    """(k, n, n + m) m by which each vehicle has each body in range; -inf where it is not seen.

    Outside its view, behind an obstacle, or where its sensor is not ready.
    """
    orbits, sensors = given.orbits, given.scenario.sensors
    path = _paths(given, times)
    still = np.broadcast_to(given.landmarks, (len(times), *given.landmarks.shape))
    bodies = np.concatenate([path, still], axis=1)
    sight = bodies[:, None, :, :] - path[:, :, None, :]
    angle = orbits.phases + orbits.senses * (orbits.rate * times[:, None] + np.pi / 2.0)
    room = np.full(sight.shape[:3], -np.inf)
    hidden = _hidden(given, bodies, orbits.count)
    samples = np.round(times / given.scenario.sample_time).astype(int)
    for k, sensor in enumerate(sensors):
        away = np.hypot(sight[:, k, :, 0], sight[:, k, :, 1])
        axis = angle[:, k] + math.radians(sensor.boresight_deg)
        off = np.arctan2(sight[:, k, :, 1], sight[:, k, :, 0]) - axis[:, None]
        off = np.abs((off + np.pi) % (2.0 * np.pi) - np.pi)
        seen = off <= math.radians(sensor.fov_deg) / 2.0 + 1e-9
        room[:, k] = np.where(seen, sensor.range_m - away, -np.inf)
        room[:, k, k] = -np.inf
        interval = sensor.interval_s or given.scenario.sample_time
        room[samples % round(interval / given.scenario.sample_time) != 0, k] = -np.inf
    room[hidden] = -np.inf
    return room


def _hidden(given: Plan, bodies: Array, count: int) -> Any:
    """(k, n, n + m) whether an obstacle stands between vehicle and body, by Shapely."""
    obstacles = given.scenario.obstacles_m or []
    times, number = bodies.shape[:2]
    if not obstacles:
        return np.zeros((times, count, number), dtype=bool)
    start = np.broadcast_to(bodies[:, :count, None], (times, count, number, 2))
    end = np.broadcast_to(bodies[:, None], (times, count, number, 2))
    lines = shapely.linestrings(np.stack([start, end], axis=-2))
    return np.any([shapely.intersects(lines, shapely.Polygon(c)) for c in obstacles], axis=0)


def _window_times(given: Plan) -> Array:
    step = given.scenario.sample_time
    return np.arange(math.ceil(given.scenario.window / step - 1e-9), dtype=np.float64) * step


def _contact_faults(before: Plan, after: Plan) -> list[str]:
    """Kept links and landmarks: as many samples in contact as their rank needs, or as there were.

    Over the window, or a period if that is longer. They also keep a fiftieth of the range as a
    margin, or as much of it as the input had.
    """
    names, step = before.scenario.vehicle_names, before.scenario.sample_time
    span = max(before.scenario.window, before.scenario.period)
    times = np.arange(math.ceil(span / step - 1e-9), dtype=np.float64) * step
    old, new = _rooms(before, times), _rooms(after, times)
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


def _sighting_rows(given: Plan, times: Array) -> list[Array]:
    """For each time (s, 4 n): sightings by the initial poses in m and rad, over their sigma.

    After the poses the bearing bias of each vehicle, in rad.
    """
    orbits, sensors, n = given.orbits, given.scenario.sensors, given.orbits.count
    compasses = _compasses(given)
    room = _rooms(given, times)
    path, first = _paths(given, times), _paths(given, np.zeros(1))[0]
    matrices = []
    for k in range(len(times)):
        seen = np.argwhere(room[k] >= -1e-12 * orbits.radii.max())
        rows = []
        for i, j in seen:
            target = path[k, j] if j < n else given.landmarks[j - n]
            qx, qy = target - path[k, i]
            squared = max(qx**2 + qy**2, 1e-20)
            bearing = np.array([-qy, qx]) / squared
            kinds = [(bearing, -1.0, sensors[i].bearing_sigma_rad)]
            if sensors[i].range_sigma_m is not None:
                distance = np.array([qx, qy]) / math.sqrt(squared)
                kinds.append((distance, 0.0, sensors[i].range_sigma_m))
            for by_target, turned, sigma in kinds:
                row = np.zeros(4 * n)
                gone = path[k, i] - first[i]
                row[3 * i : 3 * i + 2] = -by_target
                row[3 * i + 2] = -by_target @ [-gone[1], gone[0]] + turned
                row[3 * n + i] = -turned
                if j < n:
                    gone = path[k, j] - first[j]
                    row[3 * j : 3 * j + 2] = by_target
                    row[3 * j + 2] = by_target @ [-gone[1], gone[0]]
                # sightings from very near are weighted down: see syncplan.observability.rank
                near = math.sqrt(squared) / (NEAREST * orbits.radii.mean())
                row *= math.sqrt(sensors[i].detection_probability or 1.0)
                rows.append(row * min(1.0, near) / sigma)
        read = given.scenario.heading_interval_s or given.scenario.sample_time
        ready = abs(times[k] / read - round(times[k] / read)) < 1e-6
        for i, sigma in compasses if ready else ():
            rows.append(np.eye(4 * n)[3 * i + 2] / sigma)
        matrices.append(np.array(rows).reshape(len(rows), 4 * n))
    return matrices


def _compasses(given: Plan) -> list[tuple[int, float]]:
    """Vehicles with a compass, and its standard deviation in rad."""
    stated = given.scenario.heading_sigma_rad
    each = stated if isinstance(stated, list) else [stated] * given.orbits.count
    return [(i, sigma) for i, sigma in enumerate(each) if sigma is not None]


def _rows(given: Plan) -> Array:
    """(s, 3 n) by the initial poses alone."""
    rows = np.concatenate(_sighting_rows(given, _window_times(given)))
    return rows[:, : 3 * given.orbits.count]


def _scaled(rows: Array, scale: float) -> Array:
    return np.asarray(rows * np.tile([scale, scale, 1.0], rows.shape[1] // 3))


def _rank(rows: Array, scale: float) -> int:
    values = np.linalg.svd(_scaled(rows, scale), compute_uv=False)
    return int(np.count_nonzero(values > RANK_TOLERANCE * values[0]))


def _window_bound(rows: Array) -> float:
    inverse = np.linalg.pinv(rows, rcond=1e-13)
    variance = np.sum(inverse**2, axis=1).reshape(-1, 3)[:, :2].sum(axis=1)
    return float(np.sqrt(variance.max()))


def _cost(given: Plan, objective: str, rows: Array, scale: float, observable: bool) -> float:
    values = np.linalg.svd(_scaled(rows, scale), compute_uv=False) ** 2
    if objective == "trace":
        return -float(values.sum())
    if objective == "logdet":
        return -float(np.log(values).sum()) if observable else math.inf
    if objective == "min_eigenvalue":
        return -float(values[-1]) if observable else 0.0
    rms = _predicted(given)
    return float(rms.max() if objective == "worst_predicted_rms" else np.sqrt(np.mean(rms**2)))


def _predicted(given: Plan) -> Array:
    """(n,) m: RMS of the filter's covariance over the run's second half, in each moment's state.

    Poses, then wind (2), speed scales (n), turn-rate biases (n), bearing biases (n) and gusts
    (2 n), all estimated.
    """
    scenario, orbits, n = given.scenario, given.orbits, given.orbits.count
    step = scenario.sample_time
    number = math.floor(scenario.duration_s / step + 1e-6)
    times = np.arange(number + 1, dtype=np.float64) * step
    path = _paths(given, times)
    rows = _sighting_rows(given, times)
    sigma, motion = scenario.initial_sigma, scenario.motion
    pose = np.tile([sigma.position_m, sigma.position_m, sigma.heading_rad], n)
    covariance = np.diag(np.concatenate([pose, _error_sigmas(given)]) ** 2)
    size = len(covariance)
    wind, scales, biases, shifts, gusts = np.cumsum([3 * n, 2, n, n, n])
    gust = 0.0 if scenario.wind is None else scenario.wind.gust_sigma_mps
    kept = 0.0 if scenario.wind is None else math.exp(-step / scenario.wind.gust_time_s)
    fresh = np.zeros((size, size))
    fresh[gusts:, gusts:] = np.eye(2 * n) * gust**2 * (1.0 - kept**2)
    sample_time = scenario.sample_time
    speed, turn = motion.speed_sigma(sample_time), motion.turn_rate_sigma(sample_time)
    control = np.diag(np.tile([speed**2, turn**2], n))
    speeds, turns = orbits.rate * orbits.radii, orbits.rate * orbits.senses
    variances = []
    for k in range(1, number + 1):
        gone = path[k] - path[k - 1]
        heading = orbits.phases + orbits.senses * (orbits.rate * times[k - 1] + np.pi / 2.0)
        move, drive = np.eye(size), np.zeros((size, 2 * n))
        move[gusts:, gusts:] = kept * np.eye(2 * n)
        for i in range(n):
            move[3 * i, 3 * i + 2], move[3 * i + 1, 3 * i + 2] = -gone[i, 1], gone[i, 0]
            drive[3 * i : 3 * i + 2, 2 * i] = gone[i] / speeds[i]
            slope = _arc(speeds[i], turns[i] + 1e-6, heading[i], step)
            slope = (slope - _arc(speeds[i], turns[i] - 1e-6, heading[i], step)) / 2e-6
            drive[3 * i : 3 * i + 2, 2 * i + 1] = slope
            drive[3 * i + 2, 2 * i + 1] = step
            # a scale errs by a share of the speed, a bias as a reading of the turn rate does
            move[:, scales + i] += drive[:, 2 * i] * speeds[i]
            move[:, biases + i] += drive[:, 2 * i + 1]
            for axis in (0, 1):
                move[3 * i + axis, wind + axis] = step
                move[3 * i + axis, gusts + 2 * i + axis] = step
        covariance = move @ covariance @ move.T + drive @ control @ drive.T + fresh
        if len(rows[k]):
            # rows are by the initial pose: bring them to the pose now
            now = np.zeros((len(rows[k]), size))
            now[:, : 3 * n], now[:, shifts:gusts] = rows[k][:, : 3 * n], rows[k][:, 3 * n :]
            since = path[k] - path[0]
            now[:, 2 : 3 * n : 3] += now[:, 0 : 3 * n : 3] * since[:, 1]
            now[:, 2 : 3 * n : 3] -= now[:, 1 : 3 * n : 3] * since[:, 0]
            spread = now @ covariance @ now.T + np.eye(len(now))
            covariance = covariance - covariance @ now.T @ np.linalg.solve(spread, now @ covariance)
        if 2 * k > number:
            variance = np.diag(covariance)[: 3 * n].reshape(-1, 3)
            variances.append(variance[:, 0] + variance[:, 1])
    return np.asarray(np.sqrt(np.mean(variances, axis=0)))


def _error_sigmas(given: Plan) -> Array:
    """(2 + 5 n,) of wind, speed scales, turn-rate biases, bearing biases, gusts; 0 without."""
    scenario, n = given.scenario, given.orbits.count
    wind, motion = scenario.wind, scenario.motion
    return np.concatenate(
        [
            np.full(2, 0.0 if wind is None else wind.sigma_mps),
            np.full(n, motion.speed_scale_sigma or 0.0),
            np.full(n, motion.turn_rate_bias_sigma_rad_s or 0.0),
            [sensor.bearing_bias_sigma_rad or 0.0 for sensor in scenario.sensors],
            np.full(2 * n, 0.0 if wind is None else wind.gust_sigma_mps),
        ]
    )


def _arc(speed: float, turn: float, heading: float, step: float) -> Array:
    """(2,) m gone in one step along an arc."""
    end = heading + turn * step
    chord = np.array([np.sin(end) - np.sin(heading), np.cos(heading) - np.cos(end)])
    return np.asarray(chord * speed / turn)


# --- the search -----------------------------------------------------------------------------------


def draw(
    number: int, sizes: tuple[int, int] = (4, 8), equip: Equip = as_drawn
) -> tuple[list[str], Refined]:
    """Return what is wrong with the refinement of a scenario, and what it gained."""
    before = draw_plan(number, sizes, equip)
    after = refine(before, workers=1, starts=STARTS)
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


SEARCH = Search(draw, judge, draws=6)
