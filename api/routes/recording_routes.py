"""Routes of recordings of real robots: uploaded as archives, listed, renamed, deleted."""

from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response
from sqlalchemy import Connection
from starlette.concurrency import run_in_threadpool

from api.calls import (
    ARCHIVES,
    IN_JSON,
    Call,
    CurrentCall,
    CurrentCaller,
    IdempotencyKey,
    answer_once,
    call_of,
    check_medium,
    computed,
)
from api.documents import PackedRecording
from api.problems import Conflict, NotFound, problem_responses
from api.responses import Recording, RecordingPage, recording_answer
from api.routes.plan_routes import Before, Identifier, Limit, page_and_next
from api.security import CurrentOwner
from api.service import CurrentService
from api.storage import holdings
from api.storage.holdings import Answer
from api.storage.job_records import hold_owner
from api.storage.tables import recordings
from syncplan.recordings.recording_formats import STAMPS, Stamps
from syncplan.scenario.quantities import Name

router = APIRouter(prefix="/recordings", tags=["recordings"], dependencies=IN_JSON)


async def _upload(
    request: Request, caller: CurrentCaller, idempotency_key: IdempotencyKey = None
) -> AsyncIterator[Call]:
    check_medium(request, ARCHIVES, "a zip or tar archive")
    # before reading the body, which is large
    with caller.service.uploads.one_of(caller.owner):
        yield await call_of(request, caller.owner, idempotency_key)


CurrentUpload = Annotated[Call, Depends(_upload)]
"""Parameter type of a route that takes an archive, few at a time."""


@router.post(
    "",
    status_code=201,
    response_model=Recording,
    operation_id="createRecording",
    summary="Keep a recording",
    response_description="The recording, stored, in short",
    responses=problem_responses(401, 406, 413, 415, 422, 429, 503, 507),
)
async def create_recording(
    call: CurrentUpload,
    name: Annotated[
        Name | None, Query(description="Its name in reports; as in the archive if not given")
    ] = None,
    stamps: Annotated[Stamps, Query(description=STAMPS)] = "header",
) -> Response:
    """Read a recording of real robots and keep it for a while, to be replayed.

    The body is a zip or tar archive of the recording's folder: CSV files, those of MRCLAM, or a
    ROS 2 bag.
    """

    async def compute() -> PackedRecording:
        # before reading a recording for which there is no room
        await run_in_threadpool(call.service.database.read, _check_room, call)
        packed: PackedRecording = await computed(call, "packed_recording", call.body, name, stamps)
        return packed

    def store(connection: Connection, packed: PackedRecording) -> Answer:
        hold_owner(connection, call.owner)
        _check_room(connection, call)
        row = holdings.add_recording(connection, call.owner, packed)
        headers = {"location": f"/v1/recordings/{row.id}"}
        return Answer(call.digest, 201, headers, recording_answer(row).model_dump_json())

    return await answer_once(call, compute, store)


@router.get(
    "",
    response_model=RecordingPage,
    operation_id="listRecordings",
    summary="List recordings",
    response_description="A page of recordings",
    responses=problem_responses(401, 406, 422, 503),
)
def read_recordings(
    service: CurrentService, owner: CurrentOwner, limit: Limit = 50, before: Before = None
) -> RecordingPage:
    """Your recordings, newest first, a page at a time."""
    listed = service.database.read(holdings.list_recordings, owner, limit + 1, before)
    rows, following = page_and_next("/v1/recordings", listed, limit)
    return RecordingPage(items=[recording_answer(row) for row in rows], next=following)


@router.get(
    "/{recording_id}",
    response_model=Recording,
    operation_id="readRecording",
    summary="Read what a recording holds",
    response_description="The recording in short",
    responses=problem_responses(401, 404, 406, 422, 503),
)
def read_recording(
    recording_id: Identifier, service: CurrentService, owner: CurrentOwner
) -> Recording:
    """Overview of a recording: its robots, landmarks, length and readings."""
    return recording_answer(service.database.read(recording_or_refuse, owner, recording_id))


@router.patch(
    "/{recording_id}",
    response_model=Recording,
    operation_id="renameRecording",
    summary="Rename a recording",
    response_description="The recording in short",
    responses=problem_responses(401, 404, 406, 413, 415, 422, 429, 503, 507),
)
async def change_recording(recording_id: Identifier, call: CurrentCall) -> Response:
    """Give a recording another name; reports of further replays state it."""

    async def compute() -> str:
        row = await run_in_threadpool(
            call.service.database.read, recording_or_refuse, call.owner, recording_id
        )
        renamed: str = await computed(
            call, "renamed_recording", call.body, call.syntax, row.overview
        )
        return renamed

    def store(connection: Connection, overview: str) -> Answer:
        row = holdings.rename_recording(connection, call.owner, recording_id, overview)
        if row is None:
            raise _no_recording(recording_id)
        return Answer(call.digest, 200, {}, recording_answer(row).model_dump_json())

    return await answer_once(call, compute, store)


@router.delete(
    "/{recording_id}",
    status_code=204,
    operation_id="deleteRecording",
    summary="Delete a recording",
    response_description="Deleted",
    responses=problem_responses(401, 404, 406, 409, 422, 503, 507),
)
def remove_recording(
    recording_id: Identifier, service: CurrentService, owner: CurrentOwner
) -> None:
    """Delete a recording unless an unfinished job is about it; reports of its replays stay."""
    service.database.read(recording_or_refuse, owner, recording_id)

    def remove(connection: Connection) -> bool:
        hold_owner(connection, owner)
        return holdings.delete_recording(connection, owner, recording_id)

    if not service.database.freeing(remove):
        raise Conflict("a job about the recording has not ended; wait for it, or cancel it")


def recording_or_refuse(
    connection: Connection, owner: str, recording_id: str
) -> holdings.RecordingRow:
    """Return an owner's recording; raises NotFound, also for recordings of others."""
    row = holdings.find_recording(connection, owner, recording_id)
    if row is None:
        raise _no_recording(recording_id)
    return row


def _no_recording(recording_id: str) -> NotFound:
    return NotFound(f"there is no recording {recording_id}")


def _check_room(connection: Connection, call: Call) -> None:
    """Raise StorageFull if the owner has as many recordings as allowed."""
    most = call.service.settings.max_recordings
    holdings.check_room(connection, recordings, call.owner, most)
