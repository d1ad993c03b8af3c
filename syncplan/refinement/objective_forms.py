"""How each objective is computed: exactly, of a plan, and smoothly, for IPOPT.

What an objective is called and needs stands in syncplan.scenario.objectives. Smooth forms are
minimised and free of scale, so that one solver tolerance serves all; W is the windowed information
of n vehicles:

    logdet            -(log det W) / 3n
    trace             -log tr W
    min_eigenvalue    -log t - mu (log det (W - t I)) / 3n, with log t a variable: as mu falls, t
                      approaches the smallest eigenvalue from below (the barrier of the linear
                      matrix inequality W >= t I: Nesterov and Nemirovskii, Interior-Point
                      Polynomial Algorithms in Convex Programming, 1994, chapter 5)
    predicted_rms     log of the posterior bound's RMS, see syncplan.refinement.smooth_bound
    worst_predicted_rms   log of a norm over the vehicles' RMS that is never below the largest
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.error_states import layout_of
from syncplan.refinement.problem import RefineProblem
from syncplan.refinement.smooth_bound import coarse_run, smooth_rms
from syncplan.refinement.smooth_determinants import RELATIVE_SHIFT, log_determinant
from syncplan.refinement.smooth_team import SmoothTeam
from syncplan.refinement.smooth_wide_bound import smooth_wide_rms
from syncplan.refinement.stages import Stage, step_width


@dataclass(frozen=True, slots=True)
class MeasuredTeam:
    """What exact measures are made of.

    Attributes
    ----------
    observable : whether the plan is, judged in its own mean radius
    eigenvalues : (3 n,) of the windowed information, largest first, positions in the mean radius
        of the plan that is refined
    window_bounds : (n,) m, from one window without motion noise; infinite where not observable
    rms : (n,) m, posterior bound over the second half of the run; NaN where not computed
    """

    observable: bool
    eigenvalues: Array
    window_bounds: Array
    rms: Array


@dataclass(frozen=True, slots=True)
class SmoothInputs:
    """What smooth forms are made of.

    Attributes
    ----------
    circles : (4, n), scaled
    information : the windowed information's non-zeros, of `team.sparsity`
    """

    problem: RefineProblem
    stage: Stage
    team: SmoothTeam
    circles: ca.MX
    information: ca.MX


@dataclass(frozen=True, slots=True)
class SmoothObjective:
    """What IPOPT minimises.

    Attributes
    ----------
    value : expression
    gradient : (4, n) by the circles, where it is written out rather than left to CasADi; or None
    extra : a variable without bounds beside those of the circles, or None
    extra_start : its value to start from, of the information (3 n, 3 n) there
    """

    value: ca.MX
    gradient: ca.MX | None = None
    extra: ca.MX | None = None
    extra_start: Callable[[Array], float] | None = None


@dataclass(frozen=True, slots=True)
class ObjectiveForm:
    """How one objective is computed.

    Attributes
    ----------
    exact : the figure of merit itself
    smooth : what IPOPT minimises instead
    in_units : of a problem and a smooth value, the figure that it stands for
    """

    exact: Callable[[MeasuredTeam], float]
    smooth: Callable[[SmoothInputs], SmoothObjective]
    in_units: Callable[[RefineProblem, float], float]


# --- measures of the windowed information ---------------------------------------------------------


def _logdet(given: SmoothInputs) -> SmoothObjective:
    size = given.team.sparsity.size1()
    shift = RELATIVE_SHIFT * given.problem.information_unit
    return SmoothObjective(-log_determinant(given.team.sparsity)(given.information, shift) / size)


_INSIDE = 0.7
"""Share of the smallest eigenvalue at which the variable below it starts."""


def _min_eigenvalue(given: SmoothInputs) -> SmoothObjective:
    problem, sparsity = given.problem, given.team.sparsity
    unit = problem.information_unit
    below = ca.MX.sym("log_t")
    least = ca.exp(below) * unit
    inside = log_determinant(sparsity)(given.information, RELATIVE_SHIFT * unit - least)

    def start(information: Array) -> float:
        smallest = np.linalg.eigvalsh(information)[0]
        share = max(smallest / unit + RELATIVE_SHIFT, 0.5 * RELATIVE_SHIFT)
        return float(np.log(_INSIDE * share))

    value = -below - given.stage.barrier * inside / sparsity.size1()
    return SmoothObjective(value, extra=below, extra_start=start)


def _trace(given: SmoothInputs) -> SmoothObjective:
    diagonal = ca.diag(ca.MX(given.team.sparsity, given.information))
    return SmoothObjective(-ca.log(ca.sum1(diagonal)))


# --- predicted errors -----------------------------------------------------------------------------


def _predicted_rms(given: SmoothInputs) -> SmoothObjective:
    return _of_vehicles(given, lambda rms: 0.5 * ca.log(ca.sumsqr(rms) / rms.numel()))


_WORST_POWER = 16.0
"""Exponent of the norm over vehicles that stands for the worst predicted RMS."""


def _worst_predicted_rms(given: SmoothInputs) -> SmoothObjective:
    return _of_vehicles(given, lambda rms: ca.logsumexp(_WORST_POWER * ca.log(rms)) / _WORST_POWER)


def _of_vehicles(given: SmoothInputs, cost: Callable[[ca.MX], ca.MX]) -> SmoothObjective:
    """The cost of the vehicles' RMS errors (n,)."""
    problem = given.problem
    run = coarse_run(problem)
    seen = SmoothTeam.of(problem, run.times)
    width = max(given.stage.width, step_width(problem, run.times))
    if not layout_of(problem.team).names:
        each = seen.information(given.circles, width, each=True)
        return SmoothObjective(cost(smooth_rms(problem, run, seen.sparsity, each, given.circles)))
    rms = smooth_wide_rms(problem, run, seen, given.circles, width)
    one = ca.MX.sym("rms", problem.orbits.count)
    weights = ca.Function("weights", [one], [ca.gradient(cost(one), one)])
    return SmoothObjective(cost(rms.value), rms.slopes(weights(rms.value)))


_LARGEST_EXPONENT = 700.0
"""Of an exponential that a float can hold."""


def _exponential(value: float) -> float:
    return math.exp(min(value, _LARGEST_EXPONENT))


# --- all of them ----------------------------------------------------------------------------------

FORMS: dict[str, ObjectiveForm] = {
    "predicted_rms": ObjectiveForm(
        exact=lambda team: float(np.sqrt(np.mean(team.rms**2))),
        smooth=_predicted_rms,
        in_units=lambda problem, value: _exponential(value) * problem.scale,
    ),
    "worst_predicted_rms": ObjectiveForm(
        exact=lambda team: float(team.rms.max()),
        smooth=_worst_predicted_rms,
        in_units=lambda problem, value: _exponential(value) * problem.scale,
    ),
    "logdet": ObjectiveForm(
        exact=lambda team: (
            float(np.sum(np.log(team.eigenvalues))) if team.observable else -math.inf
        ),
        smooth=_logdet,
        in_units=lambda problem, value: -value * 3 * problem.orbits.count,
    ),
    "min_eigenvalue": ObjectiveForm(
        exact=lambda team: float(team.eigenvalues[-1]) if team.observable else 0.0,
        smooth=_min_eigenvalue,
        in_units=lambda problem, value: _exponential(-value) * problem.information_unit,
    ),
    "trace": ObjectiveForm(
        exact=lambda team: float(team.eigenvalues.sum()),
        smooth=_trace,
        in_units=lambda _, value: _exponential(-value),
    ),
}
"""The form of each objective of syncplan.scenario.objectives, by its name."""
