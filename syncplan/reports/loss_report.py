"""Effects of losses on a plan, as a document."""

from pydantic import Field

from syncplan import __version__
from syncplan.documents import Document, OrAbsent, VersionedDocument
from syncplan.planning.judged_team import PlanVerdict
from syncplan.planning.loss_study import LossOutcome, WhatIf
from syncplan.reports.observability_report import (
    ErrorPrediction,
    ExtendedRank,
    Unobservable,
    error_prediction,
    extended_rank_record,
    unobservable_motions,
)


class RemainingTeam(Document):
    """The team that a loss leaves, judged again on the same orbits."""

    lost: list[str] = Field(
        description="Names of what is lost: vehicles, landmarks, and sensors as sensor:v3, whose "
        "vehicles fly on, or as compass:v3 and distance:v3, of one kind of sighting; empty for the "
        "whole team",
        examples=[["sensor:v3"]],
    )
    rank: int
    state_dim: int
    observable: bool
    unobservable: list[Unobservable]
    extended: OrAbsent[ExtendedRank] = Field(
        default=None,
        description="Rank with errors as states; absent where the filter estimates none that are "
        "constant, or where there are more than 400 states",
    )
    predicted_rms_m: ErrorPrediction = Field(
        description="Of a run without what is lost, from its start"
    )
    worst_predicted_rms_m: float | None = Field(
        description="Of the vehicle worst off; null where not computed"
    )
    verdict: PlanVerdict = Field(description="On flying without what is lost")


class WhatIfDocument(VersionedDocument):
    """Effects of losses of vehicles, sensors and landmarks on a plan."""

    name: str = Field(description="Of the scenario")
    baseline: RemainingTeam = Field(description="The plan with nothing lost")
    losses: list[RemainingTeam] = Field(description="Each loss judged, the most harmful first")
    critical: list[list[str]] = Field(
        description="Smallest sets whose loss ends observability; empty where the plan is "
        "not observable itself",
        examples=[[["v3"], ["sensor:v3"], ["L1"]]],
    )


def what_if_document(found: WhatIf) -> WhatIfDocument:
    """Return the document of the effects of losses on a plan."""
    return WhatIfDocument(
        version=__version__,
        name=found.plan.scenario.name,
        baseline=_remaining(found.baseline),
        losses=[_remaining(one) for one in found.losses],
        critical=[list(names) for names in found.critical],
    )


def _remaining(outcome: LossOutcome) -> RemainingTeam:
    return RemainingTeam(
        lost=list(outcome.lost),
        rank=outcome.rank,
        state_dim=outcome.state_dim,
        observable=outcome.observable,
        unobservable=unobservable_motions(outcome.unobservable, outcome.vehicles),
        extended=extended_rank_record(outcome.error_verdict, outcome.vehicles),
        predicted_rms_m=error_prediction(outcome.predicted_rms, outcome.vehicles, outcome.note),
        worst_predicted_rms_m=outcome.worst_predicted_rms,
        verdict=outcome.verdict,
    )
