"""Findings on vehicles that steer by their estimates, before a flight and after it."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import exp, hypot, sqrt

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import NoSolutionError
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.observability.rank import assess_remainder, assess_team
from syncplan.orbits.contacts import pairs_nearer_than
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.sightings import Loss, remainder_of
from syncplan.phrases import joined, listed, percent
from syncplan.planning.judged_team import MOST_NAMED, JudgedTeam, Level, Remark
from syncplan.planning.plan_records import FlownPlan
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


# --- errors that leave no room --------------------------------------------------------------------
#
# Vehicles steer by their estimates, so they are off their places by at least the errors of these. A
# plan assumes no such error: the room between its meetings and the limits of sensors, or between
# two vehicles and the separation asked for, has to absorb it. Flights show whether it does; a plan
# that was flown has their findings instead.


SIGMAS = 2.0
"""Standard deviations of an error for which room must suffice, as for phases in flight."""

_FLY = "fly the plan (fly, plan --fly), which shows how often it goes wrong"


def start_uncertain(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that initial errors may bring vehicles nearer than allowed.

    Each starts off its place by the initial sigma. Until its first sighting, its heading error,
    with sigma h, turns its path about the start: by 2 R^2 (1 - exp(-h^2 / 2)) m^2 per coordinate
    over a period.
    """
    nearest = judged.approach
    if nearest is None or judged.flight is not None:
        return
    noise, pair, radii = judged.noise, (nearest.a, nearest.b), judged.orbits.radii
    turned = 2.0 * (1.0 - exp(-0.5 * noise.heading_sigma**2))
    apart = hypot(*(hypot(noise.position_sigma, sqrt(turned) * radii[k]) for k in pair))
    room = nearest.distance - judged.scenario.separation
    if apart > max(room, 0.0):
        names = tuple(judged.scenario.vehicle_names[k] for k in pair)
        yield Remark(
            "warning",
            f"from initial_sigma {noise.position_sigma:g} m and {noise.heading_sigma:g} rad places "
            f"relative to each other are off by {apart:.3g} m (sigma) before anything is seen; "
            f"{names[0]} and {names[1]} have {_room(judged, room)}",
            names,
            cure=f"a better known start, or more separation; {_FLY}",
        )


def separation_uncertain(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that predicted errors may bring vehicles nearer than allowed."""
    errors = _coordinate_errors(judged)
    if errors is None or judged.approach is None:
        return
    asked = judged.scenario.separation
    near = pairs_nearer_than(judged.orbits, asked + SIGMAS * sqrt(2.0) * float(errors.max()))
    names, found = judged.scenario.vehicle_names, []
    for one in near:
        apart, room = hypot(errors[one.a], errors[one.b]), one.distance - asked
        if room > 0.0 and SIGMAS * apart > room:
            found.append(((names[one.a], names[one.b]), apart, room))
    if found:
        each = [
            f"{a} and {b} off by {apart:.3g} m with {_room(judged, room)}"
            for (a, b), apart, room in found
        ]
        yield Remark(
            "warning",
            "predicted errors (sigma) leave vehicles little room to each other: "
            f"{listed(each, MOST_NAMED)}",
            tuple(dict.fromkeys(name for pair, *_ in found for name in pair)),
            cure=f"circles further apart, or smaller errors; {_FLY}",
        )


def meetings_uncertain(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that predicted errors may end meetings that the team needs."""
    errors = _coordinate_errors(judged)
    if errors is None:
        return
    links = (*judged.links, *judged.incidental_links, *judged.landmark_links)
    unsure = sorted(
        (share, one.a, one.b)
        for one in links
        if (share := _room_in_sigmas(judged, one, errors)) < SIGMAS
    )
    if unsure and without_links(judged, [(a, b) for _, a, b in unsure]).needed:
        names = [*judged.scenario.vehicle_names, *judged.scenario.landmark_names]
        each = [f"{names[a]}-{names[b]} by {share:.3g} sigma" for share, a, b in unsure]
        yield Remark(
            "warning",
            "the team is lost without meetings that predicted errors may end, of place or of "
            f"phase: {listed(each, MOST_NAMED)}",
            tuple(dict.fromkeys(names[k] for _, *pair in unsure for k in pair)),
            cure=f"meetings that are further within range, further links or smaller errors; {_FLY}",
        )


def _room_in_sigmas(judged: JudgedTeam, link: LinkVerdict, errors: Array) -> float:
    """Standard deviations of place or phase that a meeting tolerates, whichever are fewer."""
    vehicles = [k for k in (link.a, link.b) if k < judged.orbits.count]
    off = hypot(*(float(errors[k]) for k in vehicles))
    seen_from = [k for k, seen in ((link.a, link.forward), (link.b, link.backward)) if len(seen)]
    reach = max(float(judged.sensors.ranges[k]) for k in seen_from)
    late = max(float(errors[k] / judged.orbits.radii[k]) for k in vehicles)
    with np.errstate(divide="ignore"):
        room = np.divide([reach - link.min_distance, link.tolerance], [off, late])
    return float(room.min())


def _coordinate_errors(judged: JudgedTeam) -> Array | None:
    """Predicted sigma (n,) m of a coordinate.

    None if there is no prediction, the team is not observable or the plan was flown.
    """
    rms = judged.prediction.rms
    if rms is None or judged.flight is not None or not judged.observability.observable:
        return None
    return np.asarray(rms / sqrt(2.0))


def _room(judged: JudgedTeam, room: float) -> str:
    asked = judged.scenario.separation
    return f"{room:.3g} m" + (f" to min_separation_m {asked:g}" if asked else " between them")


# --- findings of a flight -------------------------------------------------------------------------
#
# A plan that was not flown has none of these. Trials are few, so a failure in some of them is a
# warning, and a failure in more than MOST_SHARE of them stops the flight.


MOST_SHARE = 0.05
"""Share of trials, or of a pair's meetings, above which a failure is no accident."""

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

LOOKS_FOR_ITS_START, KEEPS_APART, OPEN_LOOP = "robust", "mpc", "none"
"""Filter and guidances that cures name."""


def lost_in_flight(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the findings that filters were lost, or vehicles out of contact, in some trials."""
    flight = judged.flight
    if flight is None:
        return
    if flight.filter_lost_share > 0.0:
        states = layout_of(judged.team).names
        yield Remark(
            _level(flight.filter_lost_share),
            f"the filter was lost in {percent(flight.filter_lost_share)} of {_flown(flight)}: some "
            "vehicle's error was over 5 times the bound along its path",
            cure=_cure(
                ("filter.kind robust", flight.filter != LOOKS_FOR_ITS_START),
                ("more landmarks in view", True),
                ("errors as states", len(states) < len(ERROR_STATES)),
            ),
        )
    if flight.out_of_contact_share > 0.0:
        yield Remark(
            _level(flight.out_of_contact_share),
            f"a vehicle was out of contact for over two periods in "
            f"{percent(flight.out_of_contact_share)} of {_flown(flight)}",
            cure="meetings that are further within range, or further links",
        )


def too_close_in_flight(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that vehicles came nearer than allowed in some trials."""
    flight = judged.flight
    if flight is None or flight.least_separation_m is None or not flight.too_close_share:
        return
    yield Remark(
        _level(flight.too_close_share),
        f"vehicles came nearer than min_separation_m {judged.scenario.separation:g} in "
        f"{percent(flight.too_close_share)} of {_flown(flight)}: "
        f"{flight.least_separation_m[1]:.3g} m "
        f"in the worst, {flight.least_separation_m[0]:.3g} m in the median one",
        cure=_cure(
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
            f"{_flown(flight)}: {listed(each, MOST_STRAYING)}{without}",
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
        if one.kept_share < (1.0 - MOST_SHARE) * expected.get(one.between, 0.0)
    )
    if missed:
        numbers = {name: k for k, name in enumerate(names)}
        gone = [pair for share, pair, _ in missed if share < LEAST_KEPT]
        lacking = gone or [pair for _, pair, _ in missed]
        needed, without = _without(judged, [(numbers[a], numbers[b]) for a, b in lacking])
        each = [f"{'-'.join(between)} keeps {percent(kept)}" for _, between, kept in missed]
        yield Remark(
            "stop" if gone and needed else "warning",
            f"meetings that the plan's figures rest on are missed in {_flown(flight)}: "
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
        f"the time in {_flown(flight)}: vehicles could not do what their guidance asked",
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
    return _cure(
        ("steer by the estimates (guidance track or mpc)", flight.guidance == OPEN_LOOP),
        ("meetings that are further within range", True),
        ("a smaller error of the estimates", True),
    )


def _cure(*ways: tuple[str, bool]) -> str:
    """Cure of a finding from remedies, each with whether it is still untried."""
    *first, last = [text for text, untried in ways if untried]
    return f"{', '.join(first)} or {last}" if first else last


def _level(share: float) -> Level:
    return "stop" if share > MOST_SHARE else "warning"


def _flown(flight: FlownPlan) -> str:
    """Phrase for the number and length of flights, with their events."""
    flights = "1 flight" if flight.trials == 1 else f"{flight.trials} flights"
    events = f" ({listed(flight.events, MOST_EVENTS)})" if flight.events else ""
    return f"{flights} of {flight.duration_s:g} s{events}"
