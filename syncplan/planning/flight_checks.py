"""Findings on flights: losses, distances, phases, meetings and limits."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import NoSolutionError
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.observability.rank import assess_remainder, assess_team
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.sightings import Loss, remainder_of
from syncplan.phrases import joined, listed, metres, percent
from syncplan.planning.judged_team import JudgedTeam, Level, Remark, separation_limit
from syncplan.planning.plan_records import OPEN_LOOP, FlownPlan
from syncplan.planning.share_test import (
    FEWEST_FLIGHTS,
    Standing,
    share_interval,
    standing,
)
from syncplan.runtime.machine import single_threaded_blas

# --- links that the team needs --------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class WithoutLinks:
    """Effect on a team of losing all sightings of some of its links.

    Attributes
    ----------
    needed : whether the team is not observable without them
    cost : predicted errors in words, of the worst vehicle and of the one that loses most, with the
        links and without; empty if nothing is predicted
    """

    needed: bool
    cost: str


@single_threaded_blas
def without_links(judged: JudgedTeam, links: Collection[tuple[int, int]]) -> WithoutLinks:
    """Return the effect of losing some links, each a < b, all of them at once.

    Circles and limits stay the same: only a loss of observability can newly stop a plan.
    """
    left = remainder_of(judged.team, Loss(links=tuple(links)))
    assessed = assess_team(judged.team, judged.scenario.window)
    observable = assess_remainder(assessed, left).observability.observable
    before = judged.prediction.rms
    if not observable or before is None:
        return WithoutLinks(needed=not observable, cost="")
    from syncplan.estimation.bounds import LossBounds

    bounds = LossBounds.along(judged.team, judged.windows, judged.scenario.duration_s)
    try:
        after = bounds.after(left).rms_second_half()
    except NoSolutionError:
        return WithoutLinks(needed=False, cost="")
    worst = int(np.argmax(after - before))
    name = judged.scenario.vehicle_names[worst]
    cost = f"{before.max():.3g} -> {after.max():.3g} m of the worst vehicle"
    if worst != int(np.argmax(after)):
        cost += f", {before[worst]:.3g} -> {after[worst]:.3g} m of {name}"
    return WithoutLinks(needed=False, cost=cost)


# --- findings of a flight -------------------------------------------------------------------------
#
# A plan on paper has none of these. A share of flights that failed is judged by `share_test`.


MOST_MISSED = 0.05
"""Share of a pair's meetings that may be missed without a finding."""

LEAST_KEPT = 0.5
"""Share of a pair's meetings below which they are over two periods apart, the limit for a vehicle
out of contact."""

MOST_SATURATED = 0.2
"""Share of the time at a limit above which vehicles do not follow their guidance."""

MOST_STRAYING, MOST_EVENTS = 3, 8

PHASE_SIGMAS = 2.0
"""Multiple of a phase's RMS error that must be within the allowed error."""

RANDOM_PHASE = 1.0 / math.sqrt(12.0)
"""RMS error, in periods, of a completely random phase."""

LOOKS_FOR_ITS_START, KEEPS_APART = "robust", "mpc"
"""Filter and guidance that cures name."""


def not_flown(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that the plan was not flown although flights were wanted."""
    if judged.flight is None and judged.unflown:
        yield Remark("note", f"not flown: {judged.unflown}")


def flights_dropped(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that the flights of the plan's file do not count."""
    if judged.dropped_flights:
        yield Remark("note", f"flights of this plan do not count: {judged.dropped_flights}")


def few_flights(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that flights are too few to show that the plan flies well."""
    flight = judged.flight
    if flight is not None and flight.trials < FEWEST_FLIGHTS:
        shares = flight.filter_lost_share, flight.out_of_contact_share, flight.too_close_share
        if not any(shares):
            yield Remark(
                "warning",
                f"none of {flights_in_words(flight)} failed, which are too few to call the plan "
                f"good: {FEWEST_FLIGHTS} without a failure are needed",
                cure=f"at least {FEWEST_FLIGHTS} flights",
            )


def lost_in_flight(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the findings that filters were lost, or vehicles out of contact, in some flights."""
    flight = judged.flight
    if flight is None:
        return
    if flight.filter_lost_share > 0.0:
        states = layout_of(judged.team).names
        yield Remark(
            _level(flight.filter_lost_share, flight),
            f"the filter was lost in {_share(flight.filter_lost_share, flight)}: some "
            "vehicle's error was over 5 times the bound along its path",
            cure=cure_of(
                ("filter.kind robust", flight.filter != LOOKS_FOR_ITS_START),
                ("more landmarks in view", True),
                ("errors as states", len(states) < len(ERROR_STATES)),
            ),
        )
    if flight.out_of_contact_share > 0.0:
        yield Remark(
            _level(flight.out_of_contact_share, flight),
            "a vehicle was out of contact for over two periods in "
            f"{_share(flight.out_of_contact_share, flight)}",
            cure="meetings that are further within range, or further links",
        )


def too_close_in_flight(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that vehicles came nearer than allowed in some flights."""
    flight = judged.flight
    if flight is None or flight.least_separation_m is None or not flight.too_close_share:
        return
    median, worst = flight.least_separation_m
    limit = separation_limit(judged.scenario)
    yield Remark(
        _level(flight.too_close_share, flight),
        f"vehicles came nearer than {limit.worded(judged.orbits.radii)} in "
        f"{_share(flight.too_close_share, flight)}: {metres(worst, 3)} m in the worst, "
        f"{metres(median, 3)} m in the median one",
        cure=cure_of(
            ("move the circles apart", True),
            ("know the start better", True),
            (f"fly with guidance {KEEPS_APART}", flight.guidance != KEEPS_APART),
        ),
    )


def phase_not_kept(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that vehicles stray from their phases by more than allowed.

    The allowed error is the tolerance of a vehicle's meetings, and at most half the RMS error of a
    random phase. The finding stops the flight if an RMS error is over that half, or over the
    tolerance of meetings that the team needs.
    """
    flight = judged.flight
    if flight is None:
        return
    allowed = _allowed_phases(judged)
    off = [
        one
        for one in flight.vehicles
        if PHASE_SIGMAS * one.phase_rms_s > allowed.get(one.name, math.inf)
    ]
    if off:
        off.sort(key=lambda one: allowed[one.name] / one.phase_rms_s)
        each = [
            f"{one.name} {one.phase_rms_s:.3g} s, {allowed[one.name]:.3g} s allowed" for one in off
        ]
        gone = any(one.phase_rms_s > allowed[one.name] for one in off)
        random = any(one.phase_rms_s > _largest_phase(judged) for one in off)
        slipped = _slipped(judged, {one.name: one.phase_rms_s for one in off})
        needed, without = _without(judged, slipped)
        yield Remark(
            "stop" if random or needed else "warning",
            f"phases stray (RMS) by more than {'' if gone else 'half of '}what is allowed in "
            f"{flights_in_words(flight)}: {listed(each, MOST_STRAYING)}{without}",
            tuple(one.name for one in off),
            cure=_steering_cure(flight),
        )


def meetings_missed(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that pairs miss meetings that the plan's figures rest on.

    The finding stops the flight if some pairs keep less than LEAST_KEPT of the meetings that they
    would have on the circles, and the team is not observable without all of these pairs.
    """
    flight = judged.flight
    if flight is None:
        return
    names = [*judged.scenario.vehicle_names, *judged.scenario.landmark_names]
    expected = {
        (names[one.a], names[one.b]): _expected_share(judged, one)
        for one in (*judged.links, *judged.landmark_links)
    }
    missed = sorted(
        (one.kept_share / expected[one.between], one.between, one.kept_share)
        for one in flight.meetings_kept
        if one.kept_share < (1.0 - MOST_MISSED) * expected.get(one.between, 0.0)
    )
    if missed:
        numbers = {name: k for k, name in enumerate(names)}
        gone = [pair for share, pair, _ in missed if share < LEAST_KEPT]
        lacking = gone or [pair for _, pair, _ in missed]
        needed, without = _without(judged, [(numbers[a], numbers[b]) for a, b in lacking])
        each = [f"{'-'.join(between)} keeps {percent(kept)}" for _, between, kept in missed]
        yield Remark(
            "stop" if gone and needed else "warning",
            f"meetings that the plan's figures rest on are missed in {flights_in_words(flight)}: "
            f"{listed(each, MOST_STRAYING)}{without}",
            tuple(dict.fromkeys(name for _, between, _ in missed for name in between)),
            cure=_steering_cure(flight),
        )


def commands_saturated(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that vehicles were at a limit for much of the time."""
    flight = judged.flight
    if flight is None or flight.saturated_share is None or flight.saturated_share <= MOST_SATURATED:
        return
    yield Remark(
        "warning",
        f"commands were at a limit of speed or turn rate for {percent(flight.saturated_share)} of "
        f"the time in {flights_in_words(flight)}: vehicles could not do what their guidance asked",
        cure="larger limits, slower or larger circles, or less wind",
    )


def _without(judged: JudgedTeam, links: Sequence[tuple[int, int]]) -> tuple[bool, str]:
    """Whether a team needs these links, indices a < b, and a phrase on it without them."""
    if not links:
        return False, ""
    names = [*judged.scenario.vehicle_names, *judged.scenario.landmark_names]
    which = f"without {joined([f'{names[a]}-{names[b]}' for a, b in links], MOST_STRAYING)}"
    found = without_links(judged, links)
    if found.needed:
        return True, f"; {which} the team is not observable"
    cost = f", predicted RMS {found.cost}" if found.cost else ""
    return False, f"; {which} the team is observable still{cost}"


def _slipped(judged: JudgedTeam, phases: Mapping[str, float]) -> list[tuple[int, int]]:
    """Links whose tolerance is exceeded by phase errors, in s by vehicle."""
    names, rate = judged.scenario.vehicle_names, judged.orbits.rate
    return [
        (one.a, one.b)
        for one in judged.links
        if max(phases.get(names[k], 0.0) for k in (one.a, one.b)) > one.tolerance / rate
    ]


def _largest_phase(judged: JudgedTeam) -> float:
    """Largest RMS error in s allowed for any phase, whatever its meetings tolerate."""
    return 0.5 * RANDOM_PHASE * judged.orbits.period


def _allowed_phases(judged: JudgedTeam) -> dict[str, float]:
    """Largest RMS phase error in s allowed for each vehicle."""
    names = judged.scenario.vehicle_names
    least = dict.fromkeys(names, _largest_phase(judged))
    for link in judged.links:
        for k in (link.a, link.b):
            least[names[k]] = min(least[names[k]], link.tolerance / judged.orbits.rate)
    return least


def _expected_share(judged: JudgedTeam, link: LinkVerdict) -> float:
    """Share of a pair's meetings with a sighting, by either, if circles are flown exactly.

    Some meetings have none if a sensor is slow or detects little of what is in view.
    """

    def seen_by(k: int, windows: Array) -> float:
        sensors = judged.sensors
        chance = float(sensors.detection[k])
        interval = float(sensors.every[k]) * sensors.sample_time
        times = float(np.sum(windows[:, 1] - windows[:, 0])) / interval
        return chance * times if times < 1.0 else 1.0 - (1.0 - chance) ** times

    shares = [seen_by(link.a, link.forward)]
    if link.b < judged.orbits.count:
        shares.append(seen_by(link.b, link.backward))
    return max(shares)


def _steering_cure(flight: FlownPlan) -> str:
    return cure_of(
        ("steer by the estimates (guidance track or mpc)", flight.guidance == OPEN_LOOP),
        ("meetings that are further within range", True),
        ("a smaller error of the estimates", True),
    )


def cure_of(*ways: tuple[str, bool]) -> str:
    """Return the cure of a finding from remedies, each with whether it is still untried."""
    *first, last = [text for text, untried in ways if untried]
    return f"{', '.join(first)} or {last}" if first else last


def _level(share: float, flight: FlownPlan) -> Level:
    """Level of the finding that this share of flights failed."""
    levels: dict[Standing, Level] = {"bad": "stop", "undecided": "warning", "good": "note"}
    return levels[standing(round(share * flight.trials), flight.trials)]


def _share(share: float, flight: FlownPlan) -> str:
    """Phrase for a share of flights and its 95 % interval."""
    interval = share_interval(round(share * flight.trials), flight.trials)
    return f"{percent(share, interval)} of {flights_in_words(flight)}"


def flights_in_words(flight: FlownPlan) -> str:
    """Return the number and length of flights in words, with their events."""
    flights = "1 flight" if flight.trials == 1 else f"{flight.trials} flights"
    events = f" ({listed(flight.events, MOST_EVENTS)})" if flight.events else ""
    return f"{flights} of {flight.duration_s:g} s{events}"
