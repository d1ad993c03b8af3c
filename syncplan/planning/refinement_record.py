"""The record of a refinement: options, the result of each start, figures before and after."""

from dataclasses import dataclass

from pydantic import Field

from syncplan.documents import DocumentPart, Words
from syncplan.planning.start_up import InputStart
from syncplan.scenario.models import RefineOptions
from syncplan.scenario.objectives import Figures


class StartResult(DocumentPart):
    """The result of one start of the solver."""

    start: int = Field(description="0: the plan; 1: the rules desynchronised; then random ones")
    status: Words = Field(description="IPOPT's return status")
    iterations: int
    constraint_violation: float | None = Field(description="At the end, as IPOPT scales it")
    dual_infeasibility: float | None = Field(description="At the end, as IPOPT scales it")
    value: float | None = Field(description="Exact objective of the best candidate")
    violations: list[Words] = Field(
        description="Constraints that the input met and the candidate violates"
    )
    unmet: list[Words] = Field(description="Constraints that the solver could not meet")


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
    starts: tuple[StartResult, ...]
    start_before: InputStart | None = None
    expected_before: float | None = None
    cleared: bool = False
