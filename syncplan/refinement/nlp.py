"""Nonlinear program of one stage: variables, objective and constraints for IPOPT."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from syncplan.arrays import Array, Index
from syncplan.refinement.constraints import constraints_of, side_count, sides_of
from syncplan.refinement.problem import WINDOW_BOUND, RefineProblem, Stage, samples_in, step_width
from syncplan.refinement.smooth_bound import coarse_run, smooth_rms
from syncplan.refinement.smooth_team import (
    RELATIVE_SHIFT,
    SmoothTeam,
    log_determinant,
    window_excess,
)

# --- objectives -----------------------------------------------------------------------------------
#
# syncplan.scenario.objectives states the name and needs of each objective. Smooth forms are
# minimised and scale-free, so that one solver tolerance suits all; W is the windowed information
# of n vehicles:
#
#     logdet            -(log det W) / 3n
#     trace             -log tr W
#     min_eigenvalue    -log t - mu (log det (W - t I)) / 3n, with log t a variable: as mu falls, t
#                       approaches the smallest eigenvalue from below (the barrier of the linear
#                       matrix inequality W >= t I: Nesterov and Nemirovskii, Interior-Point
#                       Polynomial Algorithms in Convex Programming, 1994, chapter 5)
#     predicted_rms     log of the posterior bound's RMS, see syncplan.refinement.smooth_bound
#     worst_predicted_rms   log of a norm over the vehicles' RMS that is never below the largest


@dataclass(frozen=True, slots=True)
class MeasuredTeam:
    """Inputs of exact measures.

    Attributes
    ----------
    observable : whether the plan is observable, judged in its own mean radius
    eigenvalues : (3 n,) of the windowed information, largest first, positions in the mean radius
        of the plan that is refined
    rms : (n,) m, posterior bound over the second half of the run; NaN where not computed
    """

    observable: bool
    eigenvalues: Array
    rms: Array


@dataclass(frozen=True, slots=True)
class SmoothInputs:
    """Inputs of smooth forms.

    Attributes
    ----------
    circles : (4, n), scaled
    information : non-zeros of the windowed information, with `team.sparsity`
    """

    problem: RefineProblem
    stage: Stage
    team: SmoothTeam
    circles: ca.MX
    information: ca.MX


@dataclass(frozen=True, slots=True)
class SmoothObjective:
    """Objective that IPOPT minimises.

    Attributes
    ----------
    value : expression
    gradient : (4, n) with respect to the circles, where it is written out; None leaves it to CasADi
    extra : further variable, without bounds; or None
    extra_start : function from the information (3 n, 3 n) at the start to its initial value
    """

    value: ca.MX
    gradient: ca.MX | None = None
    extra: ca.MX | None = None
    extra_start: Callable[[Array], float] | None = None


@dataclass(frozen=True, slots=True)
class ObjectiveForm:
    """Exact and smooth form of one objective.

    Attributes
    ----------
    exact : the figure of merit itself
    smooth : objective that IPOPT minimises instead
    in_units : function from a problem and a smooth value to the figure that it stands for
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
    """Objective from a cost of the vehicles' RMS errors (n,)."""
    problem = given.problem
    run = coarse_run(problem)
    seen = SmoothTeam.of(problem, run.times)
    width = max(given.stage.width, step_width(problem, run.times))
    rms = smooth_rms(problem, run, seen, given.circles, width)
    one = ca.MX.sym("rms", problem.orbits.count)
    weights = ca.Function("weights", [one], [ca.gradient(cost(one), one)])
    return SmoothObjective(cost(rms.value), rms.slopes(weights(rms.value)))


_LARGEST_EXPONENT = 700.0
"""Largest exponent: a float can hold its exponential."""


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


# --- the program of a stage -----------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class StageNlp:
    """One stage's nonlinear program, in scaled variables.

    Attributes
    ----------
    problem : refinement problem that it belongs to
    variables : expression; the free values of the circles, then the objective's own variable
    sides : expression; sides of landmarks and keep-outs, as `sides_of` returns them
    objective : objective to be minimised, with its own variable
    constraints : expression
    jacobian : function (x, p) -> (constraints, their sparse Jacobian)
    gradient : function (x, p) -> (objective, its gradient), where the objective has one; or None
    values : function (x, p) -> (objective, constraints)
    information : function of the circles' variables -> the windowed information (3 n, 3 n), where
        the initial value of the objective's own variable needs it
    lower, upper, constraint_lower : bounds; constraints have no upper ones
    labels : name of each constraint
    """

    problem: RefineProblem
    variables: ca.MX
    sides: ca.MX
    objective: SmoothObjective
    constraints: ca.MX
    jacobian: ca.Function
    gradient: ca.Function | None
    values: ca.Function
    information: ca.Function | None
    lower: Array
    upper: Array
    constraint_lower: Array
    labels: tuple[str, ...]

    @property
    def size(self) -> int:
        """Number of variables."""
        return len(self.lower)

    def as_dictionary(self) -> dict[str, Any]:
        """Return the dictionary that `casadi.nlpsol` takes."""
        return {
            "x": self.variables,
            "p": self.sides,
            "f": self.objective.value,
            "g": self.constraints,
        }

    def variables_of(self, circles: Array) -> Array:
        """Return the variables at circles (4, n) in m and rad, clipped to their bounds."""
        free = self.problem.freedom.free.ravel(order="F")
        scaled = (circles / _units(self.problem)).ravel(order="F")[free]
        variables = np.clip(scaled, self.lower[: len(scaled)], self.upper[: len(scaled)])
        if self.information is None or self.objective.extra_start is None:
            return variables
        information = np.array(ca.DM(self.information(variables)))
        return np.append(variables, self.objective.extra_start(information))

    def circles_of(self, variables: Array) -> Array:
        """Return the circles (4, n) in m and rad."""
        freedom = self.problem.freedom
        flat = np.where(freedom.free, 0.0, freedom.lower).ravel(order="F")
        free = freedom.free.ravel(order="F")
        flat[free] = variables[: int(free.sum())]
        circles = flat.reshape(4, -1, order="F")
        moved = circles * np.where(freedom.free, _units(self.problem), 1.0)
        return np.asarray(np.clip(moved, freedom.lower, freedom.upper))

    def excess(self, constraints: Array) -> Array:
        """Return how far each constraint's value lies outside its bounds."""
        return np.asarray(np.maximum(self.constraint_lower - constraints, 0.0))

    def sides_of(self, circles: Array) -> Array:
        """Return the sides of circles (4, n) in m and rad on which landmarks and keep-outs lie."""
        return sides_of(self.problem, circles)

    def violations(self, variables: Array, sides: Array) -> Array:
        """Return how far each constraint is violated."""
        return self.excess(np.array(self.values(variables, sides)[1]).ravel())


def nlp_of(problem: RefineProblem, stage: Stage) -> StageNlp:
    """Return the nonlinear program of a stage."""
    # variables
    free = np.flatnonzero(problem.freedom.free.ravel(order="F"))
    chosen = ca.MX.sym("x", len(free))
    circles = _circles(problem, chosen, free)
    # objective
    team = SmoothTeam.of(problem, samples_in(problem, problem.window, stage.samples))
    information = team.information(circles, stage.width)
    smooth = FORMS[problem.objective.name].smooth
    objective = smooth(SmoothInputs(problem, stage, team, circles, information))
    variables = chosen if objective.extra is None else ca.vertcat(chosen, objective.extra)
    # constraints
    sides = ca.MX.sym("p", side_count(problem))
    limits = constraints_of(problem, stage, circles, sides)
    constraints, jacobian, labels = limits.values, limits.jacobian[:, free.tolist()], limits.labels
    if np.isfinite(problem.window_limit):
        excess = window_excess(team.sparsity, information, problem)
        constraints = ca.vertcat(constraints, -excess)
        jacobian = ca.vertcat(jacobian, -ca.jacobian(excess, chosen))
        labels = (*labels, WINDOW_BOUND)
    extra = variables.numel() - chosen.numel()
    jacobian = ca.horzcat(jacobian, ca.MX(constraints.numel(), extra))
    lower, upper = _bounds(problem, free, extra)
    return StageNlp(
        problem=problem,
        variables=variables,
        sides=sides,
        objective=objective,
        constraints=constraints,
        jacobian=ca.Function(
            "jac_g", [variables, sides], [constraints, jacobian], ["x", "p"], ["g", "jac_g_x"]
        ),
        gradient=_gradient(objective, circles, variables, chosen, sides),
        values=ca.Function("values", [variables, sides], [objective.value, constraints]),
        information=None
        if objective.extra is None
        else ca.Function("information", [chosen], [ca.MX(team.sparsity, information)]),
        lower=lower,
        upper=upper,
        constraint_lower=np.append(limits.lower, np.zeros(len(labels) - len(limits.lower))),
        labels=labels,
    )


def _gradient(
    objective: SmoothObjective, circles: ca.MX, variables: ca.MX, chosen: ca.MX, sides: ca.MX
) -> ca.Function | None:
    if objective.gradient is None:
        return None
    gradient = ca.jtimes(circles, chosen, objective.gradient, True)
    return ca.Function(
        "grad_f", [variables, sides], [objective.value, gradient], ["x", "p"], ["f", "grad_f_x"]
    )


def _units(problem: RefineProblem) -> Array:
    """Units (4, 1) of the variables."""
    scale = problem.scale
    return np.array([[scale], [scale], [scale], [1.0]])


def _bounds(problem: RefineProblem, free: Index, extra: int) -> tuple[Array, Array]:
    """Least and largest value of each variable; the `extra` ones at the end have no bounds."""
    freedom, units = problem.freedom, _units(problem)
    lower, upper = (
        np.append((limit / units).ravel(order="F")[free], np.full(extra, far))
        for limit, far in ((freedom.lower, -np.inf), (freedom.upper, np.inf))
    )
    return lower, upper


def _circles(problem: RefineProblem, chosen: ca.MX, free: Index) -> ca.MX:
    """Scaled circles (4, n), with the free values taken from `chosen`."""
    freedom = problem.freedom
    fixed = np.where(freedom.free, 0.0, freedom.lower / _units(problem)).ravel(order="F")
    spread = ca.DM.triplet(
        free.tolist(), list(range(len(free))), ca.DM.ones(len(free)), len(fixed), len(free)
    )
    return ca.reshape(ca.DM(fixed) + spread @ chosen, 4, problem.orbits.count)
