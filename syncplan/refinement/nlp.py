"""The nonlinear program of one stage: variables, objective, constraints, as IPOPT takes them."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from syncplan.arrays import Array, Index
from syncplan.refinement.clearances import area_clearances, separations
from syncplan.refinement.constraint_blocks import Blocks, stacked_blocks
from syncplan.refinement.problem import RefineProblem
from syncplan.refinement.sample_times import SampleTimes, samples_of
from syncplan.refinement.smooth_bound import coarse_run, smooth_rms
from syncplan.refinement.smooth_objectives import log_determinant, window_excess
from syncplan.refinement.smooth_team import SmoothTeam

__all__ = ["CONTACT_SAMPLES", "Program", "Stage", "program_of", "stages_of"]


_LEAST_WIDTH, _LARGEST_WIDTH = 0.002, 0.05
_STEP_OF_SPACING = 0.25
_CONTACT_WIDTH = 0.25
"""Contact's step is narrower than that of information by this factor."""

_SAFETY_WIDTHS = 3.0
"""Steps of contact by which kept links stay inside their margin in the last stage."""

_FEW, _MANY = 64, 400
CONTACT_SAMPLES = 96
"""Contact asks for few samples, and where the distance is least it hardly changes between them."""

_SHIFT = 1e-9
"""Added to the information, relative to its mean diagonal: a team that is not observable yet."""

_WORST_POWER = 16.0
"""Exponent of the norm over vehicles that stands for the worst predicted RMS."""

_INSIDE = 0.7
"""Share of the smallest eigenvalue at which the variable below it starts."""


@dataclass(frozen=True, slots=True)
class Stage:
    """How one stage looks at the problem.

    Attributes
    ----------
    samples : most samples of a window that are told apart
    width : of the step between seen and unseen, as a share of the range
    barrier : weight of the barrier of min_eigenvalue
    iterations : most that IPOPT may take
    tolerance : at which IPOPT calls it solved
    last : whether contact is to hold with some safety
    """

    samples: int
    width: float
    barrier: float
    iterations: int
    tolerance: float
    last: bool


@dataclass(frozen=True, slots=True)
class Program:
    """One stage's nonlinear program, in scaled variables.

    Attributes
    ----------
    problem : what it was made of
    variables, objective, constraints : expressions
    jacobian : function (x, p) -> (constraints, their sparse Jacobian)
    values : function x -> (objective, constraints)
    lower, upper, constraint_lower, constraint_upper : bounds
    labels : what each constraint is
    smallest : function x -> information, for the start of min_eigenvalue's extra variable
    """

    problem: RefineProblem
    variables: ca.MX
    objective: ca.MX
    constraints: ca.MX
    jacobian: ca.Function
    values: ca.Function
    lower: Array
    upper: Array
    constraint_lower: Array
    constraint_upper: Array
    labels: tuple[str, ...]
    information: ca.Function | None

    @property
    def size(self) -> int:
        """Number of variables."""
        return len(self.lower)

    def as_dictionary(self) -> dict[str, Any]:
        """Return what `casadi.nlpsol` takes."""
        return {"x": self.variables, "f": self.objective, "g": self.constraints}

    def variables_of(self, circles: Array) -> Array:
        """Return the variables at circles (4, n) in m and rad, brought within their bounds."""
        free = self.problem.freedom.free.ravel(order="F")
        scaled = (circles / _units(self.problem)).ravel(order="F")[free]
        variables = np.clip(scaled, self.lower[: len(scaled)], self.upper[: len(scaled)])
        if self.information is None:
            return variables
        smallest = np.linalg.eigvalsh(np.array(ca.DM(self.information(variables))))[0]
        share = max(smallest / _spread(self.problem) + _SHIFT, 0.5 * _SHIFT)
        return np.append(variables, np.log(_INSIDE * share))

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
        below, above = self.constraint_lower - constraints, constraints - self.constraint_upper
        return np.asarray(np.maximum(np.maximum(below, above), 0.0))

    def violations(self, variables: Array) -> Array:
        """Return how far each constraint is violated."""
        return self.excess(np.array(self.values(variables)[1]).ravel())


def stages_of(problem: RefineProblem) -> tuple[Stage, ...]:
    """Return soft, sharper, nearly hard: the last step as wide as what passes between samples."""
    most = int(np.clip(12_000 // max(problem.orbits.count, 1), 2 * _FEW, _MANY))
    times = _times(problem, problem.window, most)
    passed = 2.0 * problem.orbits.radii.max() * times.spacing
    share = _STEP_OF_SPACING * passed / problem.sensors.ranges.max()
    last = float(np.clip(share, _LEAST_WIDTH, _LARGEST_WIDTH))
    return (
        Stage(_FEW, 0.1, 0.3, 60, 1e-3, False),
        Stage(_FEW, max(0.04, last), 0.05, 60, 1e-3, False),
        Stage(most, last, 0.01, 150, 1e-4, True),
    )


def _times(problem: RefineProblem, span: float, most: int) -> SampleTimes:
    """Samples in `span` s, at most `most` of them told apart."""
    return samples_of(span, problem.sensors.sample_time, problem.orbits.rate, most)


def program_of(problem: RefineProblem, stage: Stage) -> Program:
    """Return the nonlinear program of a stage."""
    freedom, units = problem.freedom, _units(problem)
    free = np.flatnonzero(freedom.free.ravel(order="F"))
    chosen = ca.MX.sym("x", len(free))
    circles = _circles(problem, chosen, free)
    team = SmoothTeam.of(problem, _times(problem, problem.window, stage.samples))
    information = team.information(circles, stage.width)
    variables, objective, told = _objective(problem, stage, team, information, circles, chosen)
    blocks = _constraints(problem, stage, team, circles)
    values, jacobian = blocks.values, blocks.jacobian[:, free.tolist()]
    upper, labels = np.full(len(blocks.lower), np.inf), blocks.labels
    if np.isfinite(problem.window_limit):
        excess = window_excess(team.sparsity, information, _SHIFT * _spread(problem), problem)
        values = ca.vertcat(values, -excess)
        jacobian = ca.vertcat(jacobian, -ca.jacobian(excess, chosen))
        upper, labels = np.append(upper, np.inf), (*labels, "window bound of the worst vehicle")
    lower = np.append(blocks.lower, np.zeros(len(upper) - len(blocks.lower)))
    extra = variables.numel() - chosen.numel()
    jacobian = ca.horzcat(jacobian, ca.MX(values.numel(), extra))
    bounds = [
        np.append((limit / units).ravel(order="F")[free], np.full(extra, far))
        for limit, far in ((freedom.lower, -np.inf), (freedom.upper, np.inf))
    ]
    parameters = ca.MX.sym("p", 0, 1)
    return Program(
        problem=problem,
        variables=variables,
        objective=objective,
        constraints=values,
        jacobian=ca.Function(
            "jac_g", [variables, parameters], [values, jacobian], ["x", "p"], ["g", "jac_g_x"]
        ),
        values=ca.Function("values", [variables], [objective, values]),
        lower=bounds[0],
        upper=bounds[1],
        constraint_lower=lower,
        constraint_upper=upper,
        labels=labels,
        information=ca.Function("information", [chosen], [ca.MX(team.sparsity, information)])
        if told
        else None,
    )


def _units(problem: RefineProblem) -> Array:
    """(4, 1) what the variables are measured in."""
    scale = problem.scale
    return np.array([[scale], [scale], [scale], [1.0]])


def _circles(problem: RefineProblem, chosen: ca.MX, free: Index) -> ca.MX:
    """Scaled circles (4, n), those values that may change taken from `chosen`."""
    freedom = problem.freedom
    fixed = np.where(freedom.free, 0.0, freedom.lower / _units(problem)).ravel(order="F")
    spread = ca.DM.triplet(
        free.tolist(), list(range(len(free))), ca.DM.ones(len(free)), len(fixed), len(free)
    )
    return ca.reshape(ca.DM(fixed) + spread @ chosen, 4, problem.orbits.count)


def _spread(problem: RefineProblem) -> float:
    """A typical entry of the information: what min_eigenvalue's variable is measured in."""
    return float(np.mean(1.0 / problem.sensors.bearing_sigmas**2))


def _objective(
    problem: RefineProblem,
    stage: Stage,
    team: SmoothTeam,
    information: ca.MX,
    circles: ca.MX,
    chosen: ca.MX,
) -> tuple[ca.MX, ca.MX, bool]:
    """Variables, objective, and whether a variable below the smallest eigenvalue was added."""
    size = team.sparsity.size1()
    shift = _SHIFT * _spread(problem)
    if problem.objective == "trace":
        diagonal = ca.diag(ca.MX(team.sparsity, information))
        return chosen, -ca.log(ca.sum1(diagonal)), False
    if problem.objective == "min_eigenvalue":
        below = ca.MX.sym("log_t")
        least = ca.exp(below) * _spread(problem)
        inside = log_determinant(team.sparsity)(information, shift - least)
        return ca.vertcat(chosen, below), -below - stage.barrier * inside / size, True
    if problem.objective == "logdet":
        return chosen, -log_determinant(team.sparsity)(information, shift) / size, False
    run = coarse_run(problem)
    seen = SmoothTeam.of(problem, run.times)
    width = max(stage.width, _coarse_width(problem, run.times.spacing))
    each = seen.information(circles, width, each=True)
    rms = smooth_rms(problem, run, seen.sparsity, each, circles)
    if problem.objective == "predicted_rms":
        return chosen, 0.5 * ca.log(ca.sumsqr(rms) / rms.numel()), False
    norm = ca.logsumexp(_WORST_POWER * ca.log(rms)) / _WORST_POWER
    return chosen, norm, False


def _coarse_width(problem: RefineProblem, spacing: float) -> float:
    """Step as wide as what passes between samples `spacing` rad apart."""
    passed = 2.0 * problem.orbits.radii.max() * spacing
    return float(min(_STEP_OF_SPACING * passed / problem.sensors.ranges.max(), _LARGEST_WIDTH))


def _constraints(problem: RefineProblem, stage: Stage, team: SmoothTeam, circles: ca.MX) -> Blocks:
    """Contacts kept, separation, areas."""
    width = _CONTACT_WIDTH * stage.width
    safety = _SAFETY_WIDTHS * width * float(problem.sensors.ranges.mean())
    times = _times(problem, problem.contact_span, min(stage.samples, CONTACT_SAMPLES))
    contacts = team.contacts(circles, times, width, safety if stage.last else 0.0)
    limits = [contacts, separations(problem, circles), area_clearances(problem, circles)]
    return stacked_blocks(limits, problem.orbits.count)
