"""Determinants and window bounds of the windowed information W, as CasADi expressions.

A sparse LDL factorisation yields log det W. Its derivative by W is the inverse on W's own sparsity,
which holds each vehicle's position block; the trace of that block is the vehicle's window bound,
squared.
"""

import casadi as ca

from syncplan.refinement.problem import RefineProblem

RELATIVE_SHIFT = 1e-9
"""Added to W's diagonal, in information units: a team that is not observable yet has log det W."""

_WORST_POWER = 20.0
"""Exponent of the norm over vehicles' variances that stands for the largest."""


def log_determinant(sparsity: ca.Sparsity) -> ca.Function:
    """Return the function (non-zeros of W, shift) -> log det (W + shift I)."""
    entries, shift = ca.SX.sym("W", sparsity.nnz()), ca.SX.sym("shift")
    matrix = ca.SX(sparsity, entries)
    pivots, _, _ = ca.ldl(matrix + shift * ca.SX.eye(sparsity.size1()), True)
    return ca.Function("log_determinant", [entries, shift], [ca.sum1(ca.log(pivots))])


def window_variances(sparsity: ca.Sparsity, problem: RefineProblem) -> ca.Function:
    """Return the function (non-zeros of W) -> (n,) squares of the window bounds, scaled."""
    shift = RELATIVE_SHIFT * problem.information_unit
    entries = ca.SX.sym("W", sparsity.nnz())
    matrix = ca.SX(sparsity, entries)
    pivots, _, _ = ca.ldl(matrix + shift * ca.SX.eye(sparsity.size1()), True)
    slope = ca.gradient(ca.sum1(ca.log(pivots)), entries)
    place = {one: k for k, one in enumerate(zip(*sparsity.get_triplet(), strict=True))}
    variances = [
        slope[place[3 * k, 3 * k]] + slope[place[3 * k + 1, 3 * k + 1]]
        for k in range(sparsity.size1() // 3)
    ]
    return ca.Function("window_variances", [entries], [ca.vertcat(*variances)])


def window_excess(sparsity: ca.Sparsity, information: ca.MX, problem: RefineProblem) -> ca.MX:
    """Return the logarithm of the worst vehicle's window bound over its limit; at most 0 is met.

    The worst is a norm over the vehicles, so never less than the true worst.
    """
    entries = ca.SX.sym("W", sparsity.nnz())
    limit = (problem.window_limit / problem.scale) ** 2
    ratio = ca.log(window_variances(sparsity, problem)(entries) / limit)
    excess = ca.logsumexp(_WORST_POWER * ratio) / (2.0 * _WORST_POWER)
    return ca.Function("window_excess", [entries], [excess])(information)
