"""Margin search: phases whose smallest margin, range less least distance, is largest.

    start    spanning tree, semidefinite relaxation, spectral and random starts; for up to four
             vehicles that keep a separation, the global optimum to a thousandth
    polish   for given turns round the cycles, "every margin at least t" is a system of difference
             constraints lo <= theta_a - theta_b - offset <= hi, which shortest paths decide, so
             bisection finds the largest t, globally for those turns

Separation enters as further difference constraints on pairs that could meet.
"""

from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import wrap
from syncplan.orbits.graphs import traversal
from syncplan.synchronisation.cell_search import MOST_VEHICLES, best_phases, most_served
from syncplan.synchronisation.phase_constraints import (
    PhaseConstraints,
    ServedLinks,
    largest_margin,
    serve_greedily,
)
from syncplan.synchronisation.phase_rules import Rules

RELAXATION_LIMIT = 40
"""Largest team whose phases are bounded by the semidefinite relaxation."""

_BOUND_MET_M = 1e-6
_TABLE_ERROR = 2e-5
"""Of a radius: what linear interpolation of a least distance over the residual may miss."""

_DRAWS = 12
_STARTS_SMALL, _STARTS_LARGE = 16, 4
_SMALL_TEAM = 40
_SEED = 0
_NEAR_ENOUGH = 1e-6
"""Relative change of the smooth cost at which a descent ends: only its turns round the cycles
count, and for these the polish finds the best phases."""

_RAMP_M = 1.0
"""Short of the range by less than this, a link counts in part among those served."""


@dataclass(frozen=True, slots=True)
class LargestMargin:
    """Time-phases (n,) of the largest smallest margin found.

    Attributes
    ----------
    theta : (n,) rad
    margin, bound : m, of the links kept, and what no phases can exceed; None where not computed
    method, note : how the phases were found, and what the bound is or why there is none
    unserved : (k,) links that no phases found can keep
    """

    theta: Array
    margin: float
    bound: float | None
    method: str
    note: str
    unserved: Index


def along_tree(rules: Rules, count: int, residual: Array | float = 0.0) -> Array:
    """Return time-phases (n,) with given residuals (e,) along a breadth-first spanning forest."""
    difference = rules.offset + residual
    theta = np.zeros(count)
    for parent, child, link in traversal(count, rules.edges):
        forward = rules.a[link] == parent
        theta[child] = theta[parent] + (-1.0 if forward else 1.0) * difference[link]
    return wrap(theta)


def search_margins(
    rules: Rules, guards: Rules, first: Array, separation: float, *, margin_bound: bool
) -> LargestMargin:
    """Return the phases of the largest smallest margin, without links that can't be kept.

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
    served = _serve(constraints, best.theta, thorough)
    unserved = np.setdiff1d(np.arange(len(rules)), served.links)
    if separation > 0.0:
        guards = guards.joined(rules.only(unserved))
    rules = rules.only(served.links)
    constraints = PhaseConstraints.of(rules, guards, kept_apart)
    best = _search(rules, constraints, served.theta, margin_bound, thorough)
    return replace(best, unserved=unserved)


def _serve(constraints: PhaseConstraints, theta: Array, thorough: bool) -> ServedLinks:
    """As many links as can be served at once: by cell search, or else greedily."""
    if thorough:
        tables = constraints.over_differences()
        found, number = best_phases(tables, len(theta), most_served(0.0, _RAMP_M))
        links = np.flatnonzero(tables.at(found)[: constraints.links] >= 0.0)
        if number > -np.inf and len(links):
            return ServedLinks(links, found)
    return serve_greedily(constraints, theta)


def _search(
    rules: Rules, constraints: PhaseConstraints, first: Array, margin_bound: bool, thorough: bool
) -> LargestMargin:
    """The best of several polished starts, or of the cell search's where it is `thorough`."""
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
    rules: Rules, count: int, generator: np.random.Generator, margin_bound: bool
) -> tuple[list[Array], float | None, str, str]:
    """Starts from the relaxation, its bound, how phases are found, and a note on the bound."""
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
    from syncplan.synchronisation.phase_relaxation import relax, rounded

    relaxation = relax(rules, count)
    if relaxation is None:
        return [], None, method, "no bound: the relaxation was not solved"
    note = "upper bound of the semidefinite relaxation, without separation"
    if relaxation.bound is None:
        note = "no bound: the relaxation was solved to low accuracy only"
    starts = rounded(relaxation, generator, _DRAWS)
    return starts, relaxation.bound, "relaxation and polish", note


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
    links = constraints.links
    apart = constraints.least_distance[:links] >= constraints.separation[:links, None]
    off = np.where(apart.any(axis=1), constraints.residual[np.argmax(apart, axis=1)], 0.0)
    number = 4 * (_STARTS_SMALL if count <= _SMALL_TEAM else _STARTS_LARGE)
    sides = [np.ones(len(off)), *generator.choice([-1.0, 1.0], (number, len(off)))]
    return [along_tree(rules, count, side * off) for side in sides]


def _spectral(rules: Rules, count: int) -> Array:
    """Phases of the leading eigenvector of the matrix of required differences (Singer 2011)."""
    matrix = np.zeros((count, count), dtype=complex)
    matrix[rules.a, rules.b] = np.exp(1j * rules.offset)
    matrix[rules.b, rules.a] = np.exp(-1j * rules.offset)
    return np.asarray(np.angle(np.linalg.eigh(matrix)[1][:, -1]))
