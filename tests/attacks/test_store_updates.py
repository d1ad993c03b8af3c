"""Writes that meet at one moment, on both databases, and a clock that is set back.

A plan changes for one of those that name its tag, equal requests get one answer, and what is stored
last is listed first.
"""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import httpx2
import pytest
from sqlalchemy import Connection, select, update

from api.settings import load_settings
from api.storage.database import Database, open_database
from api.storage.tables import earlier, moment, new_id, plans
from tests.tools.api_servers import done, planned, problem, serving, speaking
from tests.tools.record_examples import RECORDED
from tests.tools.recordings import zipped
from tests.tools.scenarios import document
from tests.tools.serving import Postgres, Server

AT_ONCE = 8
A_DAY_S = 86400.0
UNDER_WAY_S = 1.0
"""How long a request is given to read what it is about before what it waits for is over."""

ZIP = {"content-type": "application/zip"}
ARCHIVE = zipped({f"hall/{name}": text.encode() for name, text in RECORDED.items()})

pytestmark = pytest.mark.long


@pytest.fixture(scope="module", params=["sqlite", "postgresql"])
def served(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[Server, Database]]:
    """A service with room for a few holdings of each owner, and its database."""
    folder = tmp_path_factory.mktemp("updates")
    limits = {"MAX_PLANS": "3", "MAX_QUEUED_JOBS": "1", "MAX_RECORDINGS": "1"}
    settings = {f"SYNCPLAN_{name}": value for name, value in limits.items()}
    address = load_settings(data_dir=folder / "data").database
    if request.param == "postgresql":
        postgres: Postgres = request.getfixturevalue("postgres")
        settings["SYNCPLAN_DATABASE_URL"] = postgres.new_database()
        address = load_settings(database_url=settings["SYNCPLAN_DATABASE_URL"]).database
    with serving(folder, "ann bob cat dan", **settings) as server:
        database = open_database(address)
        yield server, database
        database.close()


@contextmanager
def held(database: Database, plan_id: str) -> Iterator[Connection]:
    """A transaction that holds a plan, until the requests sent meanwhile wait for it."""
    with database.writing() as connection:
        connection.execute(select(plans.c.id).where(plans.c.id == plan_id).with_for_update())
        yield connection
        time.sleep(UNDER_WAY_S)


def at_once(
    threads: ThreadPoolExecutor, ask: Callable[[int], httpx2.Response]
) -> Iterator[httpx2.Response]:
    """Send requests that differ by a number at the same moment."""
    return threads.map(ask, range(AT_ONCE))


def test_one_of_several_renames_at_once_finds_the_tag(served: tuple[Server, Database]) -> None:
    server, database = served
    with speaking(server, "ann") as ann, ThreadPoolExecutor(AT_ONCE) as threads:
        plan_id = planned(ann)["id"]
        at = f"/v1/plans/{plan_id}"
        headers = {"if-match": ann.get(at).headers["etag"]}
        with held(database, plan_id):
            sent = at_once(threads, lambda k: ann.patch(at, json={"name": str(k)}, headers=headers))
        answers = list(sent)
        renamed = [answer for answer in answers if answer.status_code == 200]
        assert len(renamed) == 1
        for answer in answers:
            if answer is not renamed[0]:
                assert renamed[0].headers["etag"].strip('"') in problem(answer, 412).detail
        assert ann.get(at).content == renamed[0].content


def test_a_rename_keeps_its_plan_from_a_deletion_that_names_the_tag_before(
    served: tuple[Server, Database],
) -> None:
    server, database = served
    with speaking(server, "bob") as bob, ThreadPoolExecutor(AT_ONCE) as threads:
        plan_id = planned(bob)["id"]
        at = f"/v1/plans/{plan_id}"
        headers = {"if-match": bob.get(at).headers["etag"]}
        with held(database, plan_id) as connection:
            connection.execute(
                update(plans).where(plans.c.id == plan_id).values(name="new", etag="0" * 64)
            )
            sent = at_once(threads, lambda _: bob.delete(at, headers=headers))
        for answer in sent:
            assert "0" * 64 in problem(answer, 412).detail
        assert bob.get(at).status_code == 200
        with held(database, plan_id):
            sent = at_once(threads, lambda _: bob.delete(at))
        assert sorted(answer.status_code for answer in sent) == [204, *[404] * (AT_ONCE - 1)]


def test_equal_requests_at_once_get_one_answer_where_the_first_takes_the_last_room(
    served: tuple[Server, Database],
) -> None:
    server, database = served

    def see_same(sent: Iterator[httpx2.Response], status: int) -> None:
        answers = list(sent)
        assert {answer.status_code for answer in answers} == {status}
        assert len({(answer.content, answer.headers.get("location")) for answer in answers}) == 1

    with speaking(server, "cat") as cat, ThreadPoolExecutor(AT_ONCE) as threads:
        plan = planned(cat)
        planned(cat)
        at, long = f"/v1/plans/{plan['id']}", {"trials": 5000, "seed": 1}
        with held(database, plan["id"]):
            key = {"idempotency-key": "job"}
            sent = at_once(threads, lambda _: cat.post(f"{at}/validations", json=long, headers=key))
        see_same(sent, 202)
        problem(cat.post(f"{at}/validations", json=long), 429)
        job = cat.get("/v1/jobs").json()["items"][0]["id"]
        cat.post(f"/v1/jobs/{job}/cancel")
        with held(database, plan["id"]):
            key = {"idempotency-key": "plan"}
            sent = at_once(threads, lambda _: cat.post("/v1/plans", json=document(), headers=key))
        see_same(sent, 201)
        problem(cat.post("/v1/plans", json=document()), 507)
        renamed = {"if-match": cat.get(at).headers["etag"], "idempotency-key": "rename"}
        with held(database, plan["id"]):
            sent = at_once(threads, lambda _: cat.patch(at, json={"name": "n"}, headers=renamed))
        see_same(sent, 200)
        with held(database, plan["id"]):
            key = {"idempotency-key": "recording", **ZIP}
            # as many as one owner may send at once
            sent = threads.map(
                lambda _: cat.post("/v1/recordings", content=ARCHIVE, headers=key), range(2)
            )
        see_same(sent, 201)
        problem(cat.post("/v1/recordings", content=ARCHIVE, headers=ZIP), 507)


def test_what_is_stored_after_the_clock_was_set_back_is_listed_first(
    served: tuple[Server, Database],
) -> None:
    server, database = served

    def listed(http: httpx2.Client, path: str) -> list[str]:
        identifiers, following = [], f"{path}?limit=1"
        while following:
            page = http.get(following).json()
            identifiers += [entry["id"] for entry in page["items"]]
            following = page["next"]
        return identifiers

    def set_ahead(plan_id: str) -> str:
        """Let a plan have been stored while the clock was a day ahead."""
        with database.writing() as connection:
            ahead = new_id(earlier(moment(connection), -A_DAY_S))
            connection.execute(update(plans).where(plans.c.id == plan_id).values(id=ahead))
        return ahead

    with speaking(server, "dan") as dan:
        ahead = set_ahead(planned(dan)["id"])
        at = f"/v1/plans/{ahead}"
        then = planned(dan)["id"]
        assert listed(dan, "/v1/plans") == [then, ahead]
        refined = dan.post(f"{at}/refinements", json={"starts": 1}).headers["location"]
        done(dan, refined)
        refined_id = dan.get(f"{refined}/result").json()["id"]
        assert listed(dan, "/v1/plans") == [refined_id, then, ahead]
        # a page that was asked for before stays what it was
        page = dan.get(f"/v1/plans?before={then}").json()["items"]
        assert [entry["id"] for entry in page] == [ahead]
