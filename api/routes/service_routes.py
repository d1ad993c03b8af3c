"""Routes of the service itself: health, readiness, metrics, usage and schemas."""

from functools import cache
from typing import Any, Literal

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse
from pydantic import BaseModel
from pydantic.json_schema import JsonSchemaMode
from sqlalchemy.exc import DBAPIError

from api.calls import IN_JSON
from api.failures import failure_of
from api.problems import STARTING, Unavailable, problem_responses
from api.responses import KeptBytes, StoredPlan, Usage
from api.security import CurrentOwner
from api.service import CurrentService
from api.storage.owner_bytes import bytes_kept
from api.storage.part_records import computed_seconds
from syncplan.scenario.specification import Scenario

# --- health ---------------------------------------------------------------------------------------


health = APIRouter(tags=["health"])


class Health(BaseModel):
    """A sign of life."""

    status: Literal["ok"] = "ok"


@health.get(
    "/healthz",
    operation_id="checkHealth",
    summary="Check liveness",
    response_description="It is alive",
    dependencies=IN_JSON,
    responses=problem_responses(406),
)
async def healthz() -> Health:
    """The process answers."""
    return Health()


@health.get(
    "/readyz",
    operation_id="checkReadiness",
    summary="Check readiness",
    response_description="It is ready",
    dependencies=IN_JSON,
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
        raise Unavailable(STARTING)
    silent_s = 0.0 if service.heartbeat is None else service.heartbeat.silent_s
    if silent_s > service.settings.dead_after_s:
        raise Unavailable(f"no heartbeat for {silent_s:.0f} s; other workers take over its jobs")
    return Health()


@health.get(
    "/metrics",
    operation_id="readMetrics",
    summary="Figures for Prometheus",
    response_description="The figures, in Prometheus' text format",
    response_class=Response,
    responses={
        200: {"content": {"text/plain": {"schema": {"type": "string"}}}},
        **problem_responses(401, 503),
    },
)
def metrics(request: Request, owner: CurrentOwner) -> Response:
    """Requests and refusals, jobs and their waiting times, child processes and their tasks."""
    body, content_type = request.app.state.metrics.render()
    return Response(body, media_type=content_type)


# --- usage ----------------------------------------------------------------------------------------


usage = APIRouter(tags=["usage"])


@usage.get(
    "/usage",
    dependencies=IN_JSON,
    operation_id="readUsage",
    summary="Read your usage",
    response_description="What you use, and the most allowed",
    responses=problem_responses(401, 406, 503),
)
def read_usage(service: CurrentService, owner: CurrentOwner) -> Usage:
    """The bytes that you keep, the computing time of your jobs, and the most allowed."""
    settings = service.settings
    with service.database.reading() as connection:
        return Usage(
            bytes=KeptBytes(**bytes_kept(connection, owner)),
            max_bytes=settings.max_owner_bytes,
            computing_s=computed_seconds(connection, owner),
            max_job_seconds=settings.max_job_seconds,
        )


# --- schemas --------------------------------------------------------------------------------------


schemas = APIRouter(prefix="/schemas", tags=["schemas"], dependencies=IN_JSON)

_DIALECT = "https://json-schema.org/draft/2020-12/schema"


@cache
def _schema(model: type[BaseModel], mode: JsonSchemaMode) -> bytes:
    return bytes(JSONResponse({"$schema": _DIALECT, **model.model_json_schema(mode=mode)}).body)


@schemas.get(
    "/scenario",
    response_model=dict[str, Any],
    operation_id="readScenarioSchema",
    summary="Schema of scenarios",
    response_description="The schema",
    responses=problem_responses(406),
)
async def read_scenario_schema() -> Response:
    """The JSON Schema of the scenarios that POST /plans takes."""
    return Response(_schema(Scenario, "validation"), media_type="application/json")


@schemas.get(
    "/plan",
    response_model=dict[str, Any],
    operation_id="readPlanSchema",
    summary="Schema of plans",
    response_description="The schema",
    responses=problem_responses(406),
)
async def read_plan_schema() -> Response:
    """The JSON Schema of a stored plan."""
    return Response(_schema(StoredPlan, "serialization"), media_type="application/json")
