"""Meetings: for each pair, when and how near it meets, how far it may slip, and its own rank."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from syncplan.certificate import counts
from syncplan.contacts import Sensors, Windows, find_windows, merge_windows, relative_motion
from syncplan.motions import lost_bearing
from syncplan.observability import LinkInformation
from syncplan.orbits import Orbits, phase, wrap
from syncplan.rules import closest_distance, rules_of
from syncplan.separation import least_distances

__all__ = ["Meeting", "landmark_meetings", "phase_tolerances", "vehicle_meetings"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_SLIPS = 64
_BISECTIONS = 36
_TOO_WEAK = "of full rank by itself, but too weak beside the team's other sightings"


@dataclass(frozen=True, slots=True)
class Meeting:
    """How a pair meets over one period.

    Attributes
    ----------
    a, b : indices, a < b; b is a landmark from the number of vehicles on
    min_distance : m, least distance over the period
    windows : (k, 2) s in contact, the union of both ways
    forward, backward : (k, 2) s in which a sees b, and b sees a
    rank : of the pair's own rows; 0 without sightings
    certified : whether it counts for the certificate: rank 3, or 2 to a landmark
    reason : why the rank falls short, empty where it does not
    residual : rad, of the pair's rule; 0 for landmarks
    tolerance : rad, how far either phase may slip before contact is lost; pi if it never is
    """

    a: int
    b: int
    min_distance: float
    windows: Array
    forward: Array
    backward: Array
    rank: int
    certified: bool
    reason: str
    residual: float
    tolerance: float

    @property
    def contact(self) -> float:
        """Time in contact per period in s."""
        return float(np.sum(self.windows[:, 1] - self.windows[:, 0]))


def vehicle_meetings(
    orbits: Orbits,
    sensors: Sensors,
    windows: Windows,
    information: list[LinkInformation],
    largest: float,
    pairs: Index,
) -> list[Meeting]:
    """Return the meetings of the (e, 2) vehicle pairs, each a < b, in the order given.

    `largest` is the largest singular value of the whole team's matrix.
    """
    nothing = np.zeros((0, 2))
    told = {(link.a, link.b): link for link in information}
    way = {
        key: k
        for k, key in enumerate(
            zip(windows.observers.tolist(), windows.targets.tolist(), strict=True)
        )
    }
    least, _ = least_distances(relative_motion(orbits, nothing, pairs[:, 0], pairs[:, 1]))
    residual = rule_residuals(orbits, pairs)
    tolerance = phase_tolerances(orbits, sensors, pairs)
    found = []
    for k, (a, b) in enumerate(pairs.tolist()):
        forward = windows.of(way[a, b]) if (a, b) in way else nothing
        backward = windows.of(way[b, a]) if (b, a) in way else nothing
        link = told.get((a, b))
        met = merge_windows(np.concatenate([forward, backward]), orbits.period)
        found.append(
            Meeting(
                a=a,
                b=b,
                min_distance=float(least[k]),
                windows=met,
                forward=forward,
                backward=backward,
                rank=min(link.rank, 3) if link else 0,
                certified=link is not None and counts(link, 3, largest),
                reason=_why_short_of_three(orbits, link, len(met), largest),
                residual=float(residual[k]),
                tolerance=float(tolerance[k]),
            )
        )
    return found


def landmark_meetings(
    orbits: Orbits,
    landmarks: Array,
    windows: Windows,
    information: list[LinkInformation],
    largest: float,
) -> list[Meeting]:
    """Return the meetings of vehicles with the landmarks they see, ordered by (a, b)."""
    told = {(link.a, link.b): link for link in information}
    to_landmark = windows.targets >= orbits.count
    seen = np.flatnonzero(to_landmark & (np.diff(windows.first) > 0))
    a, b = windows.observers[seen], windows.targets[seen]
    least, _ = least_distances(relative_motion(orbits, landmarks, a, b))
    found = []
    for row, pair in enumerate(seen):
        link = told.get((int(a[row]), int(b[row])))
        met = windows.of(int(pair))
        found.append(
            Meeting(
                a=int(a[row]),
                b=int(b[row]),
                min_distance=float(least[row]),
                windows=met,
                forward=met,
                backward=np.zeros((0, 2)),
                rank=min(link.rank, 2) if link else 0,
                certified=link is not None and counts(link, 2, largest),
                reason=_why_short_of_two(link, largest),
                residual=0.0,
                tolerance=np.pi,
            )
        )
    return sorted(found, key=lambda meeting: (meeting.a, meeting.b))


def rule_residuals(orbits: Orbits, pairs: Index) -> Array:
    """Return (e,) rad in [-pi, pi): phi_b - phi_a - pi, or phi_a + phi_b - 2 beta - pi."""
    a, b = pairs[:, 0], pairs[:, 1]
    between = orbits.centers[b] - orbits.centers[a]
    bearing = np.arctan2(between[:, 1], between[:, 0])
    phases = phase(orbits, 0.0)
    same = orbits.senses[a] == orbits.senses[b]
    asked = np.where(same, phases[b] - phases[a], phases[a] + phases[b] - 2.0 * bearing)
    return wrap(asked - np.pi)


def phase_tolerances(orbits: Orbits, sensors: Sensors, pairs: Index) -> Array:
    """Return (e,) rad: the smallest slip of either phase, either way, that loses all contact.

    Slipping one phase or the other is the same up to a shift of time. Pi where no slip does. The
    first loss is looked for in steps of pi / 64 and then bisected.
    """
    tolerance = np.full(len(pairs), np.pi)
    if len(pairs) == 0:
        return tolerance
    slips = np.linspace(0.0, np.pi, _SLIPS + 1)
    sides = np.array([1.0, -1.0])
    both = np.broadcast_to((sides[:, None] * slips).ravel(), (len(pairs), 2 * len(slips)))
    kept = _contact_when_slipped(orbits, sensors, pairs)(both).reshape(len(pairs), 2, -1)
    pair, side = np.nonzero(~kept.all(axis=2))
    first = np.argmin(kept[pair, side], axis=1)
    low, high = slips[np.maximum(first - 1, 0)], slips[first]
    in_contact = _contact_when_slipped(orbits, sensors, pairs[pair])
    for _ in range(_BISECTIONS if len(pair) else 0):
        middle = 0.5 * (low + high)
        held = in_contact((sides[side] * middle)[:, None])[:, 0]
        low, high = np.where(held, middle, low), np.where(held, high, middle)
    np.minimum.at(tolerance, pair, low)
    return tolerance


def _contact_when_slipped(
    orbits: Orbits, sensors: Sensors, pairs: Index
) -> Callable[[Array], NDArray[np.bool_]]:
    """Whether pairs still meet when the second vehicle's phase slips, (e, k) of slip (e, k)."""
    if not np.all(sensors.fields_of_view >= 2.0 * np.pi):
        return lambda slip: _seen_when_slipped(orbits, sensors, pairs, slip)
    rules = rules_of(orbits.centers, orbits.radii, orbits.senses, sensors.ranges, pairs)
    residual = rule_residuals(orbits, pairs)[:, None]
    return lambda slip: np.asarray(closest_distance(rules, residual + slip) <= rules.reach[:, None])


def _seen_when_slipped(
    orbits: Orbits, sensors: Sensors, pairs: Index, slip: Array
) -> NDArray[np.bool_]:
    """(e, k) whether a pair has a contact window either way."""
    number = slip.shape[1]
    first, second = np.repeat(pairs[:, 0], number), np.repeat(pairs[:, 1], number)
    index = np.concatenate([first, second])
    late = np.concatenate([np.zeros(len(first)), slip.ravel()])
    slipped = Orbits(
        orbits.centers[index],
        orbits.radii[index],
        orbits.senses[index],
        orbits.phases[index] + late,
        orbits.rate,
    )
    copies = Sensors(
        sensors.ranges[index],
        sensors.fields_of_view[index],
        sensors.boresights[index],
        sensors.bearing_sigmas[index],
        sensors.sample_time,
    )
    one, other = np.arange(len(first)), len(first) + np.arange(len(first))
    ways = (np.concatenate([one, other]), np.concatenate([other, one]))
    found = find_windows(slipped, np.zeros((0, 2)), copies, ways)
    met = np.diff(found.first) > 0
    return (met[: len(first)] | met[len(first) :]).reshape(slip.shape)


def _why_short_of_three(
    orbits: Orbits, link: LinkInformation | None, windows: int, largest: float
) -> str:
    if link is None:
        return "in contact only between samples" if windows else "never in contact"
    if link.rank >= 3:
        return "" if counts(link, 3, largest) else _TOO_WEAK
    if link.sightings < 3:
        return f"fewer than three sightings ({link.sightings})"
    if link.singular_values[0] == 0.0:
        return "always at the same place: there is no bearing"
    if lost_bearing(orbits, link) is not None:
        a, b = link.a, link.b
        together = (
            orbits.senses[a] == orbits.senses[b]
            and np.isclose(orbits.radii[a], orbits.radii[b], rtol=1e-6)
            and abs(wrap(orbits.phases[a] - orbits.phases[b])) < 1e-6
        )
        if together:
            return "parallel motion at equal speed: the distance is lost"
        return "the line of sight never turns: the distance along it is lost"
    if link.one_way:
        return (
            "one-way sighting with a degenerate ratio of radii, "
            "R_seen = R_seeing cos(phase difference): a turn is lost"
        )
    ratio = link.singular_values[min(2, len(link.singular_values) - 1)] / link.singular_values[0]
    return f"nearly degenerate: third singular value is {ratio:.1e} of the first"


def _why_short_of_two(link: LinkInformation | None, largest: float) -> str:
    if link is None:
        return "in contact only between samples"
    if link.rank >= 2:
        return "" if counts(link, 2, largest) else _TOO_WEAK
    if link.sightings < 2:
        return "fewer than two sightings (1)"
    return "the bearing never changes: only one direction is held"
