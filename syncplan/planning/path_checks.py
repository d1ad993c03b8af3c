"""Findings on paths and speeds: distances, areas, and limits of speed."""

from collections.abc import Iterator, Sequence

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.contacts import reachable_pairs
from syncplan.phrases import listed, metres
from syncplan.planning.judged_team import (
    MOST_NAMED,
    TOLERANCE,
    JudgedTeam,
    Remark,
    landmark_limit,
    purpose_measure,
    separation_limit,
)
from syncplan.scenario.areas import Area
from syncplan.scenario.models import RefineOptions

# --- distances and areas --------------------------------------------------------------------------


def vehicles_too_close(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield findings on pairs of vehicles that come nearer than allowed, nearest first."""
    names = judged.scenario.vehicle_names
    limit = separation_limit(judged.scenario).worded(judged.orbits.radii)
    each = [
        (
            f"{names[one.a]} and {names[one.b]} come to {metres(one.distance)} m of each other at "
            f"{one.time:.4g} s of each period, below {limit}",
            (names[one.a], names[one.b]),
        )
        for one in judged.too_close
    ]
    cure = "move the circles apart, change phases or senses, or refine with a separation"
    yield from _first_of(each, cure, f"pairs of vehicles come below {limit}")


def landmarks_too_close(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield findings on vehicles that come nearer to a landmark than allowed, nearest first."""
    scenario, orbits = judged.scenario, judged.orbits
    asked = landmark_limit(scenario)
    least = asked.least(orbits.radii)
    a, b = reachable_pairs(orbits, np.full(orbits.count, least), judged.landmarks)
    a, b = a[b >= orbits.count], b[b >= orbits.count] - orbits.count
    clear = np.abs(np.hypot(*(orbits.centers[a] - judged.landmarks[b]).T) - orbits.radii[a])
    order = np.argsort(clear, kind="stable")
    order = order[clear[order] < least * (1.0 - TOLERANCE)]
    limit = asked.worded(orbits.radii)
    names, landmarks = scenario.vehicle_names, scenario.landmark_names
    each = [
        (
            f"{names[vehicle]} passes {landmarks[landmark]} at {metres(away)} m, below {limit}",
            (names[vehicle], landmarks[landmark]),
        )
        for vehicle, landmark, away in zip(a[order], b[order], clear[order], strict=True)
    ]
    cure = (
        f"{_not_cleared(judged)}move the circle or the landmark; where the landmark is no "
        "obstacle, set landmark_clearance_m to what is safe, or to 0"
    )
    yield from _first_of(each, cure, f"passes of landmarks come below {limit}")


def _not_cleared(judged: JudgedTeam) -> str:
    """Sentence on the failure of refinement; empty for a plan that was not refined."""
    if judged.refinement is None:
        return ""
    options = judged.refinement.options or judged.scenario.refine or RefineOptions()
    if {"centers", "radii"}.isdisjoint(options.vary):
        return "refinement varied phases alone, which moves no path: let it vary centers; or "
    return "refinement could not clear it: give it more room (center_box_m, radius_m); or "


def outside_area(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield a finding for each vehicle whose circle leaves the area."""
    for polygon, name, clear in _crossings(judged, within=True):
        yield Remark(
            "stop",
            f"the circle of {name} leaves {polygon} by {-clear:.4g} m",
            (name,),
            cure="move the circle inwards, or make it smaller",
        )


def in_keep_out(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield a finding for each circle that passes through a keep-out; it may go round one."""
    for polygon, name, clear in _crossings(judged, within=False):
        yield Remark(
            "stop",
            f"the circle of {name} passes through {polygon}; {-clear:.4g} m of its radius would "
            "clear it",
            (name,),
            cure="move the circle, or change its radius",
        )


ROOM_SHARE = 3.0
"""Room at an edge over a vehicle's flown distance from its circle (RMS) that is enough."""


def edge_near(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that vehicles fly further off their circles than edges leave room for."""
    area, flight = Area.of(judged.scenario.area_m, judged.scenario.keep_out_m), judged.flight
    if not area.limited or flight is None:
        return
    orbits = judged.orbits
    room = area.path_clearances(orbits.centers, orbits.radii).min(axis=0)
    # a vehicle that was lost in every flight has no figures
    flown = {vehicle.name: vehicle.tracking_rms_m for vehicle in flight.vehicles}
    strays = np.array([flown.get(name, 0.0) for name in judged.scenario.vehicle_names])
    inside = np.logical_not(_crossed(room, orbits.radii))
    near = np.flatnonzero(inside & (room < ROOM_SHARE * strays))
    if len(near):
        names = tuple(judged.scenario.vehicle_names[k] for k in near)
        worst = near[np.argmax(ROOM_SHARE * strays[near] - room[near])]
        yield Remark(
            "warning",
            f"{listed(names, MOST_NAMED)} may cross an edge of the area or of a keep-out in "
            f"flight: the circle of {judged.scenario.vehicle_names[worst]} keeps "
            f"{max(room[worst], 0.0):.2g} m from it, and flights were {strays[worst]:.2g} m (RMS) "
            "off",
            names,
            cure=f"move circles, or make them smaller: {ROOM_SHARE * strays[worst]:.2g} m of room "
            "are three times that",
        )


def purpose_missed(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that the circles miss their purpose."""
    measure = purpose_measure(judged.scenario)
    if measure is not None:
        room = measure.room(judged.orbits.centers, judged.orbits.radii)
        if room < -TOLERANCE * measure.size:
            yield Remark(
                "stop", measure.worded(room), cure="move the circles, or change their radii"
            )


def _first_of(
    each: Sequence[tuple[str, tuple[str, ...]]], cure: str, more: str
) -> Iterator[Remark]:
    """Yield a stop for each of the first, given as message and subjects; one counts the rest."""
    for message, subjects in each[:MOST_NAMED]:
        yield Remark("stop", message, subjects, cure=cure)
    if rest := each[MOST_NAMED:]:
        subjects = tuple(dict.fromkeys(name for _, named in rest for name in named))
        yield Remark("stop", f"{len(rest)} more {more}", subjects)


def _crossings(judged: JudgedTeam, *, within: bool) -> Iterator[tuple[str, str, float]]:
    """Yield (polygon in words, vehicle, negative clearance of its circle in m) of each fault."""
    area = Area.of(judged.scenario.area_m, judged.scenario.keep_out_m)
    if not area.limited:
        return
    orbits, names = judged.orbits, judged.scenario.vehicle_names
    clear = area.path_clearances(orbits.centers, orbits.radii)
    first = 0 if area.inside is None else 1
    for number, ((_, _, inner), row) in enumerate(zip(area.polygons(), clear, strict=True)):
        polygon = "the area" if inner else f"keep-out {number - first + 1}"
        for k in np.flatnonzero(_crossed(row, orbits.radii)) if inner == within else ():
            yield polygon, names[k], float(row[k])


def _crossed(clearances: Array, radii: Array) -> Array:
    return np.asarray(clearances < -TOLERANCE * radii)


# --- speeds ---------------------------------------------------------------------------------------


def over_limit(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield findings on vehicles whose speed on their circle is outside their limits, in still air.

    A rate above limits.turn_rate_rad_s is refused when the scenario is read. Flights show what wind
    and gusts ask for beyond that.
    """
    limits = judged.scenario.limits
    if limits is None or limits.speed_mps is None:
        return
    low, high = limits.speed_mps
    names, speeds = judged.scenario.vehicle_names, judged.orbits.speeds.tolist()
    for name, speed in zip(names, speeds, strict=True):
        if not low * (1.0 - TOLERANCE) <= speed <= high * (1.0 + TOLERANCE):
            yield Remark(
                "stop",
                f"{name} has to keep {speed:.4g} m/s; limits.speed_mps allows {low:g} to {high:g}",
                (name,),
                cure="change its radius, or the common rate",
            )
