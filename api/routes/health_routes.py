"""Whether the service lives, is ready for requests, and what it counts."""

from typing import Literal

from fastapi import APIRouter, Depends, Request, Response
from pydantic import BaseModel
from sqlalchemy.exc import DBAPIError

from api.negotiation import accepts
from api.problems import Unavailable, problem_responses
from api.problems.table import failure_of
from api.security import CurrentOwner
from api.service import CurrentService

router = APIRouter(tags=["health"])


class Health(BaseModel):
    """A sign of life."""

    status: Literal["ok"] = "ok"


@router.get(
    "/healthz",
    operation_id="checkHealth",
    summary="Is it alive",
    dependencies=[Depends(accepts("application/json"))],
    responses=problem_responses(406),
)
async def healthz() -> Health:
    """The process answers."""
    return Health()


@router.get(
    "/readyz",
    operation_id="checkReadiness",
    summary="Is it ready",
    dependencies=[Depends(accepts("application/json"))],
    responses=problem_responses(406, 503),
)
def readyz(service: CurrentService) -> Health:
    """The database can be written to, and the processes that compute and run jobs are alive."""
    service.database.check()
    try:
        service.database.check_writing()
    except DBAPIError as error:
        detail = failure_of(error).detail
        raise Unavailable(f"{detail}; what is stored can be read") from error
    if not service.pool.ready:
        raise Unavailable("the processes that compute are starting; try again")
    silent_s = service.silent_s()
    if silent_s > service.settings.dead_after_s:
        raise Unavailable(f"no heartbeat for {silent_s:.0f} s; other workers take over its jobs")
    return Health()


@router.get(
    "/metrics",
    operation_id="readMetrics",
    summary="Figures for Prometheus",
    response_class=Response,
    responses={
        200: {"content": {"text/plain": {"schema": {"type": "string"}}}},
        **problem_responses(401, 503),
    },
)
def metrics(request: Request, owner: CurrentOwner) -> Response:
    """Requests and refusals, jobs and how long they wait, child processes and their tasks."""
    body, content_type = request.app.state.metrics.render()
    return Response(body, media_type=content_type)
