"""Synchronisation: senses and phases that bring the vehicles of every link together once a turn.

With `direction: alternate`, senses are chosen so that as many links as possible join opposite ones.
That is the largest cut of the graph of links; a bipartite graph is cut entirely.

Whatever the senses, each rule fixes a difference of time-phases theta_i = d_i phi_i, so a spanning
tree satisfies the rules on its links in closed form (the paper's Algorithm 2, for any graph; after
Diaz-Banez et al., IEEE T-RO 2017). If the other links agree, that is the answer. If not (odd cycles
of one sense, even cycles that do not close), the phases maximise the smallest margin, range less
least distance. Where a field of view is limited or an obstacle may block sight, they maximise
contact.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Flags, Index, as_pairs
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import circle_gaps, close_pairs
from syncplan.orbits.graphs import components, contraction, odd_cycle, two_colouring
from syncplan.orbits.sight_lines import obstructible
from syncplan.orbits.team import Sensors, Team
from syncplan.synchronisation.contact_tables import contact_of_pairs, seeing_team
from syncplan.synchronisation.phase_rules import (
    Rules,
    along_tree,
    closest_distance,
    residuals,
    rules_of,
)

Edge = tuple[int, int]

EXACT_LIMIT = 60
"""Most contracted links for which the largest cut is found exactly, within the time limit."""

_TIME_LIMIT_S = 5.0
_RESTARTS = 20


def alternating_senses(count: int, edges: list[Edge], shared: list[Edge]) -> tuple[Array, bool]:
    """Return (senses (n,) of +1 and -1, whether the number of alternating links is proven largest).

    `shared` are pairs on one circle: opposite senses would collide there, so each such group is
    one vertex of the cut. The first vehicle turns counter-clockwise, and so does the first of
    every component where the links allow all to alternate.
    """
    label = contraction(count, shared)
    groups = max(label, default=-1) + 1
    contracted = [(label[a], label[b]) for a, b in edges if label[a] != label[b]]
    colour = two_colouring(groups, contracted)
    proven = True
    if colour is None:
        colour, proven = _largest_cut(groups, contracted)
    flip = colour[label[0]] if count else 0
    return np.array([1.0 if colour[label[k]] == flip else -1.0 for k in range(count)]), proven


def _largest_cut(count: int, edges: list[Edge]) -> tuple[list[int], bool]:
    weight = Counter((min(edge), max(edge)) for edge in edges)
    local = _local_cut(count, weight)
    if len(weight) > EXACT_LIMIT:
        return local, False
    exact = _exact_cut(count, weight)
    return (local, False) if exact is None else (exact, True)


def _exact_cut(count: int, weight: Counter[Edge]) -> list[int] | None:
    """Largest cut as a mixed-integer program; None if it is not solved in time."""
    from scipy.optimize import Bounds, LinearConstraint, milp

    pairs = list(weight)
    objective = np.concatenate([np.zeros(count), [-float(weight[pair]) for pair in pairs]])
    rows = np.zeros((2 * len(pairs), count + len(pairs)))
    limit = np.zeros(2 * len(pairs))
    for k, (a, b) in enumerate(pairs):
        rows[2 * k, [a, b, count + k]] = -1.0, -1.0, 1.0
        rows[2 * k + 1, [a, b, count + k]] = 1.0, 1.0, 1.0
        limit[2 * k + 1] = 2.0
    upper = np.ones(count + len(pairs))
    upper[0] = 0.0
    result = milp(
        objective,
        integrality=np.concatenate([np.ones(count), np.zeros(len(pairs))]),
        bounds=Bounds(np.zeros(count + len(pairs)), upper),
        constraints=LinearConstraint(rows, ub=limit),
        options={"time_limit": _TIME_LIMIT_S},
    )
    if result.status != 0:
        return None
    return [round(value) for value in result.x[:count]]


def _local_cut(count: int, weight: Counter[Edge]) -> list[int]:
    """Best of several one-exchange local optima, from seeded starts."""
    neighbours: list[list[tuple[int, int]]] = [[] for _ in range(count)]
    for (a, b), times in weight.items():
        neighbours[a].append((b, times))
        neighbours[b].append((a, times))
    generator = np.random.default_rng(0)
    best, best_value = [0] * count, -1
    for _ in range(_RESTARTS):
        side = generator.integers(0, 2, count).tolist()
        moved = True
        while moved:
            moved = False
            for k in range(count):
                gain = sum(w if side[k] == side[j] else -w for j, w in neighbours[k])
                if gain > 0:
                    side[k], moved = 1 - side[k], True
        value = sum(w for (a, b), w in weight.items() if side[a] != side[b])
        if value > best_value:
            best, best_value = side, value
    return best


# --- phases -------------------------------------------------------------------------------------


EXACT_RAD = 1e-9
"""Residual up to which a rule counts as met."""

_WHOLE_TURN_RAD = 1e-12


@dataclass(frozen=True, slots=True)
class Dropped:
    """A link that the phases do not serve.

    Attributes
    ----------
    link : its position in the list of links
    reason : why, in words
    """

    link: int
    reason: str


@dataclass(frozen=True, slots=True)
class Synchronisation:
    """Phases for given senses, with the evidence for them.

    Attributes
    ----------
    phases : (n,) rad at time 0
    method : "closed form", "relaxation and polish", "spanning trees and polish", "cell search and
        polish", or "largest contact" where a field of view is limited or obstacles are near
    margin : m, the smallest range less least distance over the links kept; None without links
    bound : m, upper bound on the margin of the links kept; None where it was not computed
    bound_note : kind of bound, or why there is none
    dropped : links that no phases found can keep
    odd_cycle : vehicles of an odd cycle of links, in order; empty if there is none
    attainable : longest contact of each link (a, b), a < b, at any phases, as a share of a period;
        None unless a field of view is limited or obstacles are near
    """

    phases: Array
    method: str
    margin: float | None
    bound: float | None
    bound_note: str
    dropped: tuple[Dropped, ...]
    odd_cycle: tuple[int, ...]
    attainable: Mapping[tuple[int, int], float] | None = None


def synchronise(
    centers: Array,
    radii: Array,
    senses: Array,
    reach: Array,
    pairs: Index,
    first_phase: float,
    min_separation: float = 0.0,
    *,
    margin_bound: bool = True,
    sensors: Sensors | None = None,
    obstacles: tuple[Array, ...] = (),
) -> Synchronisation:
    """Return phases for the links `pairs` (e, 2) from the first vehicle's phase.

    The first vehicle of every connected component starts at `first_phase`. `reach` is (n,) m.
    Without `margin_bound` the relaxation, used where no closed form exists, is skipped: the other
    starts mostly lead to the same phases, in half the time. Where one of the `sensors` has a
    limited field of view, or one of the `obstacles`, polygons (k, 2) m, may block a link, phases
    maximise contact: each link's time within range and view, in either direction, as a share of the
    longest that any phases give it.
    """
    count = len(radii)
    pairs = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    circles = Orbits(centers, radii, senses, np.zeros(count), 1.0)
    rules = rules_of(circles, reach, pairs)
    guards = _guards(circles, reach, pairs, min_separation)
    case = _PhaseProblem(
        circles, rules, guards, min_separation, tuple(odd_cycle(count, rules.edges))
    )
    if sensors is not None and len(rules):
        team = seeing_team(circles, sensors, obstacles)
        limited = np.any(sensors.fields_of_view < 2.0 * np.pi)
        if limited or np.any(obstructible(team, rules.a, rules.b)):
            return _by_contact(case, team, first_phase, quick=not margin_bound)
    phases = _anchored(along_tree(rules, count), senses, rules.edges, first_phase)
    theta = senses * phases
    if _meets(rules, guards, theta, min_separation):
        return _in_closed_form(case, phases)
    from syncplan.synchronisation.margin_search import search_margins

    found = search_margins(rules, guards, theta, min_separation, margin_bound=margin_bound)
    kept = case.kept(found.unserved)
    return Synchronisation(
        phases=_anchored(found.theta, senses, kept.edges + guards.edges, first_phase),
        method=found.method,
        margin=_smallest_margin(kept, found.theta),
        bound=found.bound,
        bound_note=found.note,
        dropped=tuple(Dropped(k, _why_dropped(case, k)) for k in found.unserved.tolist()),
        odd_cycle=case.cycle,
    )


@dataclass(frozen=True, slots=True)
class _PhaseProblem:
    """Circles, rules of links and of pairs to be kept `separation` m apart, and an odd cycle."""

    circles: Orbits
    rules: Rules
    guards: Rules
    separation: float
    cycle: tuple[int, ...]

    def cycle_of(self, links: Flags) -> tuple[int, ...]:
        """Return the vehicles of an odd cycle of the chosen links (e,)."""
        some = self.rules.only(np.flatnonzero(links))
        return tuple(odd_cycle(self.circles.count, some.edges))

    def kept(self, unserved: Index) -> Rules:
        """Return the rules of all links except the `unserved`."""
        return self.rules.only(np.setdiff1d(np.arange(len(self.rules)), unserved))


def _in_closed_form(case: _PhaseProblem, phases: Array) -> Synchronisation:
    rules = case.rules
    margin = _smallest_margin(rules, case.circles.senses * phases)
    bound, note = margin, "every link meets its rule, which is its closest approach"
    if np.any(rules.distance < rules.radius_a + rules.radius_b):
        bound, note = (
            None,
            "no bound: circles cross, where no rule is the closest approach",
        )
    return Synchronisation(phases, "closed form", margin, bound, note, (), case.cycle)


def _by_contact(
    case: _PhaseProblem, team: Team, first_phase: float, *, quick: bool
) -> Synchronisation:
    from syncplan.synchronisation.sighted_phases import phases_in_sight, why_unseen

    rules, guards, senses = case.rules, case.guards, case.circles.senses
    found, most = phases_in_sight(rules, guards, team, case.separation, quick=quick)
    kept = case.kept(found.unserved)
    phases = _anchored(found.theta, senses, kept.edges + guards.edges, first_phase)
    attainable = dict(zip(rules.edges, most.tolist(), strict=True))
    if found.by_rule:
        return replace(_in_closed_form(case, phases), attainable=attainable)
    contact = contact_of_pairs(
        team.on(replace(case.circles, phases=phases)), np.column_stack([kept.a, kept.b])
    )
    served = np.array([attainable[pair] for pair in kept.edges])
    smallest = float(np.min(contact / served, initial=1.0))
    within = "among the obstacles" if team.obstacles else "within the fields of view"
    note = (
        f"no bound: phases maximise contact {within}; every link served has at "
        f"least {np.floor(1000.0 * smallest) / 10.0:g} % of the most that any phases give it"
    )
    return Synchronisation(
        phases=phases,
        method="largest contact",
        margin=_smallest_margin(kept, senses * phases),
        bound=None,
        bound_note=note if len(kept) else "no links are served",
        dropped=tuple(
            Dropped(k, why_unseen(team, np.array(rules.edges[k]), float(most[k])))
            for k in found.unserved.tolist()
        ),
        odd_cycle=case.cycle_of(most > 0.0) if team.obstacles else case.cycle,
        attainable=attainable,
    )


def _guards(circles: Orbits, reach: Array, pairs: Index, min_separation: float) -> Rules:
    """Rules of the unlinked pairs whose circles come nearer than the separation."""
    if min_separation <= 0.0:
        return rules_of(circles, reach, as_pairs([]))
    every = close_pairs(circles.centers, circles.radii, min_separation)
    near = every[circle_gaps(circles.centers, circles.radii, every) < min_separation]
    listed = {(min(i, j), max(i, j)) for i, j in pairs.tolist()}
    guarded = as_pairs([(i, j) for i, j in near.tolist() if (i, j) not in listed])
    return rules_of(circles, reach, guarded)


def _meets(rules: Rules, guards: Rules, theta: Array, min_separation: float) -> bool:
    """Whether the exact rules serve every link within range and separation."""
    residual = residuals(rules, theta)
    if np.any(np.abs(residual) > EXACT_RAD):
        return False
    least = closest_distance(rules, residual)
    kept = closest_distance(guards, residuals(guards, theta))
    return bool(
        np.all(least <= rules.reach * (1.0 + 1e-12))
        and np.all(least >= min_separation)
        and np.all(kept >= min_separation)
    )


def _anchored(
    theta: Array, senses: Array, edges: list[tuple[int, int]], first_phase: float
) -> Array:
    """Phases in [0, 2 pi) with the first vehicle of each component at `first_phase`."""
    theta = theta.copy()
    for part in components(len(theta), edges):
        theta[part] += senses[part[0]] * first_phase - theta[part[0]]
    phases = (senses * theta) % (2.0 * np.pi)
    return np.where(2.0 * np.pi - phases < _WHOLE_TURN_RAD, 0.0, phases)


def _smallest_margin(rules: Rules, theta: Array) -> float | None:
    if len(rules) == 0:
        return None
    return float(np.min(rules.reach - closest_distance(rules, residuals(rules, theta))))


def _why_dropped(case: _PhaseProblem, link: int) -> str:
    if case.cycle and case.rules.same[link]:
        return (
            "the phases can't serve all links at once: the links contain an odd cycle, round which "
            "neighbours of one sense can't all be opposite"
        )
    return "the phases can't serve all links and keep the separation"
