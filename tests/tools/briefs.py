"""Briefs for tests, and what they ask for, checked by sampling alone."""

import math
from typing import Any

import numpy as np
import shapely

from syncplan.arrays import Array, Flags
from syncplan.planning.plans import Plan
from syncplan.scenario.brief import Brief, brief_of

FIELD: dict[str, Any] = {
    "area_m": [[0.0, 0.0], [200.0, 0.0], [200.0, 120.0], [0.0, 120.0]],
    "vehicle": {"speed_mps": 5.0, "min_radius_m": 10.0},
    "sensor": {"range_m": 90.0, "bearing_sigma_rad": 0.03, "sample_time_s": 0.25},
    "motion": {
        "position_random_walk_m_sqrt_s": 0.03,
        "angle_random_walk_rad_sqrt_s": 0.003,
    },
    "team": {"min": 2, "max": 3},
    "landmarks": {"max": 2},
    "purpose": {"cover": {"share": 0.6, "swath_m": 50.0}},
    "need": {"worst_rms_m": 2.0},
    "effort": "quick",
}
"""A field that two or three vehicles cover."""


def brief(**changes: Any) -> Brief:
    """Return the brief of FIELD with keys replaced."""
    return brief_of({**FIELD, **changes})


def within(corners: Array, points: Array) -> Flags:
    """Return (p,) whether points lie in a polygon."""
    return np.asarray(shapely.contains_xy(shapely.Polygon(corners), points))


def broken(brief: Brief, plan: Plan, *, slack: float = 1e-3) -> list[str]:
    """Return what a plan breaks of a brief, by dense sampling of its circles and of the area."""
    orbits, found = plan.orbits, []
    turn = np.linspace(0.0, 2.0 * np.pi, 1440, endpoint=False)
    paths = orbits.centers[:, None] + orbits.radii[:, None, None] * np.stack(
        [np.cos(turn), np.sin(turn)], axis=-1
    )
    flown = paths.reshape(-1, 2)
    # a hair within the area, as circles may touch its edge
    middle = np.mean(brief.area_m, axis=0)
    if not within(np.array(brief.area_m), flown + slack * np.sign(middle - flown)).all():
        found.append("area")
    for corners in brief.keep_out_m or []:
        shrunk = np.mean(corners, axis=0) + (1.0 - slack) * (corners - np.mean(corners, axis=0))
        if within(shrunk, flown).any():
            found.append("keep-out")
    slowest, fastest = brief.vehicle.speeds
    speeds = orbits.rate * orbits.radii
    if np.any(speeds < slowest * (1 - 1e-9)) or np.any(speeds > fastest * (1 + 1e-9)):
        found.append("speed")
    if brief.vehicle.min_radius_m and np.any(orbits.radii < brief.vehicle.min_radius_m - 1e-9):
        found.append("radius")
    if brief.vehicle.turn_rate_rad_s and orbits.rate > brief.vehicle.turn_rate_rad_s * (1 + 1e-9):
        found.append("turn rate")
    if brief.vehicle.bank_deg:
        bank = np.degrees(np.arctan(speeds**2 / (9.80665 * orbits.radii)))
        if np.any(bank > brief.vehicle.bank_deg + 1e-6):
            found.append("bank")
    times = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    angles = orbits.phases[:, None] + orbits.senses[:, None] * times
    places = orbits.centers[:, None] + orbits.radii[:, None, None] * np.stack(
        [np.cos(angles), np.sin(angles)], axis=-1
    )
    a, b = np.triu_indices(orbits.count, 1)
    apart = np.linalg.norm(places[a] - places[b], axis=2).min(initial=np.inf)
    if apart < (brief.min_separation_m or 0.0) * (1.0 - slack):
        found.append(f"separation {apart}")
    return found + _purpose_broken(brief, orbits.centers, orbits.radii)


def _purpose_broken(brief: Brief, centers: Array, radii: Array) -> list[str]:
    purpose = brief.purpose
    if purpose.cover is not None:
        low, high = np.min(brief.area_m, axis=0), np.max(brief.area_m, axis=0)
        points = np.random.default_rng(1).uniform(low, high, (40_000, 2))
        open_ = within(np.array(brief.area_m), points)
        for corners in brief.keep_out_m or []:
            open_ &= ~within(np.array(corners), points)
        points = points[open_]
        away = np.hypot(*(points[:, None] - centers[None]).transpose(2, 0, 1))
        near = (np.abs(away - radii) <= 0.5 * purpose.cover.swath_m).any(axis=1)
        share = float(near.mean())
        # four sigma of the sample
        if share < purpose.cover.share - 4.0 * math.sqrt(0.25 / len(points)):
            return [f"covers {share}"]
    for x, y in purpose.visit_m or []:
        off = np.abs(np.hypot(centers[:, 0] - x, centers[:, 1] - y) - radii).min()
        if off > purpose.within_m * (1.0 + 1e-9):
            return [f"misses {x}, {y} by {off}"]
    if purpose.keep is not None:
        kept = centers[: purpose.keep.count]
        apart = [math.dist(kept[a], kept[b]) for a in range(len(kept)) for b in range(a)]
        if len(kept) < purpose.keep.count or min(apart, default=math.inf) < (
            purpose.keep.spread_m * (1.0 - 1e-9)
        ):
            return ["spread"]
    return []
