"""The planner: from a scenario to a judged plan. The only module that sees the whole chain."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.errors import InputError
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import reachable_pairs
from syncplan.orbits.team import Team, radii_of, team_of
from syncplan.placement.centers import place
from syncplan.planning.judged_plan import Plan
from syncplan.planning.judgement import BoundChoice, judge, listed_pairs
from syncplan.runtime.numerics import single_threaded_blas
from syncplan.scenario.loading import scenario_of
from syncplan.scenario.rules import SAME_PLACE_M
from syncplan.scenario.specification import Scenario, per_vehicle
from syncplan.synchronisation.phases import alternating_senses, synchronise
from syncplan.synchronisation.sighted_phases import hidden_at_all_phases


@single_threaded_blas
def plan(
    scenario: Scenario | str | Path | Mapping[str, Any],
    *,
    bound: BoundChoice = "auto",
    steady: bool = False,
    margin_bound: bool = True,
    pilot: bool = True,
    single_points: bool = True,
) -> Plan:
    """Return the plan of a scenario: senses, phases, links and the verdict on observability.

    `scenario` may be the path of its file or a mapping of its keys; syncplan.load_plan reads plans.
    Centres that are not given are found first, see syncplan.placement.centers.

    `bound` says whether the posterior bound is computed: for teams up to a stated amount of work
    (auto), always or never. `steady` adds its periodic limit. `margin_bound` says whether the
    bound on the links' smallest margin is computed, which takes most of the time where phases have
    no closed form. `pilot` says whether a few trials are run where the start-up index does not
    clear the plan, `single_points` whether it is found which single losses end observability.
    """
    if bound not in ("auto", "always", "never"):
        raise InputError(f"{bound!r}: must be auto, always or never", key="bound")
    scenario = scenario_of(scenario)
    placed = None if scenario.formation.placed else place(scenario)
    resolved = (scenario if placed is None else placed.scenario).resolved()
    circles = _circles(resolved)
    team = team_of(resolved, circles)
    pairs = listed_pairs(resolved, team)
    senses, proven = _senses(resolved, team, pairs)
    found = synchronise(
        circles.centers,
        circles.radii,
        senses,
        team.sensors.ranges,
        pairs,
        resolved.orbit.first_phase_rad,
        resolved.separation,
        margin_bound=margin_bound,
        sensors=team.sensors,
        obstacles=team.obstacles,
    )
    off = np.array(per_vehicle(resolved.orbit.desync_rad, resolved.size), dtype=float)
    phases = (found.phases + off) % (2.0 * np.pi) if off.any() else found.phases
    orbits = replace(circles, senses=senses, phases=phases)
    judged = judge(
        resolved,
        orbits,
        bound=bound,
        steady=steady,
        pilot=pilot,
        single_points=single_points,
        given=pairs,
        found=found,
    )
    return replace(judged, synchronisation=found, alternating_proven=proven, placement=placed)


def _circles(scenario: Scenario) -> Orbits:
    """Centres, radii and rate of a scenario; senses and phases are yet to be found."""
    zeros = np.zeros(scenario.size)
    centers = np.array(scenario.centers, dtype=float)
    return Orbits(centers, radii_of(scenario), zeros + 1.0, zeros, scenario.orbit.rate)


def _senses(scenario: Scenario, team: Team, pairs: Index) -> tuple[Array, bool | None]:
    """Senses (n,), and whether as many links alternate as can be; None where they were given.

    Links that obstacles hide whatever the senses do not count.
    """
    direction = scenario.orbit.direction
    if direction == "alternate":
        edges = [(int(a), int(b)) for a, b in pairs[~hidden_at_all_phases(team, pairs)]]
        return alternating_senses(scenario.size, edges, _sharing_a_circle(team.orbits))
    turn = {"ccw": 1.0, "cw": -1.0}
    listed = direction if isinstance(direction, list) else [direction] * scenario.size
    return np.array([turn[one] for one in listed]), None


def _sharing_a_circle(circles: Orbits) -> list[tuple[int, int]]:
    """Pairs of vehicles whose circles are the same, to SAME_PLACE_M in centre and radius."""
    centers, radii = circles.centers, circles.radii
    a, b = reachable_pairs(circles, np.full(circles.count, SAME_PLACE_M))
    apart = np.hypot(*(centers[a] - centers[b]).T)
    same = (apart <= SAME_PLACE_M) & (np.abs(radii[a] - radii[b]) <= SAME_PLACE_M) & (a < b)
    return list(zip(a[same].tolist(), b[same].tolist(), strict=True))
