"""Problems in the OpenAPI document: their schema once, an example for each status."""

from typing import Any

from fastapi import FastAPI

from api.problems.problem_document import MEDIA_TYPE, FaultEntry, Problem, title_of

REFERENCE = "#/components/schemas/{model}"
"""How the document refers to a schema by its name."""
_ID = "5b1f0c52a7c14f7e9d4b8a1a6f0b6f0e"
_FAULT = FaultEntry(path="sensor.range_m", value=-5, message="-5: must be greater than 0")
_RETRY = {
    "Retry-After": {
        "description": "seconds to wait before another try",
        "schema": {"type": "integer", "minimum": 1},
    }
}
_CHALLENGE = {
    "WWW-Authenticate": {
        "description": "how to present a key",
        "schema": {"type": "string", "const": "Bearer"},
    }
}
_HEADERS = {401: _CHALLENGE, 429: _RETRY, 503: _RETRY}
_DETAILS = {
    400: "the body can't be read; send JSON in UTF-8",
    401: "send a known key as 'Authorization: Bearer KEY'",
    404: "no plan has this id",
    405: "this path does not take the method",
    406: "the Accept header excludes application/json, which is all there is here",
    409: "the job has already ended",
    412: "the plan is not the one If-Match names",
    413: "the body is larger than 1048576 bytes",
    415: "text/plain: the body must be application/json or application/yaml",
    422: "sensor.range_m: -5: must be greater than 0",
    429: "you have 20 unfinished jobs, the most allowed; wait for one to end, or cancel one",
    500: "the service failed on this request; its log says why, under this request id",
    503: "the database can't be used just now; try again",
    507: "the storage is full; nothing was stored",
}


def problem_responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return what FastAPI's `responses=` documents for these statuses of an operation."""
    return {status: _response(status) for status in statuses}


def document_problems(app: FastAPI) -> None:
    """Let the OpenAPI document of `app` hold the schema that problem_responses refers to.

    The answer 422 that FastAPI documents on its own gives way to the problem that is sent.
    """
    plain = app.openapi

    def openapi() -> dict[str, Any]:
        document = plain()
        schemas = document.setdefault("components", {}).setdefault("schemas", {})
        for name in ("HTTPValidationError", "ValidationError"):
            schemas.pop(name, None)
        if "Problem" not in schemas:
            schema = Problem.model_json_schema(ref_template=REFERENCE, mode="serialization")
            schemas.update(schema.pop("$defs"))
            schemas["Problem"] = schema
        for path in document.get("paths", {}).values():
            for operation in path.values():
                _mend(operation.get("responses", {}))
        return document

    # FastAPI's documented way to extend the document
    setattr(app, "openapi", openapi)  # noqa: B010


def _mend(responses: dict[str, Any]) -> None:
    content = responses.get("422", {}).get("content", {})
    schema = content.get("application/json", {}).get("schema", {})
    if schema.get("$ref", "").endswith("/HTTPValidationError"):
        responses["422"] = _response(422)


def _response(status: int) -> dict[str, Any]:
    title = title_of(status)
    example = Problem(
        title=title,
        status=status,
        detail=_DETAILS.get(status, title.lower()),
        errors=[_FAULT] if status == 422 else None,
        request_id=_ID,
    )
    response: dict[str, Any] = {
        "description": title,
        "content": {
            MEDIA_TYPE: {
                "schema": {"$ref": REFERENCE.format(model="Problem")},
                "example": example.model_dump(mode="json", exclude_none=True),
            }
        },
    }
    if status in _HEADERS:
        response["headers"] = dict(_HEADERS[status])
    return response
