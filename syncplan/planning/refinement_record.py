"""The record of a refinement: options, the result of each start, figures before and after."""

from dataclasses import dataclass

from syncplan.planning.start_up import StartBefore
from syncplan.scenario.models import RefineOptions
from syncplan.scenario.objectives import Figures


@dataclass(frozen=True, slots=True)
class StartRecord:
    """The result of one start of the solver.

    Attributes
    ----------
    start : number, from 0: the plan itself, the rules desynchronised, random ones; then the same
        again where the window bound had to become a constraint
    status : IPOPT's
    iterations : in all stages
    violation, dual_residual : IPOPT's own residuals at the end, of scaled constraints
    value : the exact objective of its best candidate; None if it had none
    violations : constraints that the plan met and the candidate does not
    unmet : constraints that the solver could not meet
    """

    start: int
    status: str
    iterations: int
    violation: float
    dual_residual: float
    value: float | None
    violations: tuple[str, ...]
    unmet: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RefinementRecord:
    """How a plan was refined.

    Attributes
    ----------
    options : as used; None for a plan read from a file
    objective : name of the figure that was improved
    improved : whether the plan is better than the input; if not, it is the input
    reason : why nothing better was found; empty if it was
    cut_short : whether the time limit or Ctrl-C ended the search
    before, after : exact figures of merit, positions in the input's mean radius
    active : constraints that the result meets with hardly any margin
    starts : in order
    start_before : how the input starts; None where that was not judged
    expected_before : m, RMS error of all vehicles to be expected of the input, where its filter
        leaves out errors; None where it leaves out none or no bound is computed
    cleared : whether the result keeps distances that the input did not, whatever its figures
    """

    options: RefineOptions | None
    objective: str
    improved: bool
    reason: str
    cut_short: bool
    before: Figures
    after: Figures
    active: tuple[str, ...]
    starts: tuple[StartRecord, ...]
    start_before: StartBefore | None = None
    expected_before: float | None = None
    cleared: bool = False
