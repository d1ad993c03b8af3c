"""The JSON contract of refinements: part of a plan's document."""

from pydantic import Field

from syncplan.reports.document_base import DocumentPart

__all__ = ["FiguresOfMerit", "RefinementResult", "StartResult"]


class FiguresOfMerit(DocumentPart):
    """What a plan is measured by; positions in the mean radius of the plan that was refined."""

    rank: int
    certified: bool
    logdet: float | None = Field(description="Of the windowed information; null if unobservable")
    min_eigenvalue: float
    trace: float
    window_bound_m: float | None = Field(description="Of the worst vehicle; null if unobservable")
    predicted_rms_m: float | None = Field(description="Of all vehicles, over the second half")
    worst_predicted_rms_m: float | None = Field(description="Of the worst vehicle")
    least_distance_m: float | None = Field(description="The closest two vehicles come")
    contact_margin_m: float | None = Field(
        description="By how much the link or landmark nearest to being lost stays within range"
    )


class StartResult(DocumentPart):
    """What one start of the solver came to."""

    start: int = Field(description="0 the plan, 1 the rules desynchronised, then random ones")
    status: str = Field(description="IPOPT's")
    iterations: int
    constraint_violation: float | None = Field(description="IPOPT's, scaled")
    dual_infeasibility: float | None = Field(description="IPOPT's, scaled")
    value: float | None = Field(description="Exact objective of the best candidate")
    violations: list[str] = Field(description="What the input met and the candidate does not")
    unmet: list[str] = Field(description="What the solver could not meet")


class RefinementResult(DocumentPart):
    """How a plan was refined; `improved` says whether this is a better plan or the input."""

    objective: str
    improved: bool
    reason: str
    cut_short: bool = Field(description="Whether time or an interrupt ended the search early")
    before: FiguresOfMerit
    after: FiguresOfMerit
    active_constraints: list[str]
    starts: list[StartResult]
