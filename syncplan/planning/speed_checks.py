"""Whether vehicles can keep to their circles in the wind: findings on speeds.

Wind is common and constant, gusts come on top; each component has its own standard deviation, so
the speed W of all air that a vehicle meets is Rayleigh distributed with s = hypot(wind, gust):

    P(W > w) = exp(-w^2 / (2 s^2))        W95 = s sqrt(-2 ln 0.05) = 2.45 s

Through the air, a circle at ground speed v needs from |v - W| to v + W. A vehicle whose largest
airspeed V is below v + W falls behind against the wind, and makes up for it with the wind while one
turn at full airspeed, R times

    4 V E(W / V) / (V^2 - W^2)        E the complete elliptic integral of the second kind

seconds, takes no longer than the period 2 pi R / v. Beyond, it falls behind for ever: that stops
the plan. Airspeeds below the least one, and turns of the heading near W = v that are faster than
vehicles turn, are soon made up for: over a whole turn a slow limit or a turn rate above the common
rate never is what a vehicle lacks.
"""

from collections.abc import Iterator
from math import exp, hypot, log, pi, sqrt

import numpy as np

from syncplan.phrases import listed, percent
from syncplan.planning.distance_limits import TOLERANCE
from syncplan.planning.findings import MOST_NAMED, Cure, Finding
from syncplan.planning.judged_team import JudgedTeam
from syncplan.scenario.disturbances import Wind

EXCEEDED = 0.05
"""Share of winds that may be too much, as of the trials of a flight that may fail."""

LINEAR_SHARE = 0.5
"""Of the ground speed: with a larger sigma of the wind, headings are no small angles off."""


def over_limit(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the vehicles whose speed on their circle is none they can keep, in the wind stated.

    A rate above limits.turn_rate_rad_s is refused where the scenario is read.
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
        yield Finding(
            "over-limit",
            "stop",
            f"{name} has to keep {speed:.4g} m/s; limits.speed_mps allows {low:g} to {high:g}",
            (name,),
            Cure("change its radius, or the common rate"),
        )
    yield from _over_limit_in_wind(_air_sigma(judged), high, sorted(kept, key=lambda one: -one[0]))


def strong_wind(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that the wind is no small disturbance of a circle."""
    sigma, speeds = _air_sigma(judged), judged.orbits.speeds
    slow = np.flatnonzero(sigma > LINEAR_SHARE * speeds)
    if not len(slow):
        return
    names = [judged.scenario.vehicle_names[k] for k in slow[np.argsort(speeds[slow])]]
    yield Finding(
        "strong-wind",
        "warning",
        f"wind and gusts have a sigma of {sigma:.3g} m/s, over half the ground speed of "
        f"{listed(names, MOST_NAMED)} (from {speeds.min():.3g} m/s): predictions assume small "
        "deviations from the circles",
        tuple(names),
        Cure("faster circles, or a check with fly, which does not assume this"),
    )


def wind_made_up_for(speed: float, airspeed: float) -> float:
    """Return the strongest wind in m/s in which a circle at a ground speed is flown on time.

    `airspeed` is the largest there is; 0 where it is no larger than the ground speed.
    """
    from scipy.optimize import brentq
    from scipy.special import ellipe

    if airspeed <= speed:
        return 0.0

    def spare(share: float) -> float:
        """Ground speed that one turn in a wind of `share` airspeeds allows, beyond that wanted."""
        turn = 2.0 * float(ellipe(share**2)) / pi
        return airspeed * (1.0 - share**2) / turn - speed

    return airspeed * float(brentq(spare, 0.0, 1.0))


def _over_limit_in_wind(
    sigma: float, high: float, vehicles: list[tuple[float, str]]
) -> Iterator[Finding]:
    """The findings on vehicles (ground speed, name), the fastest first, in a wind."""
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
    cure = Cure("a higher largest airspeed, slower circles, or less wind")
    if stops:
        each = [
            f"{name} needs {speed + strongest:.3g} m/s and completes its turns in time in "
            f"{percent(_share_below(most, sigma))} of winds"
            for speed, name, most in stops
        ]
        yield Finding(
            "over-limit",
            "stop",
            f"the airspeeds are too low for {air}: {listed(each, MOST_NAMED)}",
            tuple(name for _, name, _ in stops),
            cure,
        )
    elif over:
        each = [
            f"{name} needs {speed + strongest:.3g} m/s and keeps its place in "
            f"{percent(_share_below(high - speed, sigma))} of winds"
            for speed, name, _ in over
        ]
        yield Finding(
            "over-limit",
            "warning",
            f"vehicles fall behind upwind and catch up downwind in {air}: "
            f"{listed(each, MOST_NAMED)}",
            tuple(name for _, name, _ in over),
            cure,
        )


def _share_below(wind: float, sigma: float) -> float:
    return 1.0 - exp(-0.5 * (max(wind, 0.0) / sigma) ** 2)


def _air_sigma(judged: JudgedTeam) -> float:
    """m/s, of each component of wind and gust together."""
    wind = judged.scenario.wind or Wind()
    return hypot(wind.sigma_mps, wind.gust_sigma_mps)
