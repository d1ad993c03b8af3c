"""What the OpenAPI document adds to each route: bodies, answers, headers, what follows."""

from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel

from api.job_kinds.job_table import JOB_KINDS
from api.negotiation import ARCHIVES
from api.responses import StoredPlan
from syncplan.planning.plan_files import PlanFile
from syncplan.scenario.specification import Scenario


@dataclass(frozen=True, slots=True)
class Body:
    """The body of a request: what it holds, one of these, and whether there must be one.

    It is JSON or YAML, or bytes of one of `media`.
    """

    models: tuple[type[BaseModel], ...]
    required: bool
    description: str
    media: tuple[str, ...] = ()


_JOB_OPERATIONS = tuple(kind.operation.id for kind in JOB_KINDS.values())

_PLANNED = Body(
    (Scenario, PlanFile),
    True,
    "A scenario, as in its file, to find phases for; or a plan, as in its file, whose own "
    "orbits are judged with its scenario: of a plan, `scenario` and `vehicles` are read",
)

BODIES = {
    "createPlan": _PLANNED,
    "previewScenario": _PLANNED,
    "createRecording": Body((), True, "A zip or tar archive of a recording's folder", ARCHIVES),
    **{
        one.operation.id: Body((one.request,), one.operation.body_required, one.operation.body)
        for one in JOB_KINDS.values()
    },
}
"""What operations take; the others take no body."""

ANSWERS = {
    "createPlan": "The plan, stored",
    "createRecording": "The recording, stored, in short",
    "listRecordings": "A page of recordings",
    "readRecording": "The recording in short",
    "deleteRecording": "Deleted",
    "listPlans": "A page of plans",
    "readPlan": "The plan",
    "deletePlan": "Deleted",
    **dict.fromkeys(_JOB_OPERATIONS, "The job"),
    "listJobs": "A page of jobs",
    "readJob": "The job",
    "followJob": "The job's events, from the first one on or after the one named",
    "cancelJob": "The job, cancelled",
    "readJobResult": "The report, or the plan that a refinement made",
    "readJobTrials": "NumPy arrays in an .npz archive",
    "previewScenario": "The plan, stored nowhere, and the figures asked for",
    "readPlanFigure": "The figure",
    "readJobFigure": "The figure",
    "judgeLosses": "What losses do to the plan",
    "exportPlan": "A zip archive",
    "readScenarioSchema": "The schema",
    "readPlanSchema": "The schema",
    "checkHealth": "It is alive",
    "checkReadiness": "It is ready",
    "readMetrics": "The figures, in Prometheus' text format",
}
"""What an operation answers when all goes well."""

RESULTS = tuple(dict.fromkeys(kind.report or StoredPlan for kind in JOB_KINDS.values()))
"""What readJobResult answers: one of these."""

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
        "description": "what a body may be",
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
"""Headers of answers, by the name that refers to them."""

SENT: dict[tuple[str, str], dict[str, str]] = {
    ("createPlan", "201"): {"Location": "Location", "ETag": "ETag"},
    ("createRecording", "201"): {"Location": "Location"},
    ("readPlan", "200"): {"ETag": "ETag"},
    ("readPlan", "304"): {"ETag": "ETag"},
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
        ("readPlan", "refinePlan", "validatePlan", "flyPlan", "deletePlan"), "plan_id"
    ),
    ("createRecording", "201"): dict.fromkeys(
        ("readRecording", "replayRecording", "deleteRecording"), "recording_id"
    ),
    **{
        (name, "202"): dict.fromkeys(("readJob", "followJob", "cancelJob"), "job_id")
        for name in _JOB_OPERATIONS
    },
}
"""What can be asked next, each with the parameter that takes the answer's id."""
