"""Requests of one owner never starve another's, wait too long, or outlive their client."""

import time
from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest

from tests.tools.api_servers import key_of, problem, serving, speaking
from tests.tools.processes import family, memory_given_back, wait_until
from tests.tools.raw_connections import answered, crowd_of, request_of
from tests.tools.scenarios import document, shared_circles
from tests.tools.serving import QUICK, Server

pytestmark = pytest.mark.long

FLOOD = 60


def planning(owner: str, per_circle: int) -> bytes:
    """An owner's request for a plan that takes long."""
    return request_of("/v1/plans", key_of(owner), shared_circles(per_circle))


@pytest.fixture(scope="module")
def narrow(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server that takes few requests and plans of an owner, and keeps plans for seconds."""
    settings = {
        **QUICK,
        "SYNCPLAN_MAX_REQUESTS": "5",
        "SYNCPLAN_MAX_PLAN_QUEUE": "6",
        "SYNCPLAN_MAX_PLANS": "3",
        "SYNCPLAN_KEEP_PLANS_S": "5",
    }
    with serving(tmp_path_factory.mktemp("narrow"), "ann eve lea", **settings) as one:
        yield one


def test_an_owner_with_many_requests_delays_another_by_one(
    server: Server, ann: httpx2.Client
) -> None:
    with (
        memory_given_back(server.popen.pid),
        crowd_of(server, FLOOD, planning("eve", 2)) as flood,
    ):
        wait_until(lambda: answered(flood) >= 1)
        answer = ann.post("/v1/plans", json=document())
        assert answer.status_code == 201, answer.text
        # in the order of their arrival, all would have been answered first
        assert answered(flood) < FLOOD // 2


def test_an_owner_has_a_limited_number_of_requests_and_leaves_room_for_others(
    narrow: Server,
) -> None:
    with speaking(narrow, "ann") as ann, speaking(narrow, "eve") as eve:
        ann.post("/v1/plans", json=document())
        with (
            memory_given_back(narrow.popen.pid),
            crowd_of(narrow, 5 + FLOOD, planning("eve", 4)) as flood,
        ):
            wait_until(lambda: answered(flood) >= FLOOD)
            refused = eve.post("/v1/plans", json=document())
            assert "5 requests in progress" in problem(refused, 429).detail
            assert int(refused.headers["retry-after"]) >= 1
            assert ann.post("/v1/plans", json=document()).status_code == 201
            assert eve.get("/v1/plans").status_code == 200


def test_an_owner_stores_a_limited_number_of_plans_until_they_expire(narrow: Server) -> None:
    with speaking(narrow, "lea") as lea, speaking(narrow, "eve") as eve:
        answers = [lea.post("/v1/plans", json=document()) for _ in range(4)]
        assert [one.status_code for one in answers] == [201, 201, 201, 507]
        assert "3 stored plans" in problem(answers[3], 507).detail
        assert eve.post("/v1/plans", json=document()).status_code == 201
        assert lea.post("/v1/previews", json=document()).status_code == 200
        assert lea.delete(answers[0].headers["location"]).status_code == 204
        assert lea.post("/v1/plans", json=document()).status_code == 201
        wait_until(lambda: lea.get("/v1/plans").json()["items"] == [])


def test_a_request_is_given_up_on_time_though_it_waited(tmp_path: Path) -> None:
    limit = 6.0
    with (
        serving(tmp_path, "ann", SYNCPLAN_PLAN_TIMEOUT_S=str(limit)) as server,
        speaking(server, "ann") as ann,
    ):
        ann.post("/v1/plans", json=document())
        with (
            memory_given_back(server.popen.pid),
            crowd_of(server, 1, planning("ann", 8)) as first,
        ):
            # the second gets its turn before its time is over, and not all of that time again
            time.sleep(limit / 2)
            began = time.monotonic()
            answer = ann.post("/v1/plans", json=shared_circles(8))
            assert time.monotonic() - began < 1.4 * limit
            assert answered(first) == 1
        assert answer.status_code in {422, 503}


def test_what_clients_who_went_away_asked_for_is_not_computed(
    server: Server, ann: httpx2.Client
) -> None:
    children = family(server.popen.pid)
    with memory_given_back(server.popen.pid):
        for _ in range(2):
            with crowd_of(server, FLOOD // 2, planning("ann", 4)):
                # all have been read: an answer to a later request says so
                assert ann.get("/v1/plans").status_code == 200
    # computed, they would take minutes
    began = time.monotonic()
    assert ann.post("/v1/plans", json=document()).status_code == 201
    waited = time.monotonic() - began
    began = time.monotonic()
    assert ann.post("/v1/plans", json=shared_circles(4)).status_code == 201
    assert waited < 5 * (time.monotonic() - began)
    # nor were processes killed and begun by the dozen
    assert len(set(family(server.popen.pid)) - set(children)) <= 3
