"""The schemas of scenarios and plans."""

from functools import cache
from typing import Any

from fastapi import APIRouter, Depends

from api.negotiation import accepts
from api.problems import problem_responses
from api.responses import StoredPlan
from syncplan.scenario.specification import Scenario

__all__ = ["router"]

router = APIRouter(
    prefix="/schemas", tags=["schemas"], dependencies=[Depends(accepts("application/json"))]
)

_DIALECT = "https://json-schema.org/draft/2020-12/schema"


@router.get(
    "/scenario",
    operation_id="readScenarioSchema",
    summary="Schema of scenarios",
    responses=problem_responses(406),
)
async def scenario_schema() -> dict[str, Any]:
    """The JSON Schema of the scenarios that POST /plans takes."""
    return _scenario()


@router.get(
    "/plan",
    operation_id="readPlanSchema",
    summary="Schema of plans",
    responses=problem_responses(406),
)
async def plan_schema() -> dict[str, Any]:
    """The JSON Schema of a stored plan."""
    return _plan()


@cache
def _scenario() -> dict[str, Any]:
    return {"$schema": _DIALECT, **Scenario.model_json_schema()}


@cache
def _plan() -> dict[str, Any]:
    return {"$schema": _DIALECT, **StoredPlan.model_json_schema(mode="serialization")}
