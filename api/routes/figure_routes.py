"""What a plan or a report looks like: figures for Plotly, and previews while a scenario changes."""

from typing import TYPE_CHECKING, Annotated, Literal

from fastapi import APIRouter, Depends, Query, Response
from starlette.concurrency import run_in_threadpool

from api.callers import Caller, CurrentCaller, computed
from api.idempotency import CurrentCall, answer_once
from api.job_kinds.job_table import JOB_KINDS, plurals
from api.negotiation import accepts
from api.problems import Conflict, NotFound, problem_responses
from api.responses import FigureValues, Preview
from api.routes.job_routes import Owned, report_or_refuse
from api.routes.plan_routes import Identifier, find_or_refuse
from api.storage.kept_answers import Answer
from syncplan.errors import InputError
from syncplan.plotting.figure_table import FIGURES, always_there

router = APIRouter(tags=["figures"], dependencies=[Depends(accepts("application/json"))])

Theme = Annotated[Literal["light", "dark"], Query(description="What it is to be shown on")]
if TYPE_CHECKING:
    PlanFigure = str
    StoredFigure = str
    ReportFigure = str
else:
    PlanFigure = Literal[*always_there("plan")]
    StoredFigure = Literal[*(name for name, one in FIGURES.items() if one.of == "plan")]
    ReportFigure = Literal[*(name for name, one in FIGURES.items() if one.of != "plan")]


@router.post(
    "/previews",
    response_model=Preview,
    operation_id="previewScenario",
    summary="Plan a scenario, or judge a plan, without storing it",
    responses=problem_responses(401, 406, 413, 415, 422, 429, 503, 507),
)
async def create_preview(
    call: CurrentCall,
    quick: Annotated[
        bool,
        Query(
            description="Leave out what takes most of the time: the predicted error with the check "
            "of the start, the search for single points of failure, and the bound on the links' "
            "smallest margin; the plan's notes say so"
        ),
    ] = False,
    figure: Annotated[
        list[PlanFigure] | None,
        Query(description="Figures to add", max_length=len(always_there("plan"))),
    ] = None,
    theme: Theme = "light",
) -> Response:
    """Find phases for a scenario and judge the plan, as it is edited; nothing is kept.

    A plan in its place keeps its orbits and is judged afresh.
    """

    async def compute() -> str:
        names = list(dict.fromkeys(figure or ()))
        limits = call.service.limits
        made: str = await computed(
            call.caller, "previewed", call.body, call.syntax, limits, quick, names, theme
        )
        return made

    return await answer_once(call, compute, lambda _, made: Answer(call.digest, 200, {}, made))


@router.get(
    "/plans/{plan_id}/figures/{figure}",
    response_model=FigureValues,
    operation_id="readPlanFigure",
    summary="Draw a plan",
    responses=problem_responses(401, 404, 406, 422, 429, 503),
)
async def read_plan_figure(
    plan_id: Identifier,
    figure: StoredFigure,
    caller: CurrentCaller,
    theme: Theme = "light",
) -> Response:
    """A figure of a plan. `comparison` shows the plan that it was refined from beside it."""
    row = await find_or_refuse(caller.service, caller.owner, plan_id)
    parent = None
    if FIGURES[figure].compares:
        if row.parent_id is None:
            raise NotFound(f"plan {plan_id} was not refined from another: nothing to compare with")
        parent = (await find_or_refuse(caller.service, caller.owner, row.parent_id)).text
    return await _drawn(caller, "plan_figure", row.text, figure, theme, parent)


@router.get(
    "/jobs/{job_id}/figures/{figure}",
    response_model=FigureValues,
    operation_id="readJobFigure",
    summary="Draw a job's report",
    responses=problem_responses(401, 404, 406, 409, 422, 429, 503),
)
async def read_job_figure(
    row: Owned, figure: ReportFigure, caller: CurrentCaller, theme: Theme = "light"
) -> Response:
    """A figure of the report of a validation, a flight, a sweep or a replay."""
    if row.state != "succeeded" or JOB_KINDS[row.kind].figures is None:
        kinds = plurals(lambda kind: kind.figures is not None)
        raise Conflict(f"the job is a {row.kind}, {row.state}; {kinds} that succeeded have figures")
    text = await run_in_threadpool(report_or_refuse, caller.service, row)
    return await _drawn(caller, "report_figure", text, row.kind, figure, theme)


async def _drawn(caller: Caller, task: str, *arguments: str | None) -> Response:
    """The figure that a task draws; raises NotFound for one that its subject does not have."""
    try:
        drawn = await computed(caller, task, *arguments)
    except InputError as error:
        raise NotFound(error.problem) from None
    return Response(drawn, media_type="application/json")
