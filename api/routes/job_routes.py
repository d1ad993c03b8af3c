"""Routes that submit, read, follow, cancel and delete jobs, and return their results."""

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, TypeVar

from anyio import to_thread
from fastapi import APIRouter, Depends, Header, Query, Request, Response
from fastapi.responses import HTMLResponse
from sqlalchemy import Connection
from starlette.concurrency import run_in_threadpool

from api.calls import (
    IN_JSON,
    Call,
    CurrentCall,
    CurrentCaller,
    EmptyCall,
    accepts,
    answer_once,
    computed,
)
from api.following import EventStream, Follower
from api.job_kinds.job_kind import JobKind
from api.job_kinds.job_table import JOB_KINDS, plurals
from api.problems import Conflict, NotFound, TooManyRequests, problem_responses
from api.responses import Job, JobPage, job_answer
from api.routes.plan_routes import Before, Identifier, Limit, find_or_refuse, page_and_next
from api.routes.recording_routes import recording_or_refuse
from api.security import CurrentKey, CurrentOwner
from api.service import CurrentService, Service
from api.storage import job_records
from api.storage.holdings import Answer, body_of
from api.storage.job_records import JobRow, NewJob
from api.storage.part_records import computed_seconds
from api.telemetry import current_traceparent
from syncplan.studies.job_contract import JobState

T = TypeVar("T")

router = APIRouter(tags=["jobs"])
# most of them; the others answer with streams and archives
_documents = APIRouter(dependencies=IN_JSON)

_SUBMITTED = problem_responses(401, 404, 406, 413, 415, 422, 429, 503, 507)
_JSON, _HTML = "application/json", "text/html"
_FRAGMENT = {"Content-Security-Policy": "default-src 'none'", "Vary": "Accept"}
_RETRY_AFTER_S = 5
_RETRY_AFTER_SECONDS_S = 600


def _offer(kind: JobKind) -> None:
    """Add the route that submits jobs of a kind."""

    async def about_plan(plan_id: Identifier, call: CurrentCall) -> Response:
        return await _submit(call, kind, plan_id=plan_id)

    async def about_recording(recording_id: Identifier, call: CurrentCall) -> Response:
        return await _submit(call, kind, recording_id=recording_id)

    async def about_nothing(call: CurrentCall) -> Response:
        return await _submit(call, kind)

    taken: dict[str | None, Callable[..., Any]] = {
        "plan": about_plan,
        "recording": about_recording,
        None: about_nothing,
    }
    _documents.add_api_route(
        kind.study.path,
        taken[kind.about],
        methods=["POST"],
        status_code=202,
        response_model=Job,
        operation_id=kind.operation,
        summary=kind.summary,
        response_description="The job",
        description=kind.description,
        responses=_SUBMITTED,
    )


for _kind in JOB_KINDS.values():
    _offer(_kind)


@_documents.get(
    "/jobs",
    response_model=JobPage,
    operation_id="listJobs",
    summary="List jobs",
    response_description="A page of jobs",
    responses=problem_responses(401, 406, 422, 503),
)
def read_jobs(
    service: CurrentService,
    owner: CurrentOwner,
    limit: Limit = 50,
    before: Before = None,
    state: Annotated[JobState | None, Query(description="Only jobs in this state")] = None,
) -> JobPage:
    """Your jobs, newest first, a page at a time."""
    listed = service.database.read(job_records.list_jobs, owner, limit + 1, before, state)
    rows, following = page_and_next("/v1/jobs", listed, limit, state=state)
    return JobPage(items=[job_answer(row) for row in rows], next=following)


def _owned(job_id: Identifier, service: CurrentService, owner: CurrentOwner) -> JobRow:
    """Job of the caller; raises NotFound for others."""
    row = service.database.read(job_records.find_job, owner, job_id)
    if row is None:
        raise NotFound(f"there is no job {job_id}")
    return row


Owned = Annotated[JobRow, Depends(_owned)]


@_documents.get(
    "/jobs/{job_id}",
    response_model=Job,
    operation_id="readJob",
    summary="Read a job",
    response_description="The job",
    responses=problem_responses(401, 404, 406, 422, 503),
)
def read_job(row: Owned) -> Job:
    """A job's state, its progress and the path of its result."""
    return job_answer(row)


@_documents.delete(
    "/jobs/{job_id}",
    status_code=204,
    operation_id="deleteJob",
    summary="Delete a job",
    response_description="Deleted",
    responses=problem_responses(401, 404, 406, 409, 422, 503, 507),
)
def remove_job(row: Owned, service: CurrentService) -> None:
    """Delete a job that has ended, with its report and its events; a plan that it made stays."""
    if not service.database.freeing(partial(job_records.delete_job, job_id=row.id)):
        raise Conflict(f"the job is {row.state}; cancel it first, or wait for its end")


@router.get(
    "/jobs/{job_id}/events",
    response_class=Response,
    dependencies=[Depends(accepts("text/event-stream"))],
    operation_id="followJob",
    summary="Follow a job",
    response_description="The job's events, from the first one on or after the one named",
    responses=problem_responses(401, 404, 406, 422, 429, 503),
)
async def follow_job(
    request: Request,
    row: Owned,
    owner: CurrentOwner,
    key: CurrentKey,
    last_event_id: Annotated[
        str,
        Header(
            alias="Last-Event-ID", pattern="^[0-9]{1,9}$", description="Continue after this event"
        ),
    ] = "0",
) -> EventStream:
    """Every change of a job as a server-sent event; the stream ends when the job has ended.

    It also ends with the server; send Last-Event-ID to continue where it ended.
    """
    return EventStream(request.app.state.watch, Follower(owner, key, row.id, int(last_event_id)))


@_documents.post(
    "/jobs/{job_id}/cancel",
    response_model=Job,
    operation_id="cancelJob",
    summary="Cancel a job",
    response_description="The job, cancelled",
    responses=problem_responses(401, 404, 406, 409, 413, 422, 503, 507),
)
async def cancel_job(row: Owned, call: EmptyCall) -> Response:
    """Stop a job within two seconds. A job that has ended stays as it is.

    Takes no body and ignores one that is sent.
    """
    ended = False

    def cancel(connection: Connection) -> bool:
        nonlocal ended
        ended = job_records.end_job(connection, row.id, "cancelled")
        return ended or job_records.state_of(connection, row.id) == "cancelled"

    answer = await _changed(row, call, cancel)
    if ended:
        await run_in_threadpool(call.service.counts.job_over, row.id)
    return answer


@_documents.post(
    "/jobs/{job_id}/finish",
    response_model=Job,
    operation_id="finishJob",
    summary="End a search early",
    response_description="The job, which ends soon",
    responses=problem_responses(401, 404, 406, 409, 413, 422, 503, 507),
)
async def finish_job(row: Owned, call: EmptyCall) -> Response:
    """End a refinement or a design within seconds, with the best found so far as its result.

    Takes no body and ignores one that is sent. The job succeeds when its result is there.
    """
    if not JOB_KINDS[row.kind].study.ends_early:
        raise Conflict(f"a {row.kind} has no result before its end; cancel stops it without one")
    return await _changed(row, call, lambda connection: job_records.finish_job(connection, row.id))


async def _changed(row: JobRow, call: Call, change: Callable[[Connection], bool]) -> Response:
    """Answer with a job after a change, which returns whether the job was fit for it."""

    async def nothing() -> None:
        return None

    def store(connection: Connection, _nothing: None) -> Answer:
        if not change(connection):
            state = job_records.state_of(connection, row.id)
            raise Conflict(f"the job has already ended: it has {state}")
        now = job_records.find_job(connection, call.owner, row.id)
        if now is None:
            raise NotFound(f"there is no job {row.id}")
        return Answer(call.digest, 200, {}, job_answer(now).model_dump_json())

    return await answer_once(call, nothing, store, adds=False)


@router.get(
    "/jobs/{job_id}/result",
    response_model=None,
    operation_id="readJobResult",
    summary="Read a job's result",
    response_description="The report, or the plan that a refinement made",
    responses=problem_responses(401, 404, 406, 409, 422, 429, 503),
)
async def read_result(
    row: Owned, caller: CurrentCaller, medium: Annotated[str, Depends(accepts(_JSON, _HTML))]
) -> Response:
    """The report of a job, or the plan that a refinement made; as HTML, in lines and tables."""
    if row.state != "succeeded":
        raise Conflict(f"the job is {row.state}; a result comes with the state succeeded")
    headers: dict[str, str] = {}
    if row.result_plan_id is None:
        plain = text = await result_or_refuse(caller.service, row, job_records.report_of)
    else:
        plan = await find_or_refuse(caller.service, caller.owner, row.result_plan_id)
        plain, text = plan.text, body_of(plan)
        headers = {"content-location": f"/v1/plans/{plan.id}", "etag": f'"{plan.etag}"'}
    if medium == _HTML:
        return HTMLResponse(await computed(caller, "summary", plain, row.kind), headers=_FRAGMENT)
    return Response(text, headers=headers, media_type=_JSON)


@router.get(
    "/jobs/{job_id}/trials",
    response_class=Response,
    dependencies=[Depends(accepts("application/octet-stream"))],
    operation_id="readJobTrials",
    summary="Read the trials of a validation or flight",
    response_description="NumPy arrays in an .npz archive",
    responses={
        200: {"content": {"application/octet-stream": {}}},
        **problem_responses(401, 404, 406, 409, 422, 503),
    },
)
async def read_trials(row: Owned, service: CurrentService) -> Response:
    """The figures of each trial of a validation or a flight, as NumPy arrays in an .npz archive."""
    if row.state != "succeeded" or not JOB_KINDS[row.kind].keeps_trials:
        kinds = plurals(lambda kind: kind.keeps_trials)
        raise Conflict(f"the job is a {row.kind}, {row.state}; {kinds} that succeeded have one")
    trials = await result_or_refuse(service, row, job_records.trials_of)
    return Response(trials, media_type="application/octet-stream")


async def result_or_refuse(
    service: Service, row: JobRow, read: Callable[[Connection, str], T | None]
) -> T:
    """Return what `read` finds of a job that succeeded; raises NotFound once it is deleted.

    Results may be large: few are read at a time, so that not all are in memory before any counts
    as an unread answer.
    """
    result = await to_thread.run_sync(service.database.read, read, row.id, limiter=service.results)
    if result is None:
        raise NotFound(f"the result of job {row.id} was deleted")
    return result


async def _submit(
    call: Call, kind: JobKind, *, plan_id: str | None = None, recording_id: str | None = None
) -> Response:
    service = call.service

    async def compute() -> NewJob:
        # here, so that an answered request is answered again even if its plan is gone
        text = overview = None
        if plan_id is not None:
            text = (await find_or_refuse(service, call.owner, plan_id)).text
        if recording_id is not None:
            recording = await run_in_threadpool(
                service.database.read, recording_or_refuse, call.owner, recording_id
            )
            overview = recording.overview
        name = kind.study.name
        asked = (name, call.body, call.syntax, service.limits, text, overview)
        request, work = await computed(call, "checked_request", *asked)
        return NewJob(name, request, work, plan_id, text, current_traceparent(), recording_id)

    def store(connection: Connection, new: NewJob) -> Answer:
        job_records.hold_owner(connection, call.owner)
        if recording_id is not None:
            recording_or_refuse(connection, call.owner, recording_id)
        waiting = job_records.count_unfinished(connection, call.owner)
        if waiting >= service.settings.max_queued_jobs:
            raise TooManyRequests(
                f"you have {waiting} unfinished jobs, the most allowed; "
                "wait for one to end, or cancel one",
                retry_after_s=_RETRY_AFTER_S,
            )
        _refuse_more_seconds(connection, call)
        row = job_records.add_job(connection, call.owner, new)
        service.queue.add_job(connection, row.id, call.owner)
        headers = {"location": f"/v1/jobs/{row.id}"}
        return Answer(call.digest, 202, headers, job_answer(row).model_dump_json())

    return await answer_once(call, compute, store)


def _refuse_more_seconds(connection: Connection, call: Call) -> None:
    """Raise TooManyRequests if the owner's jobs have used up their computing time."""
    most_s = call.service.settings.max_job_seconds
    spent_s = computed_seconds(connection, call.owner)
    if spent_s >= most_s:
        raise TooManyRequests(
            f"your jobs of the last 24 hours have computed for {spent_s:.1f} s, the most allowed "
            f"is {most_s:g} s; wait until older ones are more than 24 hours old",
            retry_after_s=_RETRY_AFTER_SECONDS_S,
        )


router.include_router(_documents)
