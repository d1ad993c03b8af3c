"""Link verdicts: when and how near a pair meets, how far a phase may slip, and the pair's rank.

A link's reason is read from its own null vectors, not from the three conditions of Lemma 3.1, which
do not decide the rank: with one sense, a one-way sighting and R_seen = R_seeing cos(phase
difference) all three hold, and a turn is unobservable; with parallel headings and unequal radii the
third fails, and the rank is 3.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.observability.rank import Assessment, LinkInformation, counts
from syncplan.observability.unobservable_modes import lost_bearings
from syncplan.orbits.circles import relative_motion, wrap
from syncplan.orbits.contacts import least_distances, merge_windows
from syncplan.synchronisation.contact_tables import contact_tolerances, rule_residuals

_TOO_WEAK = "of full rank by itself, but too weak beside the team's other sightings"


@dataclass(frozen=True, slots=True)
class LinkVerdict:
    """Contact of a pair over one period, and the rank of its sightings.

    Attributes
    ----------
    a, b : indices, a < b; b is a landmark if it is at least the number of vehicles
    min_distance : m, least distance over the period
    windows : (k, 2) s in contact, the union of both directions
    forward, backward : (k, 2) s in which a sees b, and b sees a
    rank : rank of the pair's own rows; 0 without sightings
    certified : whether it counts for the certificate: rank 3, or 2 to a landmark
    reason : why the rank falls short; empty if it does not
    residual : rad, residual of the pair's synchronisation rule; 0 for landmarks
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


def vehicle_verdicts(assessed: Assessment, pairs: Index) -> list[LinkVerdict]:
    """Return the verdicts on the (e, 2) vehicle pairs, each a < b, in the order given."""
    if not len(pairs):
        return []
    team, windows, largest = assessed.team, assessed.windows, assessed.largest
    orbits = team.orbits
    nothing = np.zeros((0, 2))
    sighted = {(link.a, link.b): link for link in assessed.information}
    way = {
        key: k
        for k, key in enumerate(
            zip(windows.observers.tolist(), windows.targets.tolist(), strict=True)
        )
    }
    least, _ = least_distances(relative_motion(orbits, pairs[:, 0], pairs[:, 1]))
    links = [sighted[a, b] for a, b in pairs.tolist() if (a, b) in sighted]
    bearings = lost_bearings(orbits, links)
    stretched = {
        (link.a, link.b) for link, one in zip(links, bearings, strict=True) if one is not None
    }
    residual = rule_residuals(orbits, pairs)
    tolerance = contact_tolerances(team, pairs)
    found = []
    for k, (a, b) in enumerate(pairs.tolist()):
        forward = windows.of(way[a, b]) if (a, b) in way else nothing
        backward = windows.of(way[b, a]) if (b, a) in way else nothing
        link = sighted.get((a, b))
        met = merge_windows(np.concatenate([forward, backward]), orbits.period)
        found.append(
            LinkVerdict(
                a=a,
                b=b,
                min_distance=float(least[k]),
                windows=met,
                forward=forward,
                backward=backward,
                rank=min(link.rank, 3) if link else 0,
                certified=link is not None and counts(link, 3, largest),
                reason=_why_short_of_three(assessed, (a, b), link, met, (a, b) in stretched),
                residual=float(residual[k]),
                tolerance=float(tolerance[k]),
            )
        )
    return found


def landmark_verdicts(assessed: Assessment) -> list[LinkVerdict]:
    """Return the verdicts on vehicles and the landmarks they see, ordered by (a, b)."""
    team, windows, largest = assessed.team, assessed.windows, assessed.largest
    sighted = {(link.a, link.b): link for link in assessed.information}
    to_landmark = windows.targets >= team.count
    seen = np.flatnonzero(to_landmark & (np.diff(windows.first) > 0))
    a, b = windows.observers[seen], windows.targets[seen]
    least, _ = least_distances(relative_motion(team.orbits, a, b, team.landmarks))
    found = []
    for row, pair in enumerate(seen):
        link = sighted.get((int(a[row]), int(b[row])))
        met = windows.of(int(pair))
        found.append(
            LinkVerdict(
                a=int(a[row]),
                b=int(b[row]),
                min_distance=float(least[row]),
                windows=met,
                forward=met,
                backward=np.zeros((0, 2)),
                rank=min(link.rank, 2) if link else 0,
                certified=link is not None and counts(link, 2, largest),
                reason=_why_short_of_two(assessed, int(a[row]), link, met),
                residual=0.0,
                tolerance=np.pi,
            )
        )
    return sorted(found, key=lambda verdict: (verdict.a, verdict.b))


def _why_unsighted(assessed: Assessment, observers: list[int], contact: Array) -> str:
    """Reason why a pair in contact is never sighted in the window, by its `contact` (w, 2) s."""
    window, period = assessed.window, assessed.team.orbits.period
    if not np.any((contact[:, 0] < window) | (contact[:, 1] - period > 0.0)):
        return f"no contact within the window of {window:.4g} s"
    rare = np.any(assessed.team.sensors.every[observers] > 1)
    return f"in contact only between {'sightings (interval_s)' if rare else 'samples'}"


def _why_short_of_three(
    assessed: Assessment,
    pair: tuple[int, int],
    link: LinkInformation | None,
    contact: Array,
    stretched: bool,
) -> str:
    team = assessed.team
    if link is None:
        return _why_unsighted(assessed, list(pair), contact) if len(contact) else "never in contact"
    if link.rank >= 3:
        return "" if counts(link, 3, assessed.largest) else _TOO_WEAK
    if link.sightings < 3:
        return f"fewer than three sightings ({link.sightings})"
    if link.singular_values[0] == 0.0:
        return "always at the same place: there is no bearing"
    orbits = team.orbits
    if stretched:
        a, b = link.a, link.b
        together = (
            orbits.senses[a] == orbits.senses[b]
            and np.isclose(orbits.radii[a], orbits.radii[b], rtol=1e-6)
            and abs(wrap(orbits.phases[a] - orbits.phases[b])) < 1e-6
        )
        if together:
            return "parallel motion at equal speed: the distance is lost"
        return "the line of sight never turns: the distance along it is lost"
    measured = np.isfinite(team.sensors.range_sigmas[[link.a, link.b]])
    if link.one_way and not measured.any():
        return (
            "one-way sighting with a degenerate ratio of radii, "
            "R_seen = R_seeing cos(phase difference): a turn is lost"
        )
    ratio = link.singular_values[min(2, len(link.singular_values) - 1)] / link.singular_values[0]
    return f"nearly degenerate: third singular value is {ratio:.1e} of the first"


def _why_short_of_two(
    assessed: Assessment, vehicle: int, link: LinkInformation | None, contact: Array
) -> str:
    if link is None:
        return _why_unsighted(assessed, [vehicle], contact)
    if link.rank >= 2:
        return "" if counts(link, 2, assessed.largest) else _TOO_WEAK
    if link.sightings < 2:
        return "fewer than two sightings (1)"
    return "the bearing never changes: only one direction is held"
