"""Renditions of plans and reports: figures, printed sheets, losses, files of mission planners.

Previews are figures of a scenario while it is edited. Exports are zip archives.
"""

import json
from collections.abc import Sequence
from functools import partial
from inspect import Parameter, Signature
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import HTMLResponse
from starlette.concurrency import run_in_threadpool

from api.calls import (
    FILES,
    IN_JSON,
    Call,
    Caller,
    CurrentCall,
    CurrentCaller,
    IdempotencyKey,
    accepts,
    answer_once,
    call_of,
    check_medium,
    computed,
)
from api.job_kinds.job_kind import Batch, JobSpec
from api.job_kinds.job_table import JOB_KINDS, plurals
from api.jobs.queue import VERSION
from api.problems import Conflict, NotFound, problem_responses
from api.responses import FigureValues, Preview
from api.routes.job_routes import Owned, result_or_refuse
from api.routes.page_routes import compressed
from api.routes.plan_routes import Identifier, OnPaper, find_or_refuse
from api.storage.holdings import Answer
from api.storage.job_records import begun_job, report_of
from api.storage.part_records import finished_batches, first_batches
from syncplan.errors import InputError
from syncplan.exporting.format_table import ALL, FORMATS, ExportOptions
from syncplan.importing.features import Section
from syncplan.importing.import_options import ImportOptions
from syncplan.importing.imported_places import ImportedPlaces
from syncplan.options import options_of
from syncplan.planning.loss_study import WhatIfDocument
from syncplan.planning.planner import BoundChoice
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.figure_table import FIGURES, always_there
from syncplan.plotting.printed_report import POLICY
from syncplan.reports.covariance_report import PositionCovariancesDocument
from syncplan.reports.sites_report import SitesDocument
from syncplan.scenario.quantities import Title

router = APIRouter()

_read = partial(
    router.get, dependencies=IN_JSON, responses=problem_responses(401, 404, 406, 422, 429, 503)
)

SHOWN = ("theme", "title", "subtitle", "legend")
"""Options of a figure that a request takes; its reader fits it to a page."""


def _asked(kind: type, names: Sequence[str]) -> Any:
    """Return the dependency of the options of a kind that a query gives, by these names."""

    def given(**asked: Any) -> Any:
        return kind(**{n: tuple(v) if isinstance(v, list) else v for n, v in asked.items()})

    parameters = [
        Parameter(
            each.name,
            Parameter.KEYWORD_ONLY,
            default=[] if each.default == () else each.default,
            annotation=Annotated[
                list[Title] if each.default == () else each.type,
                Query(description=each.sentence, **dict[str, Any](each.limits)),
            ],
        )
        for each in options_of(kind)
        if each.name in names
    ]
    setattr(given, "__signature__", Signature(parameters))  # noqa: B010
    return Depends(given)


AskedStyle = Annotated[FigureStyle, _asked(FigureStyle, SHOWN)]
AskedPlaces = Annotated[ImportOptions, _asked(ImportOptions, get_args(Section))]

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
    tags=["figures"],
    dependencies=IN_JSON,
    response_model=Preview,
    operation_id="previewScenario",
    summary="Plan a scenario, or judge a plan, without storing it",
    response_description="The plan, stored nowhere, and the figures asked for",
    responses=problem_responses(401, 406, 413, 415, 422, 429, 503, 507),
)
async def create_preview(
    call: CurrentCall,
    quick: Annotated[
        bool,
        Query(
            description="Leave out what takes most of the time: the flights, the predicted error, "
            "the search for single points of failure, and the bound on the links' "
            "smallest margin, as the plan's notes say; and the connectivity period"
        ),
    ] = False,
    paper: OnPaper = False,
    covariances: Annotated[
        bool, Query(description="Add the covariances of positions, for a quick plan, too")
    ] = False,
    figure: Annotated[
        list[PlanFigure] | None,
        Query(description="Figures to add", max_length=len(always_there("plan"))),
    ] = None,
    *,
    style: AskedStyle,
) -> Response:
    """Find phases for a scenario being edited, judge the plan and fly it; nothing is stored.

    A plan sent instead keeps its orbits and is judged afresh.
    """

    names = list(dict.fromkeys(figure or ()))
    asked = (call.body, call.syntax, call.service.limits, quick, names, style, covariances, paper)
    return await _unstored(call, "previewed", *asked)


async def _unstored(call: Call, task: str, *arguments: Any) -> Response:
    """The answer that a task makes, which stores nothing but answers under an Idempotency-Key."""
    make = partial(computed, call, task, *arguments)
    if call.key is None:
        # nothing is kept, so a drag waits for no other writer
        made = Response(await make(), media_type="application/json")
    else:
        made = await answer_once(call, make, lambda _, text: Answer(call.digest, 200, {}, text))
    return compressed(made, call.request.headers.get("accept-encoding", ""))


async def _file(
    request: Request, caller: CurrentCaller, idempotency_key: IdempotencyKey = None
) -> Call:
    check_medium(request, FILES, "a file of the field")
    return await call_of(request, caller.owner, idempotency_key)


@router.post(
    "/imports",
    tags=["plans"],
    dependencies=IN_JSON,
    response_model=ImportedPlaces,
    operation_id="importPlaces",
    summary="Read a file of the field",
    response_description="The features of the file, what they become, and a scenario",
    responses=problem_responses(401, 406, 413, 415, 422, 429, 503, 507),
)
async def import_file(
    call: Annotated[Call, Depends(_file)],
    file: Annotated[Title, Query(description="Its name in messages")] = "file",
    *,
    options: AskedPlaces,
) -> Response:
    """Read KML, KMZ, GeoJSON, GPX, a QGroundControl plan, a fence list or points as CSV.

    Polygons that are named or coloured as no-fly, exclusion fences and holes become keep-outs, the
    largest other polygon the area, points landmarks. Names are patterns, such as `no fly*`. Nothing
    is stored.
    """
    return await _unstored(call, "imported", call.body, file, options)


@_read(
    "/plans/{plan_id}/figures/{figure}",
    tags=["figures"],
    response_model=FigureValues,
    operation_id="readPlanFigure",
    summary="Draw a plan",
    response_description="The figure",
)
async def read_plan_figure(
    plan_id: Identifier,
    figure: StoredFigure,
    caller: CurrentCaller,
    style: AskedStyle,
) -> Response:
    """A figure of a plan. `comparison` shows it beside the plan that it was refined from."""
    row = await find_or_refuse(caller.service, caller.owner, plan_id)
    parent = None
    if FIGURES[figure].compares:
        if row.parent_id is None:
            raise NotFound(f"plan {plan_id} was not refined from another: nothing to compare with")
        parent = (await find_or_refuse(caller.service, caller.owner, row.parent_id)).text
    return await _drawn(caller, "plan_figure", row.text, figure, style, parent)


@_read(
    "/plans/{plan_id}/covariances",
    tags=["plans"],
    response_model=PositionCovariancesDocument,
    operation_id="readPlanCovariances",
    summary="Predict the covariances of positions",
    response_description="The covariances",
)
async def read_plan_covariances(plan_id: Identifier, caller: CurrentCaller) -> Response:
    """Error ellipses over the last period, from the bound behind the predicted RMS errors."""
    found = await _of_plan(caller, plan_id, "plan_covariances")
    made = Response(found, media_type="application/json")
    return compressed(made, caller.request.headers.get("accept-encoding", ""))


@_read(
    "/jobs/{job_id}/figures/{figure}",
    tags=["figures"],
    response_model=FigureValues,
    operation_id="readJobFigure",
    summary="Draw a job's report",
    response_description="The figure",
    responses=problem_responses(401, 404, 406, 409, 422, 429, 503),
)
async def read_job_figure(
    row: Owned, figure: ReportFigure, caller: CurrentCaller, style: AskedStyle
) -> Response:
    """A figure of the report of a validation, a flight, a sweep, a replay or a design.

    While a validation or a flight runs, it is of its first trials, as if no more had been asked
    for; `finished` in the job's events says of how many, once there are some.
    """
    if JOB_KINDS[row.kind].keeps_trials and row.state == "running":
        begun = await run_in_threadpool(_begun, caller, row.id)
        if begun is not None:
            return await _drawn(caller, "figure_so_far", *begun, figure, style)
    if row.state != "succeeded" or JOB_KINDS[row.kind].figures is None:
        kinds = plurals(lambda kind: kind.figures is not None)
        raise Conflict(f"the job is a {row.kind}, {row.state}; {kinds} that succeeded have figures")
    text = await result_or_refuse(caller.service, row, report_of)
    return await _drawn(caller, "report_figure", text, row.kind, figure, style)


def _begun(caller: Caller, job_id: str) -> tuple[JobSpec, list[tuple[Batch, bytes]]] | None:
    """A job under way and its first batches; None if it has no trials to show yet."""
    with caller.service.database.reading() as connection:
        job = begun_job(connection, job_id, VERSION)
        numbers = [number for _, number in first_batches(connection, job_id)]
        if job is None or not numbers:
            return None
        return job.spec, finished_batches(connection, job_id, numbers)


async def _of_plan(caller: Caller, plan_id: Identifier, task: str, *arguments: Any) -> Any:
    """What a task makes of a stored plan; raises NotFound if there is none."""
    row = await find_or_refuse(caller.service, caller.owner, plan_id)
    return await computed(caller, task, row.text, *arguments)


async def _drawn(caller: Caller, task: str, *arguments: Any) -> Response:
    """Figure that a task draws; raises NotFound if its subject does not have it."""
    try:
        drawn = await computed(caller, task, *arguments)
    except InputError as error:
        raise NotFound(error.problem) from None
    return Response(drawn, media_type="application/json")


# --- printed reports ------------------------------------------------------------------------------


@_read(
    "/plans/{plan_id}/report",
    tags=["figures"],
    dependencies=[Depends(accepts("text/html"))],
    response_class=HTMLResponse,
    operation_id="printPlan",
    summary="Print a plan",
    response_description="The page",
)
async def read_printed_plan(plan_id: Identifier, caller: CurrentCaller) -> Response:
    """A page that prints on two sheets, the second of them to be signed.

    Map, verdict and vehicles are on the first; altitudes, coordinates, what the figures assume and
    room for two signatures on the second.
    """
    page = await _of_plan(caller, plan_id, "printed_report", plan_id)
    policy = f"{POLICY}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    return HTMLResponse(page, headers={"Content-Security-Policy": policy})


# --- losses ---------------------------------------------------------------------------------------


@_read(
    "/plans/{plan_id}/what-if",
    tags=["plans"],
    response_model=WhatIfDocument,
    operation_id="judgeLosses",
    summary="Judge losses",
    response_description="What losses do to the plan",
)
async def read_losses(
    plan_id: Identifier,
    caller: CurrentCaller,
    lose: Annotated[
        list[Annotated[str, Query(max_length=80)]] | None,
        Query(
            description="Names of what is lost together: vehicles, landmarks, and sensors as "
            "sensor:v3, compass:v3 or distance:v3; every loss is judged if not given",
            max_length=64,
        ),
    ] = None,
    losses: Annotated[
        Literal["1", "2"], Query(description="Judge every loss of one, or of up to two")
    ] = "1",
    bound: Annotated[
        BoundChoice, Query(description="Predict errors: auto leaves very large teams out")
    ] = "auto",
) -> Response:
    """The plan judged afresh without each vehicle, sensor or landmark, orbits unchanged.

    The most harmful loss comes first. A vehicle whose sensor is lost flies on and is seen by
    others.
    """
    found = await _of_plan(caller, plan_id, "judged_losses", lose or [], int(losses), bound)
    return Response(found, media_type="application/json")


# --- landmarks ------------------------------------------------------------------------------------


@_read(
    "/plans/{plan_id}/landmark-choice",
    tags=["plans"],
    response_model=SitesDocument,
    operation_id="chooseLandmarks",
    summary="Choose landmarks",
    response_description="The landmarks chosen, and the plan with them",
)
async def read_landmark_choice(
    plan_id: Identifier,
    caller: CurrentCaller,
    candidate: Annotated[
        list[Annotated[str, Query(max_length=80)]],
        Query(description="Names of landmarks to choose among", min_length=1, max_length=64),
    ],
    choose: Annotated[int, Query(description="How many of them to choose", ge=1, le=64)],
    seed: Annotated[int, Query(description="Seed of the search", ge=0, le=2**53)] = 0,
) -> Response:
    """The landmarks that minimise the worst vehicle's window bound, chosen among some of a plan's.

    The plan in the answer has them and the landmarks that are no candidates, on the same orbits.
    """
    found = await _of_plan(caller, plan_id, "chosen_landmarks", candidate, choose, seed)
    return Response(found, media_type="application/json")


# --- exports --------------------------------------------------------------------------------------


NOTES = "Syncplan-Notes"
_NOTES_HEADER = {
    "description": "Warnings of the export, as in the sidecar: a JSON array of strings, in ASCII",
    "schema": {"type": "string", "contentMediaType": "application/json"},
}

if TYPE_CHECKING:
    ExportName = str
else:
    ExportName = Literal[*FORMATS, ALL]


EXPORTED = (
    *("autopilot", "vehicle", "altitude_m", "altitude_step_m", "turns", "waypoints"),
    *("snap_radius", "force"),
)
"""Options of an export that a request takes."""

AskedExport = Annotated[ExportOptions, _asked(ExportOptions, EXPORTED)]


@router.get(
    "/plans/{plan_id}/exports/{format}",
    tags=["exports"],
    dependencies=[Depends(accepts("application/zip"))],
    response_class=Response,
    operation_id="exportPlan",
    summary="Export a plan",
    response_description="A zip archive",
    responses={
        200: {"content": {"application/zip": {}}, "headers": {NOTES: _NOTES_HEADER}},
        **problem_responses(401, 404, 406, 409, 422, 429, 503),
    },
)
async def read_export(
    plan_id: Identifier,
    format: ExportName,
    caller: CurrentCaller,
    options: AskedExport,
) -> Response:
    """The files of a format, one for each vehicle if a file holds one, and the sidecar with phases.

    The sidecar says how each vehicle joins its circle at the right phase, and what to watch for.
    """
    archive, notes = await _of_plan(caller, plan_id, "exported", format, options)
    headers = {
        "content-disposition": f'attachment; filename="plan-{format}.zip"',
        NOTES: json.dumps(notes),
    }
    return Response(archive, headers=headers, media_type="application/zip")
