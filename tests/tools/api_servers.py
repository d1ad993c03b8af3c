"""Servers with several owners, and what their answers must hold whatever was asked."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import httpx2

from api.main import create_app
from api.problems import FaultEntry, Problem
from api.settings import load_settings
from tests.tools.processes import PATIENCE_S, wait_until
from tests.tools.scenarios import document
from tests.tools.serving import NO_CERTIFICATES, Server, open_server

NOBODY = "01a1fd95-df6b-7a20-9383-c20e93a41e86"
"""Identifier of nothing."""

_METHODS = {"delete", "get", "head", "options", "patch", "post", "put", "trace"}


def key_of(owner: str) -> str:
    """Return the API key of an owner."""
    return f"{owner}-0123456789abcdef"


@contextmanager
def serving(folder: Path, owners: str, *arguments: str, **settings: str) -> Iterator[Server]:
    """A server for these owners, stopped at the end."""
    keys = ",".join(f"{owner}:{key_of(owner)}" for owner in owners.split())
    with open_server(folder, *arguments, SYNCPLAN_API_KEYS=keys, **settings) as server:
        yield server


def speaking(server: Server, owner: str) -> httpx2.Client:
    """A connection to a server with an owner's key."""
    headers = {"authorization": f"Bearer {key_of(owner)}"}
    return httpx2.Client(
        base_url=server.url, headers=headers, timeout=PATIENCE_S, verify=NO_CERTIFICATES
    )


@cache
def openapi_document() -> dict[str, Any]:
    """Return the OpenAPI document of a service that allows up to 7777 trials."""
    return create_app(load_settings(data_dir="/nowhere", max_trials=7777)).openapi()


def operations_of(described: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return (method, path) of every operation of an OpenAPI document."""
    return [
        (method.upper(), path)
        for path, found in described["paths"].items()
        for method in found
        if method in _METHODS
    ]


def planned(http: httpx2.Client, **changes: Any) -> dict[str, Any]:
    """Return a plan of a small scenario as the service stored it."""
    answer = http.post("/v1/plans", json=document(**changes))
    assert answer.status_code == 201, answer.text
    made: dict[str, Any] = answer.json()
    return made


def ended(http: httpx2.Client, at: str) -> dict[str, Any]:
    """Return the job at a path once it has ended."""
    last: dict[str, Any] = {}

    def over() -> bool:
        last.update(http.get(at).json())
        return last["ended_at"] is not None

    wait_until(over, every_s=0.1)
    return last


def done(http: httpx2.Client, at: str) -> dict[str, Any]:
    """Return the job at a path once it has ended, as it must have: in success."""
    last = ended(http, at)
    assert last["state"] == "succeeded", last
    return last


def problem(answer: httpx2.Response, status: int) -> Problem:
    """Return the problem that an answer must be."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    reported = Problem.model_validate_json(answer.content)
    assert reported.status == status
    assert reported.request_id == answer.headers["x-request-id"]
    assert reported.instance == answer.request.url.path
    assert "Traceback" not in answer.text
    return reported


def faults_of(answer: httpx2.Response) -> list[FaultEntry]:
    """Return what is wrong with a request, as its answer must say."""
    return problem(answer, 422).errors or []


@dataclass(frozen=True, slots=True)
class Event:
    """An event of a job's stream."""

    id: int
    state: str
    done: int


def events_of(answer: httpx2.Response) -> Iterator[Event]:
    """Yield the events of a stream as they come, until it ends."""
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/event-stream")
    fields: dict[str, str] = {}
    for line in answer.iter_lines():
        if line and not line.startswith(":"):
            name, _, value = line.partition(": ")
            fields[name] = value
        elif not line and fields:
            assert fields.pop("event") == "job"
            reported: dict[str, Any] = json.loads(fields.pop("data"))
            yield Event(int(fields.pop("id")), reported["state"], reported["progress"]["done"])
            assert not fields
    assert not fields


def references_in(node: Any) -> Iterator[str]:
    """Every $ref of a document, nested as it may be."""
    if isinstance(node, dict):
        if isinstance(node.get("$ref"), str):
            yield node["$ref"]
        for inner in node.values():
            yield from references_in(inner)
    elif isinstance(node, list):
        for inner in node:
            yield from references_in(inner)
