"""Designs: the cheapest team that meets a brief, or what stands in its way."""

from api.job_kinds.job_kind import (
    EarlierWork,
    JobKind,
    JobReport,
    JobRequest,
    JobSpec,
    JobSubject,
    Progress,
    Shown,
    WholeTask,
)
from api.limits import RequestLimits, check_at_most
from syncplan.designs.candidates import check_samples
from syncplan.designs.ladder import DesignState, orders_of
from syncplan.reports.design_report import DesignDocument, design_document, front_point
from syncplan.runtime.files import as_text
from syncplan.scenario.brief import Brief


class DesignRequest(JobRequest, Brief):
    """What a team must do, what it may consist of, and the error that is allowed."""

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the number of searches; raises InputError if they exceed a limit."""
        check_at_most("team.max", self.team.max, limits.vehicles, " vehicles")
        check_samples(self)
        orders = orders_of(self)
        evaluations = sum(order.evaluations for order in orders)
        check_at_most("effort", evaluations, limits.design_evaluations, " candidates of all teams")
        return max(len(orders), 1)


def _designed(spec: JobSpec, earlier: EarlierWork, workers: int, progress: Progress) -> JobReport:
    # not at the top: it loads numba and casadi, which only a child needs
    from syncplan.designs.designer import design

    brief = Brief.model_validate_json(spec.request)

    def heard(state: DesignState) -> None:
        front = [front_point(brief, team).as_json() for team in state.front]
        progress(Shown(state.done, {"doing": state.doing, "front": front}))

    designed = design(brief, workers=workers, progress=heard, earlier=earlier.resumed(progress))
    return JobReport(as_text(design_document(designed).as_json()))


DESIGN = JobKind(
    name="design",
    unit="searches",
    request=DesignRequest,
    operation="designTeam",
    summary="Design a team",
    description="Find the cheapest team that meets a brief, predicted, validated and flown; or "
    "what the best one misses, and what would help: a job that reports them. Its events carry "
    "the front found so far.",
    body="The brief",
    task=WholeTask(compute=_designed, finishes=True),
    report=DesignDocument,
    figures="design",
)
