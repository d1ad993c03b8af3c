"""The OpenAPI document: what FastAPI can't know of bodies and headers, and worked examples.

Bodies are read as they come and checked in child processes, so FastAPI sees no model of them. The
examples are answers of the real service, kept as data where a reader needs more than the general
example of a status; `python -m tests.tools.record_examples` renews them.
"""

import json
from collections.abc import Iterator, Sequence
from importlib.resources import files
from typing import Any

from fastapi import FastAPI
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from api.job_kinds.job_table import JOB_KINDS
from api.operations import (
    ANSWERS,
    BODIES,
    FOLLOWING,
    HEADERS,
    REQUEST_ID,
    RESULTS,
    SENT,
    Body,
)
from api.problems import problem_responses
from api.problems.openapi_problems import REFERENCE
from api.responses import JobEvent
from api.service import limits_of
from api.settings import Settings

_JSON, _YAML, _EVENTS = "application/json", "application/yaml", "text/event-stream"

Tree = dict[str, Any]

_DONE = {"200", "201", "202", "204"}


def document_operations(app: FastAPI) -> None:
    """Complete the OpenAPI document of `app`; it is made when it is first requested."""
    plain = app.openapi
    made: list[Tree] = []

    def openapi() -> Tree:
        if not made:
            made.append(_completed(plain(), app.state.settings))
        return made[0]

    # FastAPI's documented way to extend the document
    setattr(app, "openapi", openapi)  # noqa: B010


def operations(document: Tree) -> Iterator[Tree]:
    """Yield every operation of an OpenAPI document."""
    for path in document["paths"].values():
        yield from (value for key, value in path.items() if key != "parameters")


def _completed(document: Tree, settings: Settings) -> Tree:
    components = document["components"]
    components["schemas"].update(_schemas(settings))
    components["headers"] = HEADERS
    components["parameters"] = {"RequestId": REQUEST_ID}
    for path in document["paths"].values():
        path["parameters"] = [{"$ref": "#/components/parameters/RequestId"}]
    for operation in operations(document):
        _complete(operation, _examples(operation["operationId"]))
    return document


def _complete(operation: Tree, examples: Tree) -> None:
    name = operation["operationId"]
    for parameter in operation.get("parameters", []):
        parameter["schema"] = _never_null(parameter["schema"])
    if name in BODIES:
        operation["requestBody"] = _request_body(BODIES[name], examples["request"])
    responses = operation["responses"]
    responses["500"] = problem_responses(500)[500]
    if "401" in responses:
        # who presents wrong keys has to wait
        responses.setdefault("429", problem_responses(429)[429])
    if name == "followJob":
        responses["200"]["content"] = {_EVENTS: {"schema": _EVENT}}
    if name == "readJobResult":
        one_of = [{"$ref": REFERENCE.format(model=model.__name__)} for model in RESULTS]
        responses["200"]["content"] = {_JSON: {"schema": {"oneOf": one_of}}}
    for status, response in responses.items():
        if status in _DONE:
            response["description"] = ANSWERS[name]
        response.setdefault("headers", {}).update(_headers(name, status))
        if (name, status) in FOLLOWING:
            response["links"] = _links(FOLLOWING[name, status])
        if status in examples["responses"]:
            (content,) = response["content"].values()
            content.pop("example", None)
            content["examples"] = examples["responses"][status]


def _headers(name: str, status: str) -> Tree:
    sent = {"X-Request-ID": "X-Request-ID", **SENT.get((name, status), {})}
    if status == "415":
        sent["Accept"] = "Accept"
    return {header: {"$ref": f"#/components/headers/{entry}"} for header, entry in sent.items()}


def _links(following: dict[str, str]) -> Tree:
    return {
        name: {"operationId": name, "parameters": {parameter: "$response.body#/id"}}
        for name, parameter in following.items()
    }


_EVENT = {
    "title": "Event",
    "description": "One event of the stream: they are numbered without gaps, and Last-Event-ID "
    "names the last one seen",
    "type": "object",
    "required": ["id", "event", "data"],
    "properties": {
        "id": {"type": "string", "pattern": "^[1-9][0-9]*$"},
        "event": {"type": "string", "const": "job"},
        "data": {
            "type": "string",
            "contentMediaType": _JSON,
            "contentSchema": {"$ref": REFERENCE.format(model="JobEvent")},
        },
    },
}


def _request_body(body: Body, examples: Tree) -> Tree:
    if body.media:
        raw: Tree = {"schema": {"type": "string", "format": "binary"}}
        content = dict.fromkeys(body.media, raw)
        return {"description": body.description, "required": body.required, "content": content}
    schemas = [{"$ref": REFERENCE.format(model=model.__name__)} for model in body.models]
    content = {
        "schema": schemas[0] if len(schemas) == 1 else {"anyOf": schemas},
        "examples": examples,
    }
    return {
        "description": body.description,
        "required": body.required,
        "content": {_JSON: content, _YAML: content},
    }


def _schemas(settings: Settings) -> Tree:
    """The schemas that the operations below refer to, with the limits of this service."""
    models: Sequence[type[BaseModel]] = [
        *dict.fromkeys(model for body in BODIES.values() for model in body.models),
        *RESULTS,
        JobEvent,
    ]
    _, definitions = models_json_schema(
        [(model, "validation") for model in models], ref_template=REFERENCE
    )
    schemas: Tree = definitions["$defs"]
    limits = limits_of(settings)
    for kind in JOB_KINDS.values():
        for key, limit in kind.request.limited.items():
            _bound(schemas[kind.request.__name__], key, getattr(limits, limit))
    return schemas


def _bound(schema: Tree, key: str, most: float) -> None:
    """Write the most this service takes into the schema of a number."""
    described = schema["properties"][key]
    for one in described.get("anyOf", [described]):
        if one.get("type") in ("integer", "number"):
            one["maximum"] = min(most, one.get("maximum", most))


def _never_null(schema: Tree) -> Tree:
    """The schema of a parameter that is left out or has a value: null can't be sent."""
    kinds = [one for one in schema.get("anyOf", []) if one != {"type": "null"}]
    if len(kinds) != 1:
        return schema
    return {**{key: value for key, value in schema.items() if key != "anyOf"}, **kinds[0]}


def _examples(name: str) -> Tree:
    file = files("api").joinpath("examples", f"{name}.json")
    recorded: Tree = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    for answers in recorded.get("responses", {}).values():
        for key, one in answers.items():
            if "same" in one:
                other, status = one["same"]
                answers[key] = _examples(other)["responses"][status][key]
    return {"request": {}, "responses": {}, **recorded}
