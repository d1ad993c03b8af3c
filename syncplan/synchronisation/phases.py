"""Synchronisation: phases that bring the vehicles of every link together once a turn.

Whatever the senses, each rule fixes a difference of time-phases theta_i = d_i phi_i, so a spanning
tree satisfies the rules on its links in closed form (the paper's Algorithm 2, for any graph; after
Diaz-Banez et al., IEEE T-RO 2017). If the other links agree, that is the answer. If not (odd cycles
of one sense, even cycles that do not close), the phases maximise the smallest margin, range less
least distance:

    start    spanning tree, semidefinite relaxation, spectral and random starts
    polish   for given turns round the cycles, "every margin at least t" is a system of difference
             constraints lo <= theta_a - theta_b - offset <= hi, which shortest paths decide, so
             bisection finds the largest t, globally for those turns

Separation enters as further difference constraints on pairs that could meet.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index, as_pairs
from syncplan.orbits.circles import wrap
from syncplan.orbits.graphs import components, odd_cycle, traversal
from syncplan.orbits.separation import circle_gaps
from syncplan.synchronisation.phase_constraints import (
    PhaseConstraints,
    largest_margin,
    serve_greedily,
)
from syncplan.synchronisation.phase_rules import Rules, closest_distance, residuals, rules_of

__all__ = ["RELAXATION_LIMIT", "Dropped", "Synchronisation", "synchronise"]


RELAXATION_LIMIT = 40
"""Largest team whose phases are bounded by the semidefinite relaxation."""

EXACT_RAD = 1e-9
"""Residual up to which a rule counts as met."""

_BOUND_MET_M = 1e-6
_WHOLE_TURN_RAD = 1e-12
_TABLE_ERROR = 2e-5
"""Of a radius: what linear interpolation of a least distance over the residual may miss."""

_DRAWS = 12
_STARTS_SMALL, _STARTS_LARGE = 16, 4
_SMALL_TEAM = 40
_SEED = 0
_NEAR_ENOUGH = 1e-6
"""Relative change of the smooth cost at which a descent ends: only its turns round the cycles
count, and for these the polish finds the best phases."""


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
    method : "closed form", "relaxation and polish" or "spanning trees and polish"
    margin : m, the smallest range less least distance over the links kept; None without links
    bound : m, that no phases can exceed for the links kept; None where it was not computed
    bound_note : why there is no bound, or what it is
    dropped : links that no phases found can keep
    odd_cycle : vehicles of an odd cycle of links, in order; empty if there is none
    """

    phases: Array
    method: str
    margin: float | None
    bound: float | None
    bound_note: str
    dropped: tuple[Dropped, ...]
    odd_cycle: tuple[int, ...]


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
) -> Synchronisation:
    """Return phases for the links `pairs` (e, 2) from the first vehicle's phase.

    The first vehicle of every connected component starts at `first_phase`. `reach` is (n,) m.
    Without `margin_bound`, and where no closed form exists, the relaxation is skipped: the other
    starts mostly lead to the same phases, in half the time.
    """
    count = len(radii)
    pairs = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    rules = rules_of(centers, radii, senses, reach, pairs)
    guards = _guards(centers, radii, senses, reach, pairs, min_separation)
    cycle = tuple(odd_cycle(count, rules.edges))
    phases = _anchored(_along_tree(rules, count), senses, rules.edges, first_phase)
    theta = senses * phases
    if _meets(rules, guards, theta, min_separation):
        margin = _smallest_margin(rules, theta)
        bound, note = margin, "every link meets its rule, which is its closest approach"
        if np.any(rules.distance < rules.radius_a + rules.radius_b):
            bound, note = (
                None,
                "no bound: circles cross, where no rule is the closest approach",
            )
        return Synchronisation(phases, "closed form", margin, bound, note, (), cycle)
    return _by_margin(
        rules, guards, theta, senses, first_phase, min_separation, cycle, margin_bound
    )


def _guards(
    centers: Array, radii: Array, senses: Array, reach: Array, pairs: Index, min_separation: float
) -> Rules:
    """Rules of the unlinked pairs whose circles come nearer than the separation."""
    none = rules_of(centers, radii, senses, reach, np.zeros((0, 2), dtype=np.int64))
    if min_separation <= 0.0:
        return none
    a, b = np.triu_indices(len(radii), 1)
    every = np.column_stack([a, b])
    near = every[circle_gaps(centers, radii, every) < min_separation]
    listed = {(min(i, j), max(i, j)) for i, j in pairs.tolist()}
    guarded = as_pairs([(i, j) for i, j in near.tolist() if (i, j) not in listed])
    return rules_of(centers, radii, senses, reach, guarded)


def _along_tree(rules: Rules, count: int, residual: Array | float = 0.0) -> Array:
    """Time-phases with given residuals along a breadth-first spanning forest."""
    difference = rules.offset + residual
    theta = np.zeros(count)
    for parent, child, link in traversal(count, rules.edges):
        forward = rules.a[link] == parent
        theta[child] = theta[parent] + (-1.0 if forward else 1.0) * difference[link]
    return wrap(theta)


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


def _by_margin(
    rules: Rules,
    guards: Rules,
    tree: Array,
    senses: Array,
    first_phase: float,
    min_separation: float,
    cycle: tuple[int, ...],
    margin_bound: bool,
) -> Synchronisation:
    count = len(senses)
    radii = np.concatenate([rules.radius_a, rules.radius_b, guards.radius_a, guards.radius_b])
    kept_apart = min_separation
    if min_separation > 0.0:
        kept_apart = min_separation + _TABLE_ERROR * float(radii.max())
    constraints = PhaseConstraints.of(rules, guards, kept_apart)
    best = _search(rules, constraints, tree, count, margin_bound)
    dropped: tuple[Dropped, ...] = ()
    if not best.margin >= 0.0:
        served = serve_greedily(constraints, best.theta, count)
        dropped = tuple(
            Dropped(int(k), _why_dropped(rules, int(k), cycle))
            for k in np.setdiff1d(np.arange(len(rules)), served.links)
        )
        rules = rules.only(served.links)
        constraints = PhaseConstraints.of(rules, guards, kept_apart)
        best = _search(rules, constraints, served.theta, count, margin_bound)
    phases = _anchored(best.theta, senses, rules.edges + guards.edges, first_phase)
    return Synchronisation(
        phases,
        best.method,
        _smallest_margin(rules, best.theta),
        best.bound,
        best.note,
        dropped,
        cycle,
    )


@dataclass(frozen=True, slots=True)
class _Best:
    theta: Array
    margin: float
    bound: float | None
    method: str
    note: str


def _search(
    rules: Rules, constraints: PhaseConstraints, first: Array, count: int, margin_bound: bool
) -> _Best:
    """The best of several polished starts."""
    generator = np.random.default_rng(_SEED)
    starts = [first]
    bound, method = None, "spanning trees and polish"
    note = (
        f"no bound: {count} vehicles are more than the {RELAXATION_LIMIT} up to which the "
        "relaxation is solved"
    )
    if len(rules) == 0:
        note = "no links"
    elif not margin_bound:
        note = "no bound: none was requested"
    elif count <= RELAXATION_LIMIT:
        from syncplan.synchronisation.phase_relaxation import relax, rounded

        relaxation = relax(rules, count)
        note = "no bound: the relaxation was not solved"
        if relaxation is not None:
            bound, method = relaxation.bound, "relaxation and polish"
            note = "upper bound of the semidefinite relaxation, without separation"
            if bound is None:
                note = "no bound: the relaxation was solved to low accuracy only"
            starts += rounded(relaxation, generator, _DRAWS)
    starts += _smooth_starts(rules, count, generator)
    if constraints.separation > 0.0:
        starts += _separated_starts(rules, constraints, count, generator)
    best_theta, best_margin = first, -np.inf
    for start in starts:
        theta, margin = largest_margin(constraints, start, count, above=best_margin + _BOUND_MET_M)
        if margin > best_margin:
            best_theta, best_margin = theta, margin
        if bound is not None and best_margin >= bound - _BOUND_MET_M:
            break
    return _Best(best_theta, best_margin, bound, method, note)


def _smooth_starts(rules: Rules, count: int, generator: np.random.Generator) -> list[Array]:
    """Local minima of a steep smooth cost of the residuals, from spectral and random starts."""
    if len(rules) == 0:
        return []
    from scipy.optimize import minimize

    number = _STARTS_SMALL if count <= _SMALL_TEAM else _STARTS_LARGE
    starts = [_spectral(rules, count)]
    starts += [generator.uniform(-np.pi, np.pi, count) for _ in range(number)]
    # all starts descend at once, as one problem: most of the time is in the calls
    apart = count * np.arange(len(starts))[:, None]
    a, b = (apart + rules.a).ravel(), (apart + rules.b).ravel()

    def cost(stacked: Array) -> tuple[float, Array]:
        theta = stacked.reshape(len(starts), count)
        residual = theta[:, rules.a] - theta[:, rules.b] - rules.offset
        lack = 1.0 - np.cos(residual)
        slope = (4.0 * lack**3 * np.sin(residual)).ravel()
        gradient = np.bincount(a, slope, stacked.size) - np.bincount(b, slope, stacked.size)
        return float(np.sum(lack**4)), np.asarray(gradient, dtype=float)

    found = minimize(
        cost, np.concatenate(starts), jac=True, method="L-BFGS-B", options={"ftol": _NEAR_ENOUGH}
    )
    return list(wrap(found.x.reshape(len(starts), count)))


def _separated_starts(
    rules: Rules, constraints: PhaseConstraints, count: int, generator: np.random.Generator
) -> list[Array]:
    """Spanning trees whose links stand off the rule by what separation asks, either way."""
    apart = constraints.least_distance[: constraints.links] >= constraints.separation
    off = np.where(apart.any(axis=1), constraints.residual[np.argmax(apart, axis=1)], 0.0)
    number = 4 * (_STARTS_SMALL if count <= _SMALL_TEAM else _STARTS_LARGE)
    sides = [np.ones(len(off)), *generator.choice([-1.0, 1.0], (number, len(off)))]
    return [_along_tree(rules, count, side * off) for side in sides]


def _spectral(rules: Rules, count: int) -> Array:
    """Phases of the leading eigenvector of the matrix of required differences (Singer 2011)."""
    matrix = np.zeros((count, count), dtype=complex)
    matrix[rules.a, rules.b] = np.exp(1j * rules.offset)
    matrix[rules.b, rules.a] = np.exp(-1j * rules.offset)
    return np.asarray(np.angle(np.linalg.eigh(matrix)[1][:, -1]))


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


def _why_dropped(rules: Rules, link: int, cycle: tuple[int, ...]) -> str:
    if cycle and rules.same[link]:
        return (
            "the phases can't serve all links at once: the links contain an odd cycle, round which "
            "neighbours of one sense can't all be opposite"
        )
    return "the phases can't serve all links and keep the separation"
