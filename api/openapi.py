"""OpenAPI document: bodies and headers that FastAPI can't infer, and worked examples.

Bodies are read raw and checked in child processes, so FastAPI sees no model of them. The
examples are answers of the real service, kept as data where a reader needs more than the general
example of a status; `python -m tests.tools.record_examples` renews them.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from fastapi import FastAPI, Response
from fastapi.responses import JSONResponse
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from api.calls import ARCHIVES, FILES
from api.documents import PlanRenaming, RecordingRenaming
from api.job_kinds.job_table import JOB_KINDS
from api.problems import REFERENCE, Problem, problem_responses
from api.responses import JobEvent, StoredPlan
from api.service import limits_of
from api.settings import Settings
from syncplan.planning.plan_files import PlanFile
from syncplan.scenario.specification import Scenario

# --- operations -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Body:
    """Body of a request: one of `models`, in JSON or YAML, or bytes of one of `media`."""

    models: tuple[type[BaseModel], ...]
    description: str
    media: tuple[str, ...] = ()

    @property
    def required(self) -> bool:
        """Whether the body can't be left out."""
        fields = (field for model in self.models for field in model.model_fields.values())
        return not self.models or any(field.is_required() for field in fields)


_JOB_OPERATIONS = tuple(kind.operation for kind in JOB_KINDS.values())

_PLANNED = Body(
    (Scenario, PlanFile),
    "A scenario, as in its file, to find phases for; or a plan, as in its file, whose own "
    "orbits are judged with its scenario: of a plan, `scenario` and `vehicles` are read",
)

BODIES = {
    "createPlan": _PLANNED,
    "previewScenario": _PLANNED,
    "renamePlan": Body((PlanRenaming,), "The name"),
    "createRecording": Body((), "A zip or tar archive of a recording's folder", ARCHIVES),
    "importPlaces": Body((), "A file of the field", FILES),
    "renameRecording": Body((RecordingRenaming,), "The name"),
    **{kind.operation: Body((kind.request,), kind.study.body) for kind in JOB_KINDS.values()},
}
"""Request bodies by operation; other operations take none."""

RESULTS = tuple(dict.fromkeys(kind.report or StoredPlan for kind in JOB_KINDS.values()))
"""Models of readJobResult's answer, which is one of these."""

HEADERS: dict[str, dict[str, Any]] = {
    "Location": {
        "description": "where the new plan, recording or job is",
        "required": True,
        "schema": {"type": "string", "format": "uri-reference"},
        "example": "/v1/jobs/019a2b3c-4d5e-7f60-8123-456789abcdef",
    },
    "ETag": {
        "description": "the plan's entity tag: a digest of what was planned",
        "required": True,
        "schema": {"type": "string", "pattern": '^"[0-9a-f]{64}"$'},
        "example": f'"{"9e107d9d372bb6826bd81d3542a419d6" * 2}"',
    },
    "Result-ETag": {
        "description": "the plan's entity tag, where the result is a plan",
        "schema": {"type": "string", "pattern": '^"[0-9a-f]{64}"$'},
        "example": f'"{"9e107d9d372bb6826bd81d3542a419d6" * 2}"',
    },
    "Content-Location": {
        "description": "where the plan is, where the result is a plan",
        "schema": {"type": "string", "format": "uri-reference"},
        "example": "/v1/plans/019a2b3c-4d5e-7f60-8123-456789abcdef",
    },
    "Accept": {
        "description": "media types that a body may have",
        "required": True,
        "schema": {"type": "string"},
        "example": "application/json, application/yaml",
    },
    "X-Request-ID": {
        "description": "the id of the request in the service's log: the client's, or a new one",
        "required": True,
        "schema": {"type": "string", "pattern": "^[A-Za-z0-9._-]{1,64}$"},
        "example": "5b1f0c52a7c14f7e9d4b8a1a6f0b6f0e",
    },
}
"""Headers of answers, by the name used in references."""

SENT: dict[tuple[str, str], dict[str, str]] = {
    ("createPlan", "201"): {"Location": "Location", "ETag": "ETag"},
    ("createRecording", "201"): {"Location": "Location"},
    ("readPlan", "200"): {"ETag": "ETag"},
    ("readPlan", "304"): {"ETag": "ETag"},
    ("renamePlan", "200"): {"ETag": "ETag"},
    **{(name, "202"): {"Location": "Location"} for name in _JOB_OPERATIONS},
    ("readJobResult", "200"): {"ETag": "Result-ETag", "Content-Location": "Content-Location"},
}
"""Headers of an operation's answers, each with its entry in HEADERS."""

REQUEST_ID = {
    "name": "X-Request-ID",
    "in": "header",
    "description": "an id of your own for this request, 1 to 64 of A-Z a-z 0-9 . _ -; "
    "any other value is replaced",
    "schema": {"type": "string"},
    "example": "survey-17",
}

FOLLOWING: dict[tuple[str, str], dict[str, str]] = {
    ("createPlan", "201"): dict.fromkeys(
        ("readPlan", "renamePlan", "refinePlan", "validatePlan", "flyPlan", "deletePlan"), "plan_id"
    ),
    ("createRecording", "201"): dict.fromkeys(
        ("readRecording", "renameRecording", "replayRecording", "deleteRecording"), "recording_id"
    ),
    **{
        (name, "202"): dict.fromkeys(
            ("readJob", "followJob", "cancelJob", "finishJob", "deleteJob"), "job_id"
        )
        for name in _JOB_OPERATIONS
    },
}
"""Operations that may follow an answer, each with the parameter that takes its id."""


# --- the document ---------------------------------------------------------------------------------


_JSON, _YAML, _EVENTS = "application/json", "application/yaml", "text/event-stream"

Tree = dict[str, Any]


def document_operations(app: FastAPI) -> None:
    """Complete the OpenAPI document of `app` with what FastAPI can't infer."""
    plain = app.openapi
    # FastAPI's documented way to extend the document, which is made when it is first requested
    setattr(app, "openapi", cache(lambda: _completed(plain(), app.state.settings)))  # noqa: B010
    # the same bytes for all, however slowly they are read
    whole = cache(lambda: JSONResponse(app.openapi()).body)
    app.add_route("/openapi.json", lambda _: Response(whole(), media_type=_JSON))


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
        # a client that presents wrong keys has to wait
        responses.setdefault("429", problem_responses(429)[429])
    if name == "followJob":
        responses["200"]["content"] = {_EVENTS: {"schema": _EVENT}}
    if name == "readJobResult":
        one_of = [{"$ref": REFERENCE.format(model=model.__name__)} for model in RESULTS]
        html = {"schema": {"type": "string"}, "example": "<p>survey: 2 trials of 60 s, ...</p>"}
        responses["200"]["content"] = {_JSON: {"schema": {"oneOf": one_of}}, "text/html": html}
    for status, response in responses.items():
        response.setdefault("headers", {}).update(_headers(name, status))
        if (name, status) in FOLLOWING:
            response["links"] = _links(FOLLOWING[name, status])
        if status in examples["responses"]:
            content = next(iter(response["content"].values()))
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
    content: Tree = {"schema": {"type": "string", "format": "binary"}}
    if body.models:
        schemas = [{"$ref": REFERENCE.format(model=model.__name__)} for model in body.models]
        schema = schemas[0] if len(schemas) == 1 else {"anyOf": schemas}
        content = {"schema": schema, "examples": examples}
    return {
        "description": body.description,
        "required": body.required,
        "content": dict.fromkeys(body.media or (_JSON, _YAML), content),
    }


def _schemas(settings: Settings) -> Tree:
    """Schemas that the operations refer to, with the limits of this service."""
    taken = dict.fromkeys(model for body in BODIES.values() for model in body.models)
    schemas = {**_definitions(Problem), **_definitions(*taken, *RESULTS, JobEvent)}
    limits = limits_of(settings)
    for kind in JOB_KINDS.values():
        for key, limit in kind.request.limited().items():
            _bound(schemas[kind.request.__name__], key, getattr(limits, limit))
    return schemas


def _definitions(*models: type[BaseModel]) -> Tree:
    _, definitions = models_json_schema(
        [(model, "validation") for model in models], ref_template=REFERENCE
    )
    return dict(definitions["$defs"])


def _bound(schema: Tree, key: str, most: float) -> None:
    """Write this service's limit into the schema of a number."""
    described = schema["properties"][key]
    for one in described.get("anyOf", [described]):
        if one.get("type") in ("integer", "number"):
            one["maximum"] = min(most, one.get("maximum", most))


def _never_null(schema: Tree) -> Tree:
    """Schema of a parameter without null, which can't be sent: it is left out instead."""
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
