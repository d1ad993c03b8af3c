"""Refinements: phases, centres and radii moved to a better plan."""

from collections.abc import Mapping
from typing import Any, ClassVar, Self

from api.documents import PlanText, as_plan_text, loaded_plan
from api.job_kinds.job_kind import (
    EarlierWork,
    JobKind,
    JobRequest,
    JobSpec,
    JobSubject,
    Progress,
    Shown,
    WholeTask,
)
from api.job_kinds.option_requests import with_keys
from api.limits import RequestLimits, check_at_most
from syncplan.planning.plan_files import Loaded, plan_of
from syncplan.refinement.refiner import BetterPlan, options_for, refine
from syncplan.reports.refinement_report import plan_so_far
from syncplan.scenario.models import RefineOptions
from syncplan.scenario.truths import optional_keys


@with_keys(optional_keys(RefineOptions))
class RefinementRequest(JobRequest):
    """Changes of a refinement to the options in the plan's scenario; see its refine section."""

    limited: ClassVar[Mapping[str, str]] = {"time_limit_s": "refine_s"}

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the number of starts; raises InputError if the time exceeds the limit."""
        assert isinstance(subject, Loaded)
        options = options_for(subject.scenario, None, self.changes())
        check_at_most("time_limit_s", options.time_limit_s, limits.refine_s, " s")
        return options.starts

    def settled(self, subject: JobSubject, limits: RequestLimits) -> Self:
        """Return the request; without a time limit of its own, it gets at most this service's."""
        assert isinstance(subject, Loaded)
        planned = options_for(subject.scenario, None, {}).time_limit_s
        if "time_limit_s" in self.changes() or planned <= limits.refine_s:
            return self
        return self.model_copy(update={"time_limit_s": limits.refine_s})

    def changes(self) -> dict[str, Any]:
        """Return the given options, as arguments of syncplan.refinement.refiner.refine."""
        return self.model_dump(exclude_none=True)


def _refined(spec: JobSpec, earlier: EarlierWork, workers: int, progress: Progress) -> PlanText:
    """Return the refined plan, or the plan itself with the reason why it could not be improved.

    Progress counts the starts that must have ended because others have begun.
    """
    assert spec.plan is not None
    changes = RefinementRequest.model_validate_json(spec.request).changes()
    begun = set(earlier.searches)

    def heard(start: int, iteration: int, objective: float) -> None:
        begun.add(start)
        progress(max(len(begun) - workers, 0))

    def better(found: BetterPlan) -> None:
        progress(Shown(0, {"best": plan_so_far(found).as_json()}))

    search = earlier.resumed(progress)
    given = plan_of(loaded_plan(spec.plan))
    refined = refine(
        given, workers=workers, progress=heard, better=better, earlier=search, **changes
    )
    return as_plan_text(refined)


REFINEMENT = JobKind(
    name="refinement",
    unit="starts",
    request=RefinementRequest,
    operation="refinePlan",
    summary="Refine a plan",
    description="Move phases, centres and radii to the best plan near this one: a job that "
    "makes a plan. Its events carry the best plan so far.",
    body="What changes of the plan's own options; nothing if empty",
    about="plan",
    task=WholeTask(compute=_refined, finishes=True),
)
