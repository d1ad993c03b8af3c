"""Whether a plan can be flown by vehicles that steer by their estimates: findings of a flight.

A plan that was not flown has none of these. Trials are few, so what happened in some of them is a
warning, and what happened in more than MOST_SHARE of them stops the flight.
"""

import math
from collections.abc import Iterator

from syncplan.phrases import listed
from syncplan.planning.findings import Cure, Finding, Level
from syncplan.planning.flight_record import FlightRecord
from syncplan.planning.judged_team import JudgedTeam

__all__ = ["MOST_SHARE", "lost_in_flight", "phase_not_kept", "too_close_in_flight"]

MOST_SHARE = 0.05
"""Share of trials above which what goes wrong stops a flight."""

MOST_NAMED = 3

PHASE_SIGMAS = 2.0
"""A phase is kept where so many times its RMS error is within the tolerance."""


def lost_in_flight(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the findings that filters were lost, or vehicles out of contact, in some trials."""
    flight = judged.flight
    if flight is None:
        return
    if flight.lost_share > 0.0:
        yield Finding(
            "lost-in-flight",
            _level(flight.lost_share),
            f"the filter was lost in {_share(flight.lost_share)} of {_flown(flight)}: some "
            "vehicle's error was over 5 times the bound along its path",
            cure=Cure("filter.kind robust, more landmarks in view, or errors as states"),
        )
    if flight.out_of_contact_share > 0.0:
        yield Finding(
            "lost-in-flight",
            _level(flight.out_of_contact_share),
            f"a vehicle was out of contact for over two periods in "
            f"{_share(flight.out_of_contact_share)} of {_flown(flight)}",
            cure=Cure("meetings that are further within range, or further links"),
        )


def too_close_in_flight(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that vehicles came nearer than they may in some trials."""
    flight = judged.flight
    if flight is None or flight.separations is None or not flight.too_close_share:
        return
    yield Finding(
        "too-close-in-flight",
        _level(flight.too_close_share),
        f"vehicles came nearer than min_separation_m {judged.scenario.separation:g} in "
        f"{_share(flight.too_close_share)} of {_flown(flight)}: {flight.separations[1]:.3g} m in "
        f"the worst, {flight.separations[0]:.3g} m in the median one",
        cure=Cure("move the circles apart, know the start better, or fly with guidance mpc"),
    )


def phase_not_kept(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that vehicles stray from their phases by more than their meetings bear.

    It stops the flight where an RMS error is over the tolerance itself.
    """
    flight = judged.flight
    if flight is None:
        return
    names = judged.scenario.vehicle_names
    tolerances = {
        name: min(
            (one.tolerance for one in judged.links if names[one.a] == name or names[one.b] == name),
            default=math.pi,
        )
        / judged.orbits.rate
        for name in names
    }
    off = [
        one
        for one in flight.vehicles
        if PHASE_SIGMAS * one.phase_rms > tolerances.get(one.name, math.inf)
    ]
    if off:
        each = [
            f"{one.name} {one.phase_rms:.3g} s, {tolerances[one.name]:.3g} s allowed" for one in off
        ]
        gone = any(one.phase_rms > tolerances[one.name] for one in off)
        yield Finding(
            "phase-not-kept",
            "stop" if gone else "warning",
            f"phases stray by more than {'' if gone else 'half of '}their tolerance (RMS of "
            f"{_flown(flight)}): "
            f"{listed(each, MOST_NAMED)}",
            tuple(one.name for one in off),
            Cure("meetings that are further within range, or a smaller error of the estimates"),
        )


def _level(share: float) -> Level:
    return "stop" if share > MOST_SHARE else "warning"


def _share(share: float) -> str:
    return f"{100.0 * share:.2g} %"


def _flown(flight: FlightRecord) -> str:
    events = f" with {len(flight.events)} events" if flight.events else ""
    return f"{flight.trials} flights of {flight.duration:g} s{events}"
