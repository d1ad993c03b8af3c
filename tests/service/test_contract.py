"""The example of a plan in the OpenAPI document; `search_contract` is for all that it says."""

from collections.abc import Iterator
from typing import Any

import httpx2
import pytest

from tests.searches.search_contract import KEY, SMALL_JOBS
from tests.tools.serving import Server, running

QUICK = {**SMALL_JOBS, "SYNCPLAN_PROCESSES": "1"}
"""Settings of a service that is soon ready."""
TOLERANCE = 1e-6


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("contract")
    server = Server(folder / "log", port=None, SYNCPLAN_DATA_DIR=str(folder), **QUICK)
    with running(server):
        yield server


@pytest.mark.long
def test_the_example_of_a_plan_is_what_the_service_answers(server: Server) -> None:
    document = httpx2.get(f"{server.url}/openapi.json").json()
    operation = document["paths"]["/v1/plans"]["post"]
    given = operation["requestBody"]["content"]["application/json"]["examples"]["survey"]
    answered = operation["responses"]["201"]["content"]["application/json"]["examples"]["survey"]
    response = httpx2.post(
        f"{server.url}/v1/plans", json=given["value"], headers={"authorization": f"Bearer {KEY}"}
    )
    assert response.status_code == 201
    for one in (plan := response.json()), answered["value"]:
        del one["id"], one["created_at"]
    _check_same(plan, answered["value"], "plan")


def _check_same(one: Any, other: Any, where: str) -> None:
    """Numbers may differ in their last digits from one processor to another."""
    if isinstance(one, float) or isinstance(other, float):
        assert one == pytest.approx(other, rel=TOLERANCE, abs=TOLERANCE), where
    elif isinstance(one, dict) and isinstance(other, dict):
        assert list(one) == list(other), where
        for key in one:
            _check_same(one[key], other[key], f"{where}.{key}")
    elif isinstance(one, list) and isinstance(other, list):
        assert len(one) == len(other), where
        for k, (left, right) in enumerate(zip(one, other, strict=True)):
            _check_same(left, right, f"{where}[{k}]")
    else:
        assert one == other, where
