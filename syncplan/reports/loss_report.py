"""What losses do to a plan, as a document."""

from syncplan import __version__
from syncplan.planning.loss_study import LossOutcome, WhatIf
from syncplan.reports.error_report import extended_rank_record
from syncplan.reports.loss_schemas import RemainingTeam, WhatIfDocument
from syncplan.reports.plan_report import error_prediction, unobservable_motions
from syncplan.reports.verdict_schemas import plan_verdict


def what_if_document(found: WhatIf) -> WhatIfDocument:
    """Return the document of what losses do to a plan."""
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
        verdict=plan_verdict(outcome.verdict),
    )
