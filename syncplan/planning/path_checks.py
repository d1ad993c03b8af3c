"""Whether the circles can be flown: findings on distances and areas."""

from collections.abc import Iterator, Sequence

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.contacts import landmark_gaps
from syncplan.planning.distance_limits import TOLERANCE, landmark_limit, separation_limit
from syncplan.planning.findings import MOST_NAMED, Cure, Finding
from syncplan.planning.judged_team import JudgedTeam
from syncplan.scenario.areas import Area
from syncplan.scenario.refine_options import RefineOptions


def vehicles_too_close(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the pairs of vehicles that come nearer than they may, nearest first."""
    names = judged.scenario.vehicle_names
    limit = separation_limit(judged.scenario).worded(judged.orbits.radii)
    each = [
        (
            f"{names[one.a]} and {names[one.b]} come to {one.distance:.4g} m of each other at "
            f"{one.time:.4g} s of each period, below {limit}",
            (names[one.a], names[one.b]),
        )
        for one in judged.too_close
    ]
    cure = Cure("move the circles apart, change phases or senses, or refine with a separation")
    yield from _first_of("vehicles-too-close", each, cure, f"pairs of vehicles come below {limit}")


def landmarks_too_close(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the vehicles that come nearer to a landmark than they may, nearest first."""
    scenario, orbits = judged.scenario, judged.orbits
    asked = landmark_limit(scenario)
    clear = landmark_gaps(orbits.centers, orbits.radii, judged.landmarks)
    near = np.argwhere(clear < asked.least(orbits.radii) * (1.0 - TOLERANCE))
    near = near[np.argsort(clear[tuple(near.T)], kind="stable")]
    limit = asked.worded(orbits.radii)
    names, landmarks = scenario.vehicle_names, scenario.landmark_names
    each = [
        (
            f"{names[vehicle]} passes {landmarks[landmark]} at {clear[vehicle, landmark]:.4g} m, "
            f"below {limit}",
            (names[vehicle], landmarks[landmark]),
        )
        for vehicle, landmark in near.tolist()
    ]
    cure = Cure(
        f"{_not_cleared(judged)}move the circle or the landmark; where the landmark is no "
        "obstacle, set landmark_clearance_m to what is safe, or to 0"
    )
    yield from _first_of(
        "landmark-too-close", each, cure, f"passes of landmarks come below {limit}"
    )


def _not_cleared(judged: JudgedTeam) -> str:
    """What refinement could not do, in words; empty for a plan that was not refined."""
    if judged.refinement is None:
        return ""
    options = judged.refinement.options or judged.scenario.refine or RefineOptions()
    if {"centers", "radii"}.isdisjoint(options.vary):
        return "refinement varied phases alone, which moves no path: let it vary centers; or "
    return "refinement could not clear it: give it more room (center_box_m, radius_m); or "


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


def _first_of(
    code: str, each: Sequence[tuple[str, tuple[str, ...]]], cure: Cure, more: str
) -> Iterator[Finding]:
    """A stop for each of the first, given in words and subjects; the rest is counted in one."""
    for message, subjects in each[:MOST_NAMED]:
        yield Finding(code, "stop", message, subjects, cure)
    if rest := each[MOST_NAMED:]:
        subjects = tuple(dict.fromkeys(name for _, named in rest for name in named))
        yield Finding(code, "stop", f"{len(rest)} more {more}", subjects)


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
