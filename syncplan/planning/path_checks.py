"""Findings on paths and speeds: distances, areas, and speeds in wind."""

from collections.abc import Iterator, Sequence
from math import exp, hypot, log, pi, sqrt

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.contacts import reachable_pairs
from syncplan.phrases import listed, percent
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
from syncplan.scenario.disturbances import Wind
from syncplan.scenario.models import RefineOptions

# --- distances and areas --------------------------------------------------------------------------


def vehicles_too_close(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield findings on pairs of vehicles that come nearer than allowed, nearest first."""
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
            f"{names[vehicle]} passes {landmarks[landmark]} at {away:.4g} m, below {limit}",
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
    for key, name, clear in _crossings(judged, within=True):
        yield Remark(
            "stop",
            f"the circle of {name} leaves {key} by {-clear:.4g} m",
            (name,),
            cure="move the circle inwards, or make it smaller",
        )


def in_keep_out(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield a finding for each circle that passes through a keep-out; it may go round one."""
    for key, name, clear in _crossings(judged, within=False):
        yield Remark(
            "stop",
            f"the circle of {name} passes through {key}; {-clear:.4g} m of its radius would clear "
            "it",
            (name,),
            cure="move the circle, or change its radius",
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
    """Yield (key of the polygon, vehicle, negative clearance of its circle in m) of each fault."""
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


# --- speeds ---------------------------------------------------------------------------------------
#
# Wind is common and constant, and gusts add to it. Both state the standard deviation of each
# component, so the speed W of the air that a vehicle meets is Rayleigh distributed with
# s = hypot(wind, gust):
#
#     P(W > w) = exp(-w^2 / (2 s^2))        W95 = s sqrt(-2 ln 0.05) = 2.45 s
#
# A circle at ground speed v needs airspeeds from |v - W| to v + W. A vehicle whose largest airspeed
# V is below v + W falls behind upwind. It catches up downwind as long as one turn at full airspeed,
# which takes R times
#
#     4 V E(W / V) / (V^2 - W^2)        E the complete elliptic integral of the second kind
#
# seconds, takes no longer than the period 2 pi R / v. In stronger wind it falls behind for ever:
# that stops the plan. Needing airspeeds below the least one, or turns of the heading near W = v
# faster than vehicles turn, is soon made up for: over a whole turn, neither the least airspeed nor
# a turn rate limit above the common rate holds a vehicle back.


EXCEEDED = 0.05
"""Share of winds that may be too strong, as for the trials of a flight that may fail."""

LINEAR_SHARE = 0.5
"""Share of the ground speed above which a wind's sigma makes heading deviations large."""


def over_limit(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield findings on vehicles that cannot keep the speed of their circle in the wind stated.

    A rate above limits.turn_rate_rad_s is refused when the scenario is read.
    """
    limits = judged.scenario.limits
    if limits is None or limits.speed_mps is None:
        return
    low, high = limits.speed_mps
    names, speeds = judged.scenario.vehicle_names, judged.orbits.speeds.tolist()
    kept = []
    for name, speed in zip(names, speeds, strict=True):
        if low * (1.0 - TOLERANCE) <= speed <= high * (1.0 + TOLERANCE):
            kept.append((speed, name))
            continue
        yield Remark(
            "stop",
            f"{name} has to keep {speed:.4g} m/s; limits.speed_mps allows {low:g} to {high:g}",
            (name,),
            cure="change its radius, or the common rate",
        )
    yield from _over_limit_in_wind(_air_sigma(judged), high, sorted(kept, key=lambda one: -one[0]))


def strong_wind(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that the wind is too strong for predictions of small deviations."""
    sigma, speeds = _air_sigma(judged), judged.orbits.speeds
    slow = np.flatnonzero(sigma > LINEAR_SHARE * speeds)
    if not len(slow):
        return
    names = [judged.scenario.vehicle_names[k] for k in slow[np.argsort(speeds[slow])]]
    yield Remark(
        "warning",
        f"wind and gusts have a sigma of {sigma:.3g} m/s, over half the ground speed of "
        f"{listed(names, MOST_NAMED)} (from {speeds.min():.3g} m/s): predictions assume small "
        "deviations from the circles",
        tuple(names),
        cure="faster circles, or a check with fly, which does not assume this",
    )


def wind_made_up_for(speed: float, airspeed: float) -> float:
    """Return the strongest wind in m/s in which a circle at ground speed `speed` is flown on time.

    `airspeed` is the largest available. The wind is 0 if that does not exceed `speed`.
    """
    from scipy.optimize import brentq
    from scipy.special import ellipe

    if airspeed <= speed:
        return 0.0

    def spare(share: float) -> float:
        """Mean ground speed in excess of `speed` over one turn in a wind of `share` airspeeds."""
        turn = 2.0 * float(ellipe(share**2)) / pi
        return airspeed * (1.0 - share**2) / turn - speed

    return airspeed * float(brentq(spare, 0.0, 1.0))


def _over_limit_in_wind(
    sigma: float, high: float, vehicles: list[tuple[float, str]]
) -> Iterator[Remark]:
    """Yield the findings on vehicles (ground speed, name), the fastest first, in a wind."""
    strongest = sigma * sqrt(-2.0 * log(EXCEEDED))
    over = [
        (speed, name, wind_made_up_for(speed, high))
        for speed, name in vehicles
        if speed + strongest > high
    ]
    stops = [one for one in over if one[2] < strongest]
    air = (
        f"the wind and gusts stated, which exceed {strongest:.3g} m/s in {percent(EXCEEDED)} of "
        f"cases; limits.speed_mps allows {high:g}"
    )
    cure = "a higher largest airspeed, slower circles, or less wind"
    if stops:
        each = [
            f"{name} needs {speed + strongest:.3g} m/s and completes its turns in time in "
            f"{percent(_share_below(most, sigma))} of winds"
            for speed, name, most in stops
        ]
        yield Remark(
            "stop",
            f"the airspeeds are too low for {air}: {listed(each, MOST_NAMED)}",
            tuple(name for _, name, _ in stops),
            cure=cure,
        )
    elif over:
        each = [
            f"{name} needs {speed + strongest:.3g} m/s and keeps its place in "
            f"{percent(_share_below(high - speed, sigma))} of winds"
            for speed, name, _ in over
        ]
        yield Remark(
            "warning",
            f"vehicles fall behind upwind and catch up downwind in {air}: "
            f"{listed(each, MOST_NAMED)}",
            tuple(name for _, name, _ in over),
            cure=cure,
        )


def _share_below(wind: float, sigma: float) -> float:
    return 1.0 - exp(-0.5 * (max(wind, 0.0) / sigma) ** 2)


def _air_sigma(judged: JudgedTeam) -> float:
    """Standard deviation in m/s of each component of wind and gust together."""
    wind = judged.scenario.wind or Wind()
    return hypot(wind.sigma_mps, wind.gust_sigma_mps)
