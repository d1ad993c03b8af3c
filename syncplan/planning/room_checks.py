"""Whether errors leave room for what a plan rests on: findings on starts, meetings, separations.

Vehicles steer by their estimates, so they are off their places by the errors of these at least. A
plan supposes none of that: what lies between its meetings and the limits of sensors, or between two
vehicles and the separation asked, has to take it. Flights show whether it does; a plan that was
flown has their findings instead.
"""

from collections.abc import Iterator
from math import exp, hypot, sqrt

import numpy as np

from syncplan.arrays import Array
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.orbits.contacts import pairs_nearer_than
from syncplan.phrases import listed
from syncplan.planning.findings import MOST_NAMED, Cure, Finding
from syncplan.planning.judged_team import JudgedTeam
from syncplan.planning.needed_links import without_links

SIGMAS = 2.0
"""Room is enough for so many standard deviations of an error, as phases in flight are judged."""

_FLY = "fly the plan (fly, plan --fly), which shows how often it goes wrong"


def start_uncertain(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that vehicles may start nearer to each other than the plan has them.

    Each starts off its place by the initial sigma, and until it sees something the error of its
    heading, with sigma h, turns its path about the start: by 2 R^2 (1 - exp(-h^2 / 2)) m^2 a
    coordinate over a period.
    """
    nearest = judged.approach
    if nearest is None or judged.flight is not None:
        return
    noise, pair = judged.noise, (nearest.a, nearest.b)
    turned = 2.0 * (1.0 - exp(-0.5 * noise.heading_sigma**2))
    apart = hypot(*(hypot(noise.position_sigma, sqrt(turned) * _radius(judged, k)) for k in pair))
    room = nearest.distance - judged.scenario.separation
    if apart > max(room, 0.0):
        names = tuple(judged.scenario.vehicle_names[k] for k in pair)
        yield Finding(
            "start-uncertain",
            "warning",
            f"from initial_sigma {noise.position_sigma:g} m and {noise.heading_sigma:g} rad places "
            f"relative to each other are off by {apart:.3g} m (sigma) before anything is seen; "
            f"{names[0]} and {names[1]} have {_room(judged, room)}",
            names,
            Cure(f"a better known start, or more separation; {_FLY}"),
        )


def separation_uncertain(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that predicted errors may bring vehicles nearer than they may come."""
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
        yield Finding(
            "separation-uncertain",
            "warning",
            "predicted errors (sigma) leave vehicles little room to each other: "
            f"{listed(each, MOST_NAMED)}",
            tuple(dict.fromkeys(name for pair, *_ in found for name in pair)),
            Cure(f"circles further apart, or smaller errors; {_FLY}"),
        )


def meetings_uncertain(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that predicted errors may end meetings without which a team is lost."""
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
        yield Finding(
            "meetings-uncertain",
            "warning",
            "the team is lost without meetings that predicted errors may end, of place or of "
            f"phase: {listed(each, MOST_NAMED)}",
            tuple(dict.fromkeys(names[k] for _, *pair in unsure for k in pair)),
            Cure(
                f"meetings that are further within range, further links or smaller errors; {_FLY}"
            ),
        )


def _room_in_sigmas(judged: JudgedTeam, link: LinkVerdict, errors: Array) -> float:
    """How many standard deviations of place or phase a meeting bears, whichever is fewer."""
    vehicles = [k for k in (link.a, link.b) if k < judged.orbits.count]
    off = hypot(*(float(errors[k]) for k in vehicles))
    seen_from = [k for k, seen in ((link.a, link.forward), (link.b, link.backward)) if len(seen)]
    reach = max(float(judged.sensors.ranges[k]) for k in seen_from)
    late = max(float(errors[k] / judged.orbits.radii[k]) for k in vehicles)
    with np.errstate(divide="ignore"):
        room = np.divide([reach - link.min_distance, link.tolerance], [off, late])
    return float(room.min())


def _coordinate_errors(judged: JudgedTeam) -> Array | None:
    """(n,) m, predicted sigma of a coordinate; None where it says nothing or the plan was flown."""
    rms = judged.prediction.rms
    if rms is None or judged.flight is not None or not judged.observability.observable:
        return None
    return np.asarray(rms / sqrt(2.0))


def _radius(judged: JudgedTeam, vehicle: int) -> float:
    return float(judged.orbits.radii[vehicle])


def _room(judged: JudgedTeam, room: float) -> str:
    asked = judged.scenario.separation
    return f"{room:.3g} m" + (f" to min_separation_m {asked:g}" if asked else " between them")
