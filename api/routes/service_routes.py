"""The service itself: whether it lives and is ready, its metrics, its schemas."""

from collections.abc import Awaitable, Callable
from functools import cache
from typing import Any, Literal

from fastapi import APIRouter, Depends, Request, Response
from pydantic import BaseModel
from sqlalchemy.exc import DBAPIError

from api.calls import accepts
from api.failures import failure_of
from api.problems import Unavailable, problem_responses
from api.responses import StoredPlan
from api.security import CurrentOwner
from api.service import CurrentService
from syncplan.scenario.specification import Scenario

# --- health ---------------------------------------------------------------------------------------


health = APIRouter(tags=["health"])


class Health(BaseModel):
    """A sign of life."""

    status: Literal["ok"] = "ok"


@health.get(
    "/healthz",
    operation_id="checkHealth",
    summary="Is it alive",
    dependencies=[Depends(accepts("application/json"))],
    responses=problem_responses(406),
)
async def healthz() -> Health:
    """The process answers."""
    return Health()


@health.get(
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
    silent_s = 0.0 if service.heartbeat is None else service.heartbeat.silent_s
    if silent_s > service.settings.dead_after_s:
        raise Unavailable(f"no heartbeat for {silent_s:.0f} s; other workers take over its jobs")
    return Health()


@health.get(
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


# --- schemas --------------------------------------------------------------------------------------


schemas = APIRouter(
    prefix="/schemas", tags=["schemas"], dependencies=[Depends(accepts("application/json"))]
)

_DIALECT = "https://json-schema.org/draft/2020-12/schema"
_SCHEMAS: dict[str, tuple[str, Callable[[], dict[str, Any]]]] = {
    "scenario": (
        "The JSON Schema of the scenarios that POST /plans takes.",
        Scenario.model_json_schema,
    ),
    "plan": (
        "The JSON Schema of a stored plan.",
        lambda: StoredPlan.model_json_schema(mode="serialization"),
    ),
}
"""What each schema is, and what makes it."""


@cache
def _schema(name: str) -> dict[str, Any]:
    return {"$schema": _DIALECT, **_SCHEMAS[name][1]()}


def _reader(name: str) -> Callable[[], Awaitable[dict[str, Any]]]:
    async def read_schema() -> dict[str, Any]:
        return _schema(name)

    return read_schema


for _name, (_sentence, _) in _SCHEMAS.items():
    schemas.add_api_route(
        f"/{_name}",
        _reader(_name),
        operation_id=f"read{_name.capitalize()}Schema",
        summary=f"Schema of {_name}s",
        description=_sentence,
        responses=problem_responses(406),
    )
