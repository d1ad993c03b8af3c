"""The JSON contract of verdicts: in plans, in reports and in the sidecars of exports."""

from typing import Literal

from pydantic import Field

from syncplan.documents import DocumentPart
from syncplan.planning.judged_team import Verdict, headline_of


class FindingCure(DocumentPart):
    """What would remedy a finding."""

    text: str
    change: dict[str, float | str] = Field(
        description="Keys of the scenario, dotted, with the values that cure it; empty where a "
        "person has to choose"
    )


class PlanFinding(DocumentPart):
    """One thing that speaks against flying the plan, or has to be known of it."""

    code: str = Field(
        description="Stable word by which software knows the finding", examples=["unobservable"]
    )
    level: Literal["stop", "warning", "note"]
    message: str
    subjects: list[str] = Field(description="Names of the vehicles and landmarks concerned")
    cure: FindingCure | None


class PlanVerdict(DocumentPart):
    """Whether the plan can be flown: go is false exactly where a finding is a stop."""

    go: bool
    findings: list[PlanFinding]

    @property
    def stops(self) -> list[PlanFinding]:
        """The findings that stop the flight."""
        return [one for one in self.findings if one.level == "stop"]

    @property
    def headline(self) -> str:
        """GO, or NO-GO with the number of reasons."""
        return headline_of(len(self.stops))


def plan_verdict(verdict: Verdict) -> PlanVerdict:
    """Return a verdict as documents hold it."""
    return PlanVerdict(
        go=verdict.go,
        findings=[
            PlanFinding(
                code=one.code,
                level=one.level,
                message=one.message,
                subjects=list(one.subjects),
                cure=None
                if one.cure is None
                else FindingCure(text=one.cure.text, change=dict(one.cure.change)),
            )
            for one in verdict.findings
        ],
    )
