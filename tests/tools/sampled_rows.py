"""Sightings of a plan by sampling, and their rows by hand: to judge the package's without it.

Positions at many instants in plain NumPy, sightings by comparing distances and angles sample by
sample, obstacles by Shapely.
"""

import math
from collections.abc import Collection
from typing import Any

import numpy as np
import shapely

from syncplan.arrays import Array
from syncplan.planning.plans import Plan

RANK_TOLERANCE = 1e-8
NEAREST = 1e-3


def paths_of(given: Plan, times: Array) -> Array:
    """Return the places (k, n, 2) in m."""
    orbits = given.orbits
    angle = orbits.phases + orbits.senses * orbits.rate * times[:, None]
    return np.asarray(
        orbits.centers + orbits.radii[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    )


def rooms_of(given: Plan, times: Array) -> Array:
    """Return (k, n, n + m) m by which vehicles have bodies in range; -inf where these are not seen.

    Outside its view, behind an obstacle, or where its sensor is not ready.
    """
    orbits, sensors = given.orbits, given.scenario.sensors
    path = paths_of(given, times)
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


def window_times(given: Plan) -> Array:
    """Return the times (k,) in s of the samples of the window."""
    step = given.scenario.sample_time
    return np.arange(math.ceil(given.scenario.window / step - 1e-9), dtype=np.float64) * step


def sampled_rows(given: Plan, blind: Collection[int] = ()) -> Array:
    """Return (s, 3 n) the window's sightings by the initial poses in m and rad, over their sigma.

    Vehicles that are `blind` see nothing.
    """
    orbits, sensors, n = given.orbits, given.scenario.sensors, given.orbits.count
    compasses, times = _compasses(given), window_times(given)
    room = rooms_of(given, times)
    room[:, list(blind)] = -np.inf
    path, first = paths_of(given, times), paths_of(given, np.zeros(1))[0]
    rows = []
    for k in range(len(times)):
        for i, j in np.argwhere(room[k] >= -1e-12 * orbits.radii.max()):
            target = path[k, j] if j < n else given.landmarks[j - n]
            qx, qy = target - path[k, i]
            squared = max(qx**2 + qy**2, 1e-20)
            bearing = np.array([-qy, qx]) / squared
            kinds = [(bearing, -1.0, sensors[i].bearing_sigma_rad)]
            if sensors[i].range_sigma_m is not None:
                distance = np.array([qx, qy]) / math.sqrt(squared)
                kinds.append((distance, 0.0, sensors[i].range_sigma_m))
            for by_target, turned, sigma in kinds:
                row = np.zeros(3 * n)
                gone = path[k, i] - first[i]
                row[3 * i : 3 * i + 2] = -by_target
                row[3 * i + 2] = -by_target @ [-gone[1], gone[0]] + turned
                if j < n:
                    gone = path[k, j] - first[j]
                    row[3 * j : 3 * j + 2] = by_target
                    row[3 * j + 2] = by_target @ [-gone[1], gone[0]]
                # sightings from very near are weighted down: see syncplan.observability.rank
                near = math.sqrt(squared) / (NEAREST * orbits.radii.mean())
                row *= math.sqrt(sensors[i].detection_probability or 1.0)
                rows.append(row * min(1.0, near) / sigma)
        read = given.scenario.heading_interval_s or given.scenario.sample_time
        if abs(times[k] / read - round(times[k] / read)) < 1e-6:
            rows += [np.eye(3 * n)[3 * i + 2] / sigma for i, sigma in compasses]
    return np.array(rows).reshape(len(rows), 3 * n)


def _compasses(given: Plan) -> list[tuple[int, float]]:
    """Vehicles with a compass, and its standard deviation in rad."""
    stated = given.scenario.heading_sigma_rad
    each = stated if isinstance(stated, list) else [stated] * given.orbits.count
    return [(i, sigma) for i, sigma in enumerate(each) if sigma is not None]


def scaled(rows: Array, scale: float) -> Array:
    """Return the rows by places in units of `scale` m."""
    return np.asarray(rows * np.tile([scale, scale, 1.0], rows.shape[1] // 3))


def rank_of(rows: Array, scale: float) -> int:
    """Return the rank of rows."""
    values = np.linalg.svd(scaled(rows, scale), compute_uv=False)
    return int(np.count_nonzero(values > RANK_TOLERANCE * values[0]))
