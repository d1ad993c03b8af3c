"""The OpenAPI document: whole, true of what the service takes and gives, with worked examples."""

import json
from collections import Counter
from functools import cache
from typing import Any
from unittest.mock import Mock

import jsonschema_rs
import pytest
import requests
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError
from schemathesis.config import SchemathesisConfig as Config

import syncplan
from api.job_kinds.job_table import JOB_KINDS
from api.main import create_app
from api.openapi import operations
from api.settings import load_settings
from syncplan.planning.plan_files import PlanFile
from syncplan.reports.plan_report import plan_document
from syncplan.runtime.files import as_text
from syncplan.scenario.loading import is_plan, scenario_from
from syncplan.scenario.specification import Scenario
from tests.tools.api_servers import openapi_document, references_in
from tests.tools.record_examples import BINARY, FOLDER, SCENARIO

SweepRequest = JOB_KINDS["sweep"].request

MEDIA = ("application/json", "application/yaml")
WITHOUT_BODY = {"204", "304"}
UNSECURED = {"checkHealth", "checkReadiness", "readScenarioSchema", "readPlanSchema"}
OPTIONAL = {"importPlaces", *(kind.operation for kind in JOB_KINDS.values() if kind.about)}
"""Operations whose body may be left out: their subject is stored, or sent as it is."""
NAMES = {"deletePlan", "deleteRecording", *(one.stem for one in FOLDER.glob("*.json"))}
"""Operations; those that answer with a body are named as the files of their examples."""

Tree = dict[str, Any]

DOCUMENT: Tree = openapi_document()
BY_NAME = {one["operationId"]: one for one in operations(DOCUMENT)}
REPEATED = [
    one[method]
    for one in DOCUMENT["paths"].values()
    for method in ("post", "patch")
    if method in one
]
"""Operations that take an Idempotency-Key."""


@cache
def _schema() -> Any:
    """The document as schemathesis reads it, which takes long."""
    return schemathesis.openapi.from_dict(DOCUMENT, config=Config())


def _faults(schema: Tree, value: object) -> list[str]:
    whole = {**schema, "components": DOCUMENT["components"]}
    return [str(one) for one in jsonschema_rs.validator_for(whole).iter_errors(value)]


def _answer(status: int, medium: str, body: object) -> schemathesis.Response:
    """An answer as schemathesis receives it."""
    headers = {"Content-Type": [medium]}
    request = requests.Request("GET", "http://service").prepare()
    content = json.dumps(body).encode()
    return schemathesis.Response(status, headers, content, request, elapsed=0.0, verify=True)


def test_operations_have_short_names_that_stay() -> None:
    assert set(BY_NAME) == NAMES


def test_references_lead_somewhere() -> None:
    for reference in set(references_in(DOCUMENT)):
        node: Any = DOCUMENT
        for part in reference.removeprefix("#/").split("/"):
            assert part in node, reference
            node = node[part]


def test_the_document_is_made_when_it_is_first_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    completed = Mock(return_value={})
    monkeypatch.setattr("api.openapi._completed", completed)
    app = create_app(load_settings(data_dir="/nowhere"))
    completed.assert_not_called()
    app.openapi()
    completed.assert_called_once()


@pytest.mark.parametrize("name", sorted(NAMES))
def test_every_answer_of_an_operation_has_a_true_example(name: str) -> None:
    for status, response in BY_NAME[name]["responses"].items():
        assert response["description"] not in ("", "Successful Response")
        if status in WITHOUT_BODY:
            assert "content" not in response
            continue
        medium, content = next(iter(response["content"].items()))
        if medium in BINARY:
            continue
        others = [one for one in response["content"] if one != medium]
        assert others == (["text/html"] if (name, status) == ("readJobResult", "200") else [])
        examples = [one["value"] for one in content.get("examples", {}).values()]
        examples += [content["example"]] if "example" in content else []
        if (name, status) == ("readJobResult", "200"):
            assert set(content["examples"]) == set(JOB_KINDS)
        assert examples, status
        known = _schema().find_operation_by_id(name)
        for example in examples:
            assert _faults(content["schema"], example) == []
            # the search for answers that are not as documented reads the document with schemathesis
            assert known.is_valid_response(_answer(int(status), medium, example))
        if int(status) >= 400:
            assert medium == "application/problem+json"
            assert {one["status"] for one in examples} == {int(status)}


def test_bodies_are_json_and_yaml_with_true_examples() -> None:
    bodies = {name: one["requestBody"] for name, one in BY_NAME.items() if "requestBody" in one}
    # the archives of recordings, and files of the field, have media of their own
    assert len(bodies) == 6 + len(JOB_KINDS)
    del bodies["createRecording"], bodies["importPlaces"]
    for name, body in bodies.items():
        assert body["required"] == (name not in OPTIONAL)
        assert tuple(body["content"]) == MEDIA
        for content in body["content"].values():
            assert content["examples"]
            for example in content["examples"].values():
                assert _faults(content["schema"], example["value"]) == []


def test_the_example_of_a_plan_is_the_librarys() -> None:
    plan = BY_NAME["createPlan"]
    given = plan["requestBody"]["content"]["application/json"]["examples"]["survey"]["value"]
    answers = plan["responses"]["201"]["content"]["application/json"]["examples"]
    shown = {**answers["survey"]["value"]}
    for added in ("id", "created_at", "parent_id"):
        del shown[added]
    made = json.loads(as_text(plan_document(syncplan.plan(scenario_from(given))).as_json()))
    # digests are of all digits, which differ from one processor to another
    for document in (made, shown):
        assert document["verdict"]["basis"]["digest"] == document["flight"]["digest"]
        document["verdict"] = {**document["verdict"], "basis": {**document["verdict"]["basis"]}}
        document["flight"] = {**document["flight"], "digest": ""}
        document["verdict"]["basis"]["digest"] = ""
    _check_same(made, shown, "plan")


def _check_same(one: Any, other: Any, where: str) -> None:
    """Numbers may differ in their last digits from one processor to another."""
    if isinstance(one, float) or isinstance(other, float):
        assert one == pytest.approx(other, rel=1e-6, abs=1e-6), where
    elif isinstance(one, dict | list) and type(one) is type(other):
        keys = list(one) if isinstance(one, dict) else range(len(one))
        assert keys == (list(other) if isinstance(other, dict) else range(len(other))), where
        for key in keys:
            _check_same(one[key], other[key], f"{where}.{key}")
    else:
        assert one == other, where


@pytest.mark.parametrize("name", sorted(NAMES - UNSECURED))
def test_secured_operations_say_so(name: str) -> None:
    operation = BY_NAME[name]
    assert operation["security"] == [{"ApiKey": []}]
    assert "WWW-Authenticate" in operation["responses"]["401"]["headers"]
    scheme = DOCUMENT["components"]["securitySchemes"]["ApiKey"]
    assert (scheme["type"], scheme["scheme"]) == ("http", "bearer")


@pytest.mark.parametrize("name", sorted(NAMES))
def test_headers_are_documented(name: str) -> None:
    responses = BY_NAME[name]["responses"]
    for status, response in responses.items():
        assert "X-Request-ID" in response["headers"], status
        if status in ("429", "503"):
            assert "Retry-After" in response["headers"]
        if status == "202" or status == "201":
            assert "Location" in response["headers"]
    if name in ("createPlan", "readPlan", "renamePlan"):
        assert all("ETag" in responses[one]["headers"] for one in responses if one < "400")
    named = {one["name"] for one in BY_NAME[name].get("parameters", [])}
    assert ("Idempotency-Key" in named) == (BY_NAME[name] in REPEATED)


def test_no_parameter_may_be_null_for_null_cannot_be_sent() -> None:
    for operation in BY_NAME.values():
        for parameter in operation.get("parameters", []):
            assert "null" not in json.dumps(parameter["schema"])


def test_the_limits_of_this_service_are_in_its_schemas() -> None:
    schemas = DOCUMENT["components"]["schemas"]
    assert schemas["ValidationRequest"]["properties"]["trials"]["maximum"] == 7777
    assert schemas["FlightRequest"]["properties"]["trials"]["maximum"] == 7777
    assert schemas["SweepRequest"]["properties"]["trials"]["maximum"] == 7777
    limit = schemas["RefinementRequest"]["properties"]["time_limit_s"]["anyOf"][0]
    assert limit["maximum"] == 600.0


@pytest.mark.parametrize(
    ("swept", "valid"),
    [
        ({}, False),
        ({"range_m": [50.0]}, True),
        ({"range_m": [50.0], "radius_m": None}, True),
        ({"range_m": []}, False),
        ({"range_m": None}, False),
        ({"range_m": [50.0], "radius_m": [20.0]}, False),
        ({"key": "wind.sigma_mps", "values": [1.0]}, True),
        ({"key": "wind.sigma_mps", "values": [1.0], "range_m": None}, True),
        ({"key": "wind.sigma_mps", "values": [1.0], "range_m": [50.0]}, False),
        ({"key": "wind.sigma_mps", "values": []}, False),
        ({"key": "wind.sigma_mps"}, False),
        ({"values": [1.0]}, False),
        ({"range_m": [50.0], "values": [1.0]}, False),
        ({"key": "wind.colour", "values": [1.0]}, False),
    ],
)
def test_the_schema_of_sweeps_wants_exactly_one_key(swept: Tree, valid: bool) -> None:
    request = {"scenario": SCENARIO, "trials": 1, **swept}
    assert (_faults({"$ref": "#/components/schemas/SweepRequest"}, request) == []) == valid
    assert (_faults_of(SweepRequest, request) == []) == valid


def _bodies(path: str) -> st.SearchStrategy[Any]:
    """Bodies that the document's schema of a POST allows."""
    bodies: st.SearchStrategy[Any] = _schema()[path]["POST"].as_strategy()
    return bodies


def test_a_preview_takes_what_a_plan_does() -> None:
    one, other = (BY_NAME[name]["requestBody"] for name in ("createPlan", "previewScenario"))
    assert (
        one["content"]["application/json"]["schema"]
        == (other["content"]["application/json"]["schema"])
    )


def _faults_of(model: type[BaseModel], body: object) -> list[Any]:
    try:
        model.model_validate(body)
    except ValidationError as error:
        return list(error.errors())
    return []


def _beyond_a_schema(fault: Any) -> bool:
    """A rule that spans keys, or a whole number written as 2.0: an integer to JSON Schema."""
    whole = isinstance(fault["input"], float) and fault["input"].is_integer()
    return fault["type"] == "rule" or (fault["type"] == "int_type" and whole)


@pytest.mark.parametrize(
    ("path", "model"),
    [
        ("/v1/plans", None),
        *((f"/v1{kind.study.path}", kind.request) for kind in JOB_KINDS.values()),
    ],
)
def test_what_the_schema_allows_breaks_no_rule_about_a_single_key(
    path: str, model: type[BaseModel] | None
) -> None:
    seen: Counter[str] = Counter()

    @given(case=_bodies(path))
    @settings(
        max_examples=30,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    def check(case: Any) -> None:
        if not isinstance(case.body, dict):
            return
        kind = model or (PlanFile if is_plan(case.body) else Scenario)
        seen[kind.__name__] += 1
        assert [fault for fault in _faults_of(kind, case.body) if not _beyond_a_schema(fault)] == []

    check()
    assert set(seen) == ({"PlanFile", "Scenario"} if model is None else {model.__name__})
    assert min(seen.values()) > (1 if model is None else 10)
