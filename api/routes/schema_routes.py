"""The schemas of scenarios and plans."""

from collections.abc import Awaitable, Callable
from functools import cache
from typing import Any

from fastapi import APIRouter, Depends

from api.negotiation import accepts
from api.problems import problem_responses
from api.responses import StoredPlan
from syncplan.scenario.specification import Scenario

router = APIRouter(
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
    router.add_api_route(
        f"/{_name}",
        _reader(_name),
        operation_id=f"read{_name.capitalize()}Schema",
        summary=f"Schema of {_name}s",
        description=_sentence,
        responses=problem_responses(406),
    )
