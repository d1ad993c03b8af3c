"""Whether the circles can be flown: findings on distances, areas and limits."""

from collections.abc import Iterator

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.separation import pairs_nearer_than
from syncplan.planning.findings import Cure, Finding
from syncplan.planning.judged_team import JudgedTeam
from syncplan.scenario.areas import Area

__all__ = [
    "in_keep_out",
    "landmarks_too_close",
    "outside_area",
    "over_limit",
    "vehicles_too_close",
]

TOO_NEAR = 0.1
"""Share of the mean radius below which a distance is too small where no least one is stated."""

TOLERANCE = 1e-6
"""Share of a limit by which it may be missed and still be met: what a solver's accuracy leaves."""

MOST_NAMED = 5
"""Findings of one code that are worded one by one; the rest is counted."""


def vehicles_too_close(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the pairs of vehicles that come nearer than they may, nearest first."""
    names = judged.scenario.vehicle_names
    least, stated = _least(judged, judged.scenario.min_separation_m or None)
    near = [
        one
        for one in pairs_nearer_than(judged.orbits, least)
        if one.distance < least * (1.0 - TOLERANCE)
    ]
    limit = f"min_separation_m {least:g}" if stated else _supposed(least, "min_separation_m")
    for one in near[:MOST_NAMED]:
        yield Finding(
            "vehicles-too-close",
            "stop",
            f"{names[one.a]} and {names[one.b]} come to {one.distance:.4g} m of each other at "
            f"{one.time:.4g} s of each period, below {limit}",
            (names[one.a], names[one.b]),
            Cure("move the circles apart, change phases or senses, or refine with a separation"),
        )
    if rest := near[MOST_NAMED:]:
        yield Finding(
            "vehicles-too-close",
            "stop",
            f"{len(rest)} more pairs of vehicles come below {limit}",
            tuple(dict.fromkeys(names[k] for one in rest for k in (one.a, one.b))),
        )


def landmarks_too_close(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the vehicles that come nearer to a landmark than they may, nearest first.

    A circle of radius R about c passes a landmark L at ||c - L| - R|, once in every turn.
    """
    scenario, orbits = judged.scenario, judged.orbits
    least, stated = _least(judged, scenario.landmark_clearance_m)
    away = np.hypot(*(orbits.centers[:, None] - judged.landmarks[None]).T).T
    clear = np.abs(away - orbits.radii[:, None])
    near = np.argwhere(clear < least * (1.0 - TOLERANCE))
    near = near[np.argsort(clear[tuple(near.T)], kind="stable")]
    limit = (
        f"landmark_clearance_m {least:g}" if stated else _supposed(least, "landmark_clearance_m")
    )
    names, landmarks = scenario.vehicle_names, scenario.landmark_names
    for vehicle, landmark in near[:MOST_NAMED].tolist():
        yield Finding(
            "landmark-too-close",
            "stop",
            f"{names[vehicle]} passes {landmarks[landmark]} at {clear[vehicle, landmark]:.4g} m, "
            f"below {limit}",
            (names[vehicle], landmarks[landmark]),
            Cure(
                "move the circle or the landmark; where the landmark is no obstacle, set "
                "landmark_clearance_m to what is safe, or to 0"
            ),
        )
    if rest := near[MOST_NAMED:].tolist():
        yield Finding(
            "landmark-too-close",
            "stop",
            f"{len(rest)} more passes of landmarks come below {limit}",
            tuple(dict.fromkeys(name for a, b in rest for name in (names[a], landmarks[b]))),
        )


def outside_area(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the vehicles whose circles leave the area."""
    for key, name, clear in _crossings(judged, within=True):
        yield Finding(
            "outside-area",
            "stop",
            f"the circle of {name} leaves {key} by {-clear:.4g} m",
            (name,),
            Cure("move the circle inwards, or make it smaller"),
        )


def in_keep_out(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the vehicles whose circles pass through a keep-out; flying round one is no fault."""
    for key, name, clear in _crossings(judged, within=False):
        yield Finding(
            "in-keep-out",
            "stop",
            f"the circle of {name} passes through {key}; {-clear:.4g} m of its radius would clear "
            "it",
            (name,),
            Cure("move the circle, or change its radius"),
        )


def over_limit(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the vehicles whose speed on their circle is none they can keep.

    A rate above limits.turn_rate_rad_s is refused where the scenario is read.
    """
    limits = judged.scenario.limits
    if limits is None or limits.speed_mps is None:
        return
    low, high = limits.speed_mps
    names, speeds = judged.scenario.vehicle_names, judged.orbits.speeds.tolist()
    for name, speed in zip(names, speeds, strict=True):
        if low * (1.0 - TOLERANCE) <= speed <= high * (1.0 + TOLERANCE):
            continue
        yield Finding(
            "over-limit",
            "stop",
            f"{name} has to keep {speed:.4g} m/s; limits.speed_mps allows {low:g} to {high:g}",
            (name,),
            Cure("change its radius, or the common rate"),
        )


def _least(judged: JudgedTeam, stated: float | None) -> tuple[float, bool]:
    """The least distance in m, and whether the scenario states it."""
    if stated is not None:
        return stated, True
    return TOO_NEAR * float(judged.orbits.radii.mean()), False


def _supposed(least: float, key: str) -> str:
    return f"{least:.4g} m, a tenth of the mean radius, as no {key} is stated"


def _crossings(judged: JudgedTeam, *, within: bool) -> Iterator[tuple[str, str, float]]:
    """(key of the polygon, vehicle, m by which its circle keeps clear: negative) of each fault."""
    area = Area.of(judged.scenario.area_m, judged.scenario.keep_out_m)
    if not area.limited:
        return
    orbits, names = judged.orbits, judged.scenario.vehicle_names
    clear = area.path_clearances(orbits.centers, orbits.radii)
    for (key, _, inner), row in zip(area.polygons(), clear, strict=True):
        for k in np.flatnonzero(_crossed(row, orbits.radii)) if inner == within else ():
            yield key, names[k], float(row[k])


def _crossed(clearances: Array, radii: Array) -> Array:
    return np.asarray(clearances < -TOLERANCE * radii)
