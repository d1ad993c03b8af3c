"""The record of a refinement: what was asked, what each start came to, before and after."""

from dataclasses import dataclass

from syncplan.planning.figures_of_merit import Figures
from syncplan.scenario.refine_options import RefineOptions

__all__ = ["RefinementRecord", "StartRecord"]


@dataclass(frozen=True, slots=True)
class StartRecord:
    """What one start of the solver came to.

    Attributes
    ----------
    start : number, from 0: the plan itself, the rule desynchronised, random ones; then the same
        again where the window bound had to be made a limit
    status : IPOPT's
    iterations : in all stages
    violation, dual_residual : IPOPT's own residuals at the end, of scaled constraints
    value : the exact objective of its best candidate; None where there was none
    violations : constraints that the plan met and the candidate does not
    unmet : constraints the solver could not meet
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
    """Evidence of a refinement.

    Attributes
    ----------
    options : as used
    objective : what was improved
    improved : whether the plan that came back is a better one; if not, it is the input
    reason : why the input came back; empty where a better plan did
    cut_short : whether time or Ctrl-C did
    before, after : exact figures of merit, positions in the input's mean radius
    active : constraints that hold the result where it is
    starts : in order
    """

    options: RefineOptions
    objective: str
    improved: bool
    reason: str
    cut_short: bool
    before: Figures
    after: Figures
    active: tuple[str, ...]
    starts: tuple[StartRecord, ...]
