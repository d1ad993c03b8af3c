"""Routes of plans: made at once, listed, renamed, deleted; nothing but its name changes.

Lists are paged, newest first; each page gives the path of the next.
"""

from collections.abc import Sequence
from functools import partial
from typing import Annotated, Any, TypeVar
from urllib.parse import urlencode

from fastapi import APIRouter, Header, Path, Query, Request, Response
from sqlalchemy import Connection, Row

from api.calls import IN_JSON, CurrentCall, answer_once, computed
from api.documents import PlanText
from api.problems import NotFound, PreconditionFailed, ServiceError, problem_responses
from api.responses import PlanPage, StoredPlan, plan_summary
from api.security import CurrentOwner
from api.service import CurrentService, Service, service_of
from api.storage.holdings import (
    Answer,
    PlanRow,
    RecordingRow,
    add_plan,
    body_of,
    check_room,
    delete_plan,
    find_plans,
    list_plans,
    rename_plan,
)
from api.storage.job_records import JobRow
from api.storage.tables import plans

Listed = TypeVar("Listed", JobRow, RecordingRow, Row[*tuple[Any, ...]])

Limit = Annotated[int, Query(ge=1, le=200, description="Most entries on a page")]
Before = Annotated[
    str | None,
    Query(pattern=r"^[0-9a-f-]{36}$", description="Cursor: entries older than this identifier"),
]


def page_and_next(
    path: str, rows: Sequence[Listed], limit: int, **chosen: str | None
) -> tuple[Sequence[Listed], str | None]:
    """Return the first `limit` rows and the path of the next page, None if there is none.

    `chosen` are the parameters that selected the rows.
    """
    if len(rows) <= limit:
        return rows, None
    query = {"limit": limit, "before": rows[limit - 1].id, **chosen}
    return rows[:limit], f"{path}?{urlencode({k: v for k, v in query.items() if v is not None})}"


router = APIRouter(prefix="/plans", tags=["plans"], dependencies=IN_JSON)

_ID = "019a2b3c-4d5e-7f60-8123-456789abcdef"

Identifier = Annotated[
    str, Path(pattern=r"^[0-9a-f-]{36}$", description="Identifier", examples=[_ID])
]
OnPaper = Annotated[
    bool, Query(description="Leave out the flights: the verdict rests on paper alone")
]
_TAG_LENGTH = 64
_TAGS = "Entity tags as ETag gave them, separated by commas, or *"
_IfMatch = Annotated[str, Header(alias="If-Match", description=_TAGS)]


@router.post(
    "",
    status_code=201,
    response_model=StoredPlan,
    operation_id="createPlan",
    summary="Plan a scenario, or keep a plan",
    response_description="The plan, stored",
    responses=problem_responses(401, 406, 413, 415, 422, 429, 503, 507),
)
async def create_plan(
    call: CurrentCall,
    steady: Annotated[bool, Query(description="Add the error once it has become periodic")] = False,
    paper: OnPaper = False,
) -> Response:
    """Find phases for a scenario, in JSON or YAML, judge the plan and fly it, all at once.

    A plan sent instead keeps its orbits and is judged afresh.
    """

    asked = (call.body, call.syntax, call.service.limits, steady, paper)

    def store(connection: Connection, made: PlanText) -> Answer:
        check_room(connection, plans, call.owner, call.service.settings.max_plans)
        row = add_plan(connection, call.owner, made)
        headers = {"location": f"/v1/plans/{row.id}", "etag": f'"{row.etag}"'}
        return Answer(call.digest, 201, headers, body_of(row))

    make = partial(computed, call, "made_plan", *asked)
    return await answer_once(call, make, store, together=True)


@router.get(
    "",
    response_model=PlanPage,
    operation_id="listPlans",
    summary="List plans",
    response_description="A page of plans",
    responses=problem_responses(401, 406, 422, 503),
)
def read_plans(
    service: CurrentService,
    owner: CurrentOwner,
    limit: Limit = 50,
    before: Before = None,
) -> PlanPage:
    """Summaries of your plans, newest first, a page at a time."""
    listed = service.database.read(list_plans, owner, limit + 1, before)
    rows, following = page_and_next("/v1/plans", listed, limit)
    return PlanPage(items=[plan_summary(row) for row in rows], next=following)


@router.get(
    "/{plan_id}",
    response_model=StoredPlan,
    operation_id="readPlan",
    summary="Read a plan",
    response_description="The plan",
    responses={
        304: {"description": "Not changed since the tag given"},
        **problem_responses(401, 404, 406, 422, 503),
    },
)
async def read_plan(
    request: Request,
    plan_id: Identifier,
    owner: CurrentOwner,
    if_none_match: Annotated[str | None, Header(alias="If-None-Match", description=_TAGS)] = None,
) -> Response:
    """The plan, byte for byte as it was made; nothing but its name changes."""
    row = await find_or_refuse(service_of(request), owner, plan_id)
    headers = {"etag": f'"{row.etag}"', "cache-control": "private, no-cache"}
    if if_none_match is not None and _tags(if_none_match) & {"*", row.etag}:
        return Response(status_code=304, headers=headers)
    return Response(body_of(row), headers=headers, media_type="application/json")


@router.patch(
    "/{plan_id}",
    response_model=StoredPlan,
    operation_id="renamePlan",
    summary="Rename a plan",
    response_description="The plan",
    responses=problem_responses(401, 404, 406, 412, 413, 415, 422, 429, 503, 507),
)
async def change_plan(plan_id: Identifier, call: CurrentCall, if_match: _IfMatch = "*") -> Response:
    """Give the plan's scenario another name; the plan's tag changes with it.

    Earlier jobs about it, and plans refined from it before, keep the old name.
    """

    async def compute() -> tuple[str, str]:
        row = await find_or_refuse(call.service, call.owner, plan_id)
        renamed: tuple[str, str] = await computed(
            call, "renamed_plan", call.body, call.syntax, row.text
        )
        return renamed

    def store(connection: Connection, renamed: tuple[str, str]) -> Answer:
        row = rename_plan(connection, call.owner, plan_id, _tags(if_match), *renamed)
        if row is None:
            raise _mismatch(connection, call.owner, plan_id, if_match)
        return Answer(call.digest, 200, {"etag": f'"{row.etag}"'}, body_of(row))

    return await answer_once(call, compute, store)


@router.delete(
    "/{plan_id}",
    status_code=204,
    operation_id="deletePlan",
    summary="Delete a plan",
    response_description="Deleted",
    responses=problem_responses(401, 404, 406, 412, 422, 503, 507),
)
def remove_plan(
    plan_id: Identifier,
    service: CurrentService,
    owner: CurrentOwner,
    if_match: _IfMatch = "*",
) -> None:
    """Delete a plan; jobs about it, and plans refined from it, stay."""

    def remove(connection: Connection) -> None:
        if not delete_plan(connection, owner, plan_id, _tags(if_match)):
            raise _mismatch(connection, owner, plan_id, if_match)

    service.database.freeing(remove)


async def find_or_refuse(service: Service, owner: str, plan_id: str) -> PlanRow:
    """Return an owner's plan; raises NotFound, also for plans of others."""
    row = await service.plans.find(owner, plan_id)
    if row is None:
        raise _no_plan(plan_id)
    return row


def _mismatch(connection: Connection, owner: str, plan_id: str, if_match: str) -> ServiceError:
    """Problem of a change that met no plan: it is gone, or has another tag."""
    row = find_plans(connection, [(owner, plan_id)])[0]
    if row is None:
        return _no_plan(plan_id)
    return PreconditionFailed(f"the plan's tag is {row.etag}, not {if_match}")


def _no_plan(plan_id: str) -> NotFound:
    return NotFound(f"there is no plan {plan_id}")


def _tags(condition: str) -> set[str]:
    """Tags that a condition names, as far as a plan can have them; "*" stands for any."""
    tags = {tag.strip().removeprefix("W/").strip('"') for tag in condition.split(",")}
    # a header has room for thousands of others, which a statement would hold up writers with
    return {tag for tag in tags if tag == "*" or len(tag) == _TAG_LENGTH}
