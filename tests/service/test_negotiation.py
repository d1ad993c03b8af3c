"""Negotiation: what a client accepts, and how its body is written."""

from typing import Annotated, Literal

import pytest
from fastapi import Depends, FastAPI, Request
from fastapi.testclient import TestClient

from api.calls import accepts, body_kind
from tests.tools.api_apps import ask, bare_app, served

PLAN, EVENTS = "application/json", "text/event-stream"


def _app() -> FastAPI:
    app = bare_app()

    @app.get("/plan")
    def plan(medium: Annotated[str, Depends(accepts(PLAN, EVENTS))]) -> str:
        return medium

    @app.post("/body")
    async def body(
        request: Request, kind: Annotated[Literal["json", "yaml"], Depends(body_kind)]
    ) -> str:
        await request.body()
        return kind

    return app


@pytest.fixture(scope="module")
def client() -> TestClient:
    return TestClient(_app())


@pytest.mark.parametrize(
    ("header", "medium"),
    [
        # excluded: a problem
        ("text/html", None),
        ("application/json;q=0, text/event-stream;q=0.000", None),
        ("*/*;q=0", None),
        ("application/*;q=0, text/html", None),
        ("application/json", PLAN),
        ("APPLICATION/JSON; charset=utf-8", PLAN),
        ("text/event-stream", EVENTS),
        ("*/*", PLAN),
        ("text/*", EVENTS),
        ("application/json;q=0.5, text/*;q=0.8", EVENTS),
        ("application/json;q=0, */*", EVENTS),
        ("application/*;q=0.2, application/json;q=0.9, text/event-stream;q=0.5", PLAN),
        ("text/html, */*;q=0.001", PLAN),
        (" , ,", PLAN),
        # what can't be read accepts everything
        ("*/json", PLAN),
        ("text/html;q=2", PLAN),
        ("text/html;;q=0.1;=", PLAN),
        ("text/html, */", PLAN),
        ("t\u00e9xt/html", PLAN),
    ],
)
def test_the_best_of_what_is_accepted_is_chosen(
    client: TestClient, header: str, medium: str | None
) -> None:
    response = client.get("/plan", headers={b"accept": header.encode()})
    if medium is None:
        assert response.status_code == 406
        assert response.headers["content-type"] == "application/problem+json"
        assert "application/json and text/event-stream" in response.json()["detail"]
    else:
        assert (response.status_code, response.json()) == (200, medium)


def test_several_headers_count_as_one_and_none_accepts_everything(client: TestClient) -> None:
    headers = [("accept", "text/html"), ("accept", "text/event-stream")]
    assert client.get("/plan", headers=headers).json() == EVENTS
    with served(_app()) as port:
        assert ask(port, "GET", "/plan").content == b'"application/json"'
        # only an empty body needs no type
        assert ask(port, "POST", "/body").status_code == 200
        assert ask(port, "POST", "/body", content=b"{}").status_code == 415
        assert ask(port, "POST", "/body", content=iter([b"{}"])).status_code == 415


@pytest.mark.parametrize(
    ("given", "kind"),
    [
        ("Application/JSON; Charset=UTF-8", "json"),
        ('application/json;charset="utf-8"', "json"),
        ("application/json; charset=us-ascii; version=1", "json"),
        ("application/vnd.syncplan.scenario+json", "json"),
        ("application/yaml", "yaml"),
        ("text/yaml; charset=utf8", "yaml"),
        ("application/x-yaml", "yaml"),
    ],
)
def test_json_and_yaml_are_known_by_their_types(client: TestClient, given: str, kind: str) -> None:
    response = client.post("/body", content=b"{}", headers={"content-type": given})
    assert (response.status_code, response.json()) == (200, kind)


@pytest.mark.parametrize(
    "given",
    [
        "text/plain",
        "text/json",
        "application/jsonp",
        "application/+json",
        "application/a b+json",
        "image/svg+json",
        "application/json; charset=latin-1",
        "application/json; charset=",
        ";",
    ],
)
def test_anything_else_is_a_415_problem(client: TestClient, given: str) -> None:
    response = client.post("/body", content=b"{}", headers={"content-type": given})
    assert response.status_code == 415
    assert response.headers["content-type"] == "application/problem+json"
    assert response.headers["accept"] == "application/json, application/yaml"
    assert response.json()["detail"].startswith(given)


def test_a_compressed_body_and_one_of_two_types_are_415_problems(client: TestClient) -> None:
    for coding, status in (("gzip", 415), ("identity", 200)):
        headers = {"content-type": "application/json", "content-encoding": coding}
        assert client.post("/body", content=b"{}", headers=headers).status_code == status
    types = [("content-type", "application/json"), ("content-type", "text/yaml")]
    assert client.post("/body", content=b"{}", headers=types).status_code == 415
