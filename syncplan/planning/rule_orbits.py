"""Orbits of a scenario by the rules: its circles, their senses, and the phases of its links."""

from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Index, as_pairs
from syncplan.orbits import contacts
from syncplan.orbits.circles import Orbits
from syncplan.orbits.team import Team, radii_of, team_of
from syncplan.scenario.rules import SAME_PLACE_M
from syncplan.scenario.specification import Scenario
from syncplan.synchronisation.phases import Synchronisation, alternating_senses, synchronise


@dataclass(frozen=True, slots=True)
class RuleOrbits:
    """Orbits whose phases follow the rules exactly.

    Attributes
    ----------
    orbits : as the rules have them
    pairs : (e, 2) links that the phases were found for, a < b
    synchronisation : how the phases were found
    alternating_proven : whether the number of alternating links is proven largest; None if the
        senses were given
    """

    orbits: Orbits
    pairs: Index
    synchronisation: Synchronisation
    alternating_proven: bool | None

    def desynchronised(self, offset: Array | float) -> Orbits:
        """Return the orbits with phases off the rules by `offset` rad, common or (n,)."""
        if not np.any(offset):
            return self.orbits
        return replace(self.orbits, phases=(self.orbits.phases + offset) % (2.0 * np.pi))


def rule_orbits(scenario: Scenario, *, margin_bound: bool = True) -> RuleOrbits:
    """Return the orbits of a resolved scenario by the rules.

    `margin_bound` adds the bound on the links' smallest margin, see synchronise.
    """
    circles = _circles(scenario)
    team = team_of(scenario, circles)
    pairs = listed_pairs(scenario, team)
    senses, proven = _senses(scenario, team, pairs)
    synchronisation = synchronise(
        circles.centers,
        circles.radii,
        senses,
        team.sensors.ranges,
        pairs,
        scenario.orbit.first_phase_rad,
        scenario.separation,
        margin_bound=margin_bound,
        sensors=team.sensors,
        obstacles=team.obstacles,
    )
    orbits = replace(circles, senses=senses, phases=synchronisation.phases)
    return RuleOrbits(orbits, pairs, synchronisation, proven)


def listed_pairs(scenario: Scenario, team: Team) -> Index:
    """Return the (e, 2) links to synchronise, a < b: as listed, or all that can come within range.

    Only the circles of the team's orbits matter.
    """
    if scenario.formation.links is not None:
        return as_pairs(scenario.linked)
    a, b = contacts.reachable_pairs(team.orbits, team.sensors.ranges)
    return np.unique(np.column_stack([np.minimum(a, b), np.maximum(a, b)]), axis=0)


def _circles(scenario: Scenario) -> Orbits:
    """Centres, radii and rate of a scenario; senses and phases are placeholders."""
    zeros = np.zeros(scenario.size)
    centers = np.array(scenario.centers, dtype=float)
    return Orbits(centers, radii_of(scenario), zeros + 1.0, zeros, scenario.orbit.rate)


def _senses(scenario: Scenario, team: Team, pairs: Index) -> tuple[Array, bool | None]:
    """Senses (n,), and whether the number of alternating links is proven largest; None if given.

    Links that obstacles hide whatever the phases do not count.
    """
    direction = scenario.orbit.direction
    if direction == "alternate":
        from syncplan.synchronisation.sighted_phases import hidden_at_all_phases

        edges = [(int(a), int(b)) for a, b in pairs[~hidden_at_all_phases(team, pairs)]]
        return alternating_senses(scenario.size, edges, _sharing_a_circle(team.orbits))
    turn = {"ccw": 1.0, "cw": -1.0}
    listed = direction if isinstance(direction, list) else [direction] * scenario.size
    return np.array([turn[sense] for sense in listed]), None


def _sharing_a_circle(circles: Orbits) -> list[tuple[int, int]]:
    """Pairs of vehicles whose circles agree to SAME_PLACE_M in centre and radius."""
    centers, radii = circles.centers, circles.radii
    a, b = contacts.reachable_pairs(circles, np.full(circles.count, SAME_PLACE_M))
    apart = np.hypot(*(centers[a] - centers[b]).T)
    same = (apart <= SAME_PLACE_M) & (np.abs(radii[a] - radii[b]) <= SAME_PLACE_M) & (a < b)
    return list(zip(a[same].tolist(), b[same].tolist(), strict=True))
