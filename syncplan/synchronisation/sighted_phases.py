"""Sighted phases: with limited fields of view, or among obstacles, phases that see each other.

With a limited view the nearest meeting may be one at which nobody looks, and among obstacles one
behind a wall. So phases maximise the contact time of each link, in either direction and within
range and view, as a share of the most that any phases give it, smallest share first.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.sight_lines import obstructible
from syncplan.orbits.team import Team
from syncplan.phrases import listed
from syncplan.synchronisation.contact_search import ContactPhases, phases_of_most_contact
from syncplan.synchronisation.contact_tables import seen_when_shifted, tabulated_contact
from syncplan.synchronisation.difference_tables import DifferenceTables
from syncplan.synchronisation.phase_rules import Rules, closest_distance, rules_of

_SAMPLES, _SAMPLES_APART = 1024, 4096
"""Differences in a table, without and with distances to keep."""

_TABLE_ERROR = 2e-5
"""Of a radius: what linear interpolation of a least distance may miss."""

TOO_NEAR = 0.1
"""Of the mean radius: without a stated separation, linked vehicles whose circles cross stay this
far apart."""

_STARTS, _STARTS_QUICK = 32, 12
_LOOKS = 8
_MOST_NAMED = 3


@dataclass(frozen=True, slots=True)
class SightedPhases:
    """Time-phases that maximise what is seen, and each link's attainable part of a period (e,)."""

    phases: ContactPhases
    attainable: Array


def phases_in_sight(
    rules: Rules, guards: Rules, team: Team, separation: float, *, quick: bool = False
) -> SightedPhases:
    """Return the phases of largest smallest contact for the links of `rules`.

    `guards` are pairs to be kept `separation` m apart, as linked pairs are; of the team's orbits
    phases do not matter. `quick` tries fewer starts.
    """
    both, links = rules.joined(guards), len(rules)
    contact = tabulated_contact(rules, team)
    clearing = _distances_to_keep(both, links, separation)
    samples = _SAMPLES_APART if np.any(clearing > 0.0) else _SAMPLES
    difference = np.arange(samples) * (2.0 * np.pi / samples)
    residual = difference - both.offset[:, None]
    value = np.full(residual.shape, np.inf)
    value[:links] = contact.at(residual[:links])
    blind = contact.attainable <= 0.0
    value[:links][blind] = np.inf
    clearance = np.full(residual.shape, np.inf)
    rows = np.flatnonzero(clearing > 0.0)
    clearance[rows] = closest_distance(both.only(rows), residual[rows]) - clearing[rows, None]
    never = clearance.max(axis=1) < 0.0
    clearance[never] = np.inf
    tables = DifferenceTables(both.a, both.b, value, clearance)
    starts = _STARTS_QUICK if quick else _STARTS
    found = phases_of_most_contact(tables, both.offset, team.count, starts)
    unserved = np.union1d(found.unserved, np.flatnonzero(blind))
    phases = ContactPhases(found.theta, found.by_rule and len(unserved) == 0, unserved)
    return SightedPhases(phases, contact.attainable)


def attainable_contact(team: Team, pairs: Index) -> dict[tuple[int, int], float]:
    """Return for each pair of (e, 2) the longest contact of any phases, as a part of a period."""
    orbits = team.orbits
    rules = rules_of(orbits.centers, orbits.radii, orbits.senses, team.sensors.ranges, pairs)
    most = tabulated_contact(rules, team).attainable
    return dict(zip(rules.edges, most.tolist(), strict=True))


def hidden_at_all_phases(team: Team, pairs: Index) -> Flags:
    """Return (e,) whether obstacles hide the vehicles of each pair (e, 2), which are within range.

    Senses, phases and fields of view do not matter: over all phase differences, each vehicle is
    looked for at every place on its circle from every place on the other, whatever the senses.
    """
    hidden = obstructible(team, pairs[:, 0], pairs[:, 1])
    if hidden.any():
        views = np.full(team.count, 2.0 * np.pi)
        seeing = replace(team, sensors=replace(team.sensors, fields_of_view=views))
        # most are seen at one of these; the others need their tables
        looks = np.arange(_LOOKS) * (2.0 * np.pi / _LOOKS)
        shifts = np.broadcast_to(looks, (int(hidden.sum()), _LOOKS))
        hidden[hidden] = ~seen_when_shifted(seeing, pairs[hidden], shifts).any(axis=1)
        most = attainable_contact(seeing, pairs[hidden])
        hidden[hidden] = [share <= 0.0 for share in most.values()]
    return hidden


def why_unseen(team: Team, pair: Index, attainable: float) -> str:
    """Return why no phases serve a link (2,) that could see for `attainable` of a period alone."""

    def longest(seeing: Team) -> float:
        (found,) = attainable_contact(seeing, pair[None]).values()
        return found

    if attainable <= 0.0:
        if blocking := obstacles_blocking(team, longest):
            return f"sight is blocked by {blocking} at all phases"
        return "at no phases does either vehicle come into the other's range and field of view"
    within = "fields of view and past the obstacles" if team.obstacles else "fields of view"
    return (
        f"the phases can't serve all links at once within the {within}; by itself this link "
        f"could be in contact for {100.0 * attainable:.3g} % of a period"
    )


def obstacles_blocking(team: Team, contact: Callable[[Team], float]) -> str:
    """Return in words the obstacles that take contact from a team, "" if it has none without."""
    free = contact(replace(team, obstacles=())) if team.obstacles else 0.0
    if free <= 0.0:
        return ""
    each = [
        f"obstacles_m[{k}]"
        for k, one in enumerate(team.obstacles)
        if contact(replace(team, obstacles=(one,))) < free
    ]
    return listed(each, _MOST_NAMED)


def _distances_to_keep(rules: Rules, links: int, separation: float) -> Array:
    """(e,) m that each pair is to keep; 0 where none is."""
    if separation > 0.0:
        return separation + _TABLE_ERROR * np.maximum(rules.radius_a, rules.radius_b)
    crossing = rules.distance < rules.radius_a + rules.radius_b
    crossing[links:] = False
    return np.where(crossing, TOO_NEAR * 0.5 * (rules.radius_a + rules.radius_b), 0.0)
