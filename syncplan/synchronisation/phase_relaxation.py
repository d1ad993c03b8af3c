"""Semidefinite relaxation of the phase problem: a bound on the smallest margin, and a start.

With Z = z z^* and z_k = e^{i theta_k}, the cosine of each link's residual is linear in Z:
cos = Re(Z_ab e^{-i offset}). Dropping rank(Z) = 1 leaves a convex problem, because the margin
(range less least distance) of a link is bounded above by a concave function of that cosine. Its
value bounds what any phases can reach; its Z is rounded to phases by random projections.

The relaxation and its rounding are those of Goemans and Williamson (Journal of the ACM 42, 1995),
for angles: Singer, Angular synchronization by eigenvectors and semidefinite programming (Applied
and Computational Harmonic Analysis 30, 2011).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncplan.arrays import Array
from syncplan.orbits.circles import wrap
from syncplan.runtime.convex_solver import has_solution, load_cvxpy
from syncplan.synchronisation.phase_rules import Rules, closest_distance

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
    """Return the relaxation of max min margin over `count` time-phases, None if it failed."""
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

    The margin never falls as the cosine rises, so a sample taken at its right neighbour's value
    bounds the piece between; the upper hull of these bounds is concave, and any of its lines lie
    above all of it.
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


def rounded(relaxation: PhaseRelaxation, generator: np.random.Generator, draws: int) -> list[Array]:
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
