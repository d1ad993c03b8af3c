"""Margin search: phases of the largest smallest margin, which is range less least distance.

    start    spanning tree, semidefinite relaxation, spectral and random starts; for up to four
             vehicles that keep a separation, the global optimum to a thousandth
    polish   for given turns round the cycles, "every margin at least t" is a system of difference
             constraints lo <= theta_a - theta_b - offset <= hi, which shortest paths solve, so
             bisection finds the largest t, globally for those turns

Separation enters as further difference constraints on pairs that could meet.

The relaxation bounds the smallest margin. With Z = z z^* and z_k = e^{i theta_k}, the cosine of
each link's residual is linear in Z: cos = Re(Z_ab e^{-i offset}). Dropping rank(Z) = 1 leaves a
convex problem, because the margin of a link is bounded above by a concave function of that cosine.
Its value bounds the smallest margin of all phases; random projections round its Z to phases. Both
follow Goemans and Williamson (Journal of the ACM 42, 1995), for angles: Singer, Angular
synchronization by eigenvectors and semidefinite programming (Applied and Computational Harmonic
Analysis 30, 2011).
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import wrap
from syncplan.runtime.machine import has_solution, load_cvxpy
from syncplan.synchronisation.difference_tables import (
    MOST_VEHICLES,
    best_phases,
    most_served,
)
from syncplan.synchronisation.phase_constraints import (
    PhaseConstraints,
    largest_margin,
    serve_greedily,
)
from syncplan.synchronisation.phase_rules import Rules, along_tree, closest_distance

_SAMPLES = 2049
_LINES = 96
_EXACT_OFFSET = 1e-12


@dataclass(frozen=True, slots=True)
class PhaseRelaxation:
    """Upper bound on the smallest margin in m, and the (n, n) Gram matrix that attains it.

    The bound is None where the solver stopped short of its accuracy: the matrix is still a start,
    but its value bounds nothing.
    """

    bound: float | None
    gram: NDArray[np.complex128]


def relax(rules: Rules, count: int) -> PhaseRelaxation | None:
    """Return the relaxation of max min margin over `count` time-phases; None if it failed."""
    cp = load_cvxpy()
    # Real when all offsets are 0 or pi: Z and its conjugate then have the same value.
    real = bool(np.all(np.abs(np.sin(rules.offset)) < _EXACT_OFFSET))
    # Variables
    gram: Any = (
        cp.Variable((count, count), symmetric=True)
        if real
        else cp.Variable((count, count), hermitian=True)
    )
    margin = cp.Variable()
    # Objective and constraints
    turn = np.exp(-1j * rules.offset)
    entries = gram[rules.a, rules.b]
    cosine = (
        cp.multiply(turn.real, entries)
        if real
        else cp.multiply(turn.real, cp.real(entries)) - cp.multiply(turn.imag, cp.imag(entries))
    )
    constraints = [gram >> 0, cp.diag(gram) == 1]
    constraints += _margin_limits(rules, cosine, margin)
    # Solve
    problem = cp.Problem(cp.Maximize(margin), constraints)
    if not has_solution(problem, solver=cp.CLARABEL):
        return None
    bound = float(margin.value) if problem.status == "optimal" else None
    return PhaseRelaxation(bound, np.asarray(gram.value, dtype=complex))


def _margin_limits(rules: Rules, cosine: Any, margin: Any) -> list[Any]:
    """Concave majorants of each link's margin as a function of the cosine of its residual."""
    cp = load_cvxpy()
    limits = [margin <= float(rules.reach.min())]
    same = np.flatnonzero(rules.same)
    if len(same):
        ra, rb = rules.radius_a[same], rules.radius_b[same]
        reached = cp.sqrt(ra**2 + rb**2 + cp.multiply(2.0 * ra * rb, cosine[same]))
        limits.append(margin <= rules.reach[same] - rules.distance[same] + reached)
    for k in np.flatnonzero(~rules.same):
        slopes, heights = _majorant(rules.only(np.array([k])))
        limits.append(margin <= slopes * cosine[int(k)] + heights)
    return limits


def _majorant(rule: Rules) -> tuple[Array, Array]:
    """Slopes and heights of lines above one link's margin as a function of the cosine.

    The margin never falls as the cosine rises, so the right neighbour's value bounds the piece
    between two samples. The upper hull of these bounds is concave, and each of its lines lies above
    all of it.
    """
    cosine = np.cos(np.linspace(np.pi, 0.0, _SAMPLES))
    overlap = rule.distance[0] < rule.radius_a[0] + rule.radius_b[0]
    least = closest_distance(rule, np.arccos(cosine)[None])[0] * (not overlap)
    margin = np.maximum.accumulate(rule.reach[0] - least)
    value = np.append(margin[1:], margin[-1])
    hull: list[int] = []
    for k in range(_SAMPLES):
        while len(hull) > 1:
            i, j = hull[-2], hull[-1]
            rise = (value[j] - value[i]) * (cosine[k] - cosine[i])
            if rise > (value[k] - value[i]) * (cosine[j] - cosine[i]):
                break
            hull.pop()
        hull.append(k)
    x, y = cosine[hull], value[hull]
    slopes = np.diff(y) / np.diff(x)
    chosen = np.unique(np.linspace(0, len(slopes) - 1, _LINES).astype(int))
    return slopes[chosen], (y[:-1] - slopes * x[:-1])[chosen]


def rounded(
    relaxation: PhaseRelaxation, generator: "np.random.Generator", draws: int
) -> list[Array]:
    """Return candidate time-phases (n,): the leading eigenvector's, then random projections'."""
    values, vectors = np.linalg.eigh(relaxation.gram)
    factor = vectors * np.sqrt(np.maximum(values, 0.0))
    found = [np.angle(factor[:, -1])]
    if factor.shape[1] > 1:
        found.append(np.angle(factor[:, -1] + 1j * factor[:, -2]))
        found.append(np.angle(factor[:, -1].real + 1j * factor[:, -2].real))
    for _ in range(draws):
        direction = generator.standard_normal(len(values)) + 1j * generator.standard_normal(
            len(values)
        )
        found.append(np.angle(factor @ direction))
    return [wrap(theta) for theta in found]


# --- search -------------------------------------------------------------------------------------


RELAXATION_LIMIT = 40
"""Largest team for which the semidefinite relaxation is solved."""

_BOUND_MET_M = 1e-6
_TABLE_ERROR = 2e-5
"""Error of linear interpolation of a least distance over the residual, as a share of a radius."""

_DRAWS = 12
_STARTS_SMALL, _STARTS_LARGE = 16, 4
_SMALL_TEAM = 40
_SEED = 0
_DENSE_SPECTRUM = 500
"""Most vehicles whose leading eigenvector is found among all."""

_NEAR_ENOUGH = 1e-6
"""Relative change of the smooth cost at which a descent ends. Only its turns round the cycles
matter: the polish finds the best phases for them."""

_RAMP_M = 1.0
"""Shortfall of the margin, in m, below which a link counts in part as served."""


@dataclass(frozen=True, slots=True)
class LargestMargin:
    """Time-phases of the largest smallest margin found.

    Attributes
    ----------
    theta : (n,) rad
    margin, bound : m, of the links kept, and its bound for all phases; None where not computed
    method, note : how the phases were found, and the kind of bound or why there is none
    unserved : (k,) links that no phases found can keep
    """

    theta: Array
    margin: float
    bound: float | None
    method: str
    note: str
    unserved: Index


def search_margins(
    rules: Rules, guards: Rules, first: Array, separation: float, *, margin_bound: bool
) -> LargestMargin:
    """Return the phases of the largest smallest margin, leaving out links that can't be kept.

    `guards` are pairs to be kept `separation` m apart, as linked pairs are; `first` (n,) is a
    start. Without `margin_bound` the relaxation is skipped.
    """
    kept_apart, count = separation, len(first)
    if separation > 0.0:
        radii = np.concatenate([rules.radius_a, rules.radius_b, guards.radius_a, guards.radius_b])
        kept_apart = separation + _TABLE_ERROR * float(radii.max())
    constraints = PhaseConstraints.of(rules, guards, kept_apart)
    thorough = separation > 0.0 and count <= MOST_VEHICLES
    best = _search(rules, constraints, first, margin_bound, thorough)
    if best.margin >= 0.0:
        return best
    served, theta = _serve(constraints, best.theta, thorough)
    unserved = np.setdiff1d(np.arange(len(rules)), served)
    if separation > 0.0:
        guards = guards.joined(rules.only(unserved))
    rules = rules.only(served)
    constraints = PhaseConstraints.of(rules, guards, kept_apart)
    best = _search(rules, constraints, theta, margin_bound, thorough)
    return replace(best, unserved=unserved)


def _serve(constraints: PhaseConstraints, theta: Array, thorough: bool) -> tuple[Index, Array]:
    """Largest set of links found that phases can serve at once, and these phases.

    Found by cell search if `thorough`; otherwise, or if that fails, greedily.
    """
    if thorough:
        tables = constraints.over_differences()
        found, number = best_phases(tables, len(theta), most_served(0.0, _RAMP_M))
        links = np.flatnonzero(tables.at(found)[: constraints.links] >= 0.0)
        if number > -np.inf and len(links):
            return links, found
    return serve_greedily(constraints, theta)


def _search(
    rules: Rules, constraints: PhaseConstraints, first: Array, margin_bound: bool, thorough: bool
) -> LargestMargin:
    """Best polished phases of several starts, or of cell search if `thorough`."""
    generator, count = np.random.default_rng(_SEED), len(first)
    starts, bound, method, note = _relaxed(rules, count, generator, margin_bound)
    starts = [first, *starts]
    whole = -np.inf
    if thorough and len(constraints.rules):
        found, whole = best_phases(constraints.over_differences(), count)
        starts, method = [found, first], "cell search and polish"
    if whole == -np.inf:
        starts += _smooth_starts(rules, count, generator)
        if np.any(constraints.separation > 0.0):
            starts += _separated_starts(rules, constraints, count, generator)
    best_theta, best_margin = first, -np.inf
    for start in starts:
        theta, margin = largest_margin(constraints, start, above=best_margin + _BOUND_MET_M)
        if margin > best_margin:
            best_theta, best_margin = theta, margin
        if bound is not None and best_margin >= bound - _BOUND_MET_M:
            break
    return LargestMargin(best_theta, best_margin, bound, method, note, np.zeros(0, dtype=np.int64))


def _relaxed(
    rules: Rules, count: int, generator: "np.random.Generator", margin_bound: bool
) -> tuple[list[Array], float | None, str, str]:
    """Starts from the relaxation, its bound, the method of the search, and a note on the bound."""
    method = "spanning trees and polish"
    if len(rules) == 0:
        return [], None, method, "no links"
    if not margin_bound:
        return [], None, method, "no bound: none was requested"
    if count > RELAXATION_LIMIT:
        note = (
            f"no bound: {count} vehicles are more than the {RELAXATION_LIMIT} up to which the "
            "relaxation is solved"
        )
        return [], None, method, note
    relaxation = relax(rules, count)
    if relaxation is None:
        return [], None, method, "no bound: the relaxation was not solved"
    note = "upper bound of the semidefinite relaxation, without separation"
    if relaxation.bound is None:
        note = "no bound: the relaxation was solved to low accuracy only"
    starts = rounded(relaxation, generator, _DRAWS)
    return starts, relaxation.bound, "relaxation and polish", note


def _smooth_starts(rules: Rules, count: int, generator: "np.random.Generator") -> list[Array]:
    """Local minima of a steep smooth cost of the residuals, from spectral and random starts."""
    if len(rules) == 0:
        return []
    from scipy.optimize import minimize

    number = _STARTS_SMALL if count <= _SMALL_TEAM else _STARTS_LARGE
    starts = [_spectral(rules, count)]
    starts += [generator.uniform(-np.pi, np.pi, count) for _ in range(number)]
    # all starts descend at once, as one problem: the calls take most of the time
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
    rules: Rules, constraints: PhaseConstraints, count: int, generator: "np.random.Generator"
) -> list[Array]:
    """Spanning trees whose links miss the rule, either way, by as much as separation requires."""
    links = constraints.links
    apart = constraints.least_distance[:links] >= constraints.separation[:links, None]
    off = np.where(apart.any(axis=1), constraints.residual[np.argmax(apart, axis=1)], 0.0)
    number = 4 * (_STARTS_SMALL if count <= _SMALL_TEAM else _STARTS_LARGE)
    sides = [np.ones(len(off)), *generator.choice([-1.0, 1.0], (number, len(off)))]
    return [along_tree(rules, count, side * off) for side in sides]


def _spectral(rules: Rules, count: int) -> Array:
    """Phases of the leading eigenvector of the matrix of required differences (Singer 2011).

    For large teams, they are near it: they are a start.
    """
    if count <= _DENSE_SPECTRUM:
        matrix = np.zeros((count, count), dtype=complex)
        matrix[rules.a, rules.b] = np.exp(1j * rules.offset)
        matrix[rules.b, rules.a] = np.exp(-1j * rules.offset)
        return np.asarray(np.angle(np.linalg.eigh(matrix)[1][:, -1]))
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import eigsh

    upper = coo_array((np.exp(1j * rules.offset), (rules.a, rules.b)), shape=(count, count)).tocsr()
    leading = eigsh(upper + upper.conj().T, k=1, which="LA", v0=np.ones(count), tol=1e-3)[1]
    return np.asarray(np.angle(leading[:, 0]))
