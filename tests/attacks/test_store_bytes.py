"""Storage of one owner: bounded whatever it is filled with, and nobody else is affected."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest
from sqlalchemy import create_engine

from api.settings import sqlite_address
from tests.tools.api_servers import planned, problem, serving, speaking
from tests.tools.owner_sums import summed_bytes
from tests.tools.scenarios import LANDMARKS, document

MOST = 2_000_000
"""Bytes that an owner may keep here."""

RENAMES = 150
CANCELLED = 40
SLACK = 8_000_000
"""Bytes of empty tables and of SQLite's log."""

LARGE = document(
    formation={"centers_m": [[70.0 * k, 0.0] for k in range(150)]}, landmarks_m=LANDMARKS
)


class Kept:
    """A service, the connections of two owners, and the files of its database."""

    def __init__(self, folder: Path, ann: httpx2.Client, bob: httpx2.Client) -> None:
        self.folder = folder
        self.ann = ann
        self.bob = bob

    def size(self) -> int:
        """Return the bytes of the database on the disk."""
        return sum(file.stat().st_size for file in self.folder.glob("syncplan.db*"))

    def summed(self, owner: str) -> dict[str, int]:
        """Return the bytes of an owner by kind, summed over the tables."""
        engine = create_engine(sqlite_address(self.folder / "syncplan.db"))
        with engine.connect() as connection:
            sums = summed_bytes(connection)[owner]
        engine.dispose()
        return {kind: sums[kind] for kind in ("plans", "jobs", "answers", "recordings")}

    def used(self) -> dict[str, int]:
        """Return the bytes that ann keeps, as the service reports them."""
        usage: dict[str, Any] = self.ann.get("/v1/usage").json()
        assert usage["max_bytes"] == MOST
        bytes_by_kind: dict[str, int] = usage["bytes"]
        return bytes_by_kind


@pytest.fixture
def kept(tmp_path: Path) -> Iterator[Kept]:
    """A service that keeps little, and runs no jobs."""
    settings = {"SYNCPLAN_MAX_OWNER_BYTES": str(MOST)}
    with (
        serving(tmp_path, "ann bob", "--no-worker", **settings) as server,
        speaking(server, "ann") as ann,
        speaking(server, "bob") as bob,
    ):
        yield Kept(tmp_path / "data", ann, bob)


@pytest.fixture
def plan(kept: Kept) -> str:
    """Path of a large plan of ann's."""
    answer = kept.ann.post("/v1/plans?paper=true", json=LARGE)
    assert answer.status_code == 201
    assert len(answer.content) > 100_000
    return answer.headers["location"]


def filled(kept: Kept, plan: str) -> httpx2.Response:
    """Rename a plan under new keys until that is refused; return the refusal."""
    for number in range(RENAMES):
        headers = {"idempotency-key": f"rename-{number}"}
        answer = kept.ann.patch(plan, json={"name": f"name {number}"}, headers=headers)
        if answer.status_code != 200:
            return answer
    raise AssertionError(f"{RENAMES} renames were stored: {kept.size()} bytes")


def test_answers_under_keys_count_for_their_owner(kept: Kept, plan: str) -> None:
    before = kept.size()
    refused = problem(filled(kept, plan), 507)
    assert f"the most allowed is {MOST} (SYNCPLAN_MAX_OWNER_BYTES)" in refused.detail
    assert kept.size() < before + MOST + SLACK
    used = kept.used()
    assert used == kept.summed("ann")
    assert used["answers"] > MOST / 2


def test_a_cancelled_job_keeps_no_copy_of_its_plan(kept: Kept, plan: str) -> None:
    before = kept.used()["jobs"]
    for _ in range(CANCELLED):
        job = kept.ann.post(f"{plan}/validations", json={"trials": 100}).headers["location"]
        assert kept.used()["jobs"] - before > 100_000
        assert kept.ann.post(f"{job}/cancel").json()["state"] == "cancelled"
    used = kept.used()
    assert used == kept.summed("ann")
    assert used["jobs"] - before < CANCELLED * 5_000


def test_plans_jobs_and_recordings_of_a_full_owner_are_refused_until_some_are_deleted(
    kept: Kept, plan: str
) -> None:
    jobs = [
        kept.ann.post(f"{plan}/validations", json={"trials": 100}).headers["location"]
        for _ in range(2)
    ]
    assert kept.ann.post(f"{jobs[0]}/cancel").status_code == 200
    filled(kept, plan)
    while (answer := kept.ann.post("/v1/plans", json=document())).status_code == 201:
        pass
    problem(answer, 507)
    full = kept.used()
    assert full == kept.summed("ann")
    problem(kept.ann.post(f"{plan}/validations", json={"trials": 100}), 507)
    problem(kept.ann.post("/v1/sweeps", json={"scenario": LARGE, "range_m": [50.0]}), 507)
    problem(kept.ann.patch(plan, json={"name": "n" * 200}), 507)
    assert kept.ann.get(plan).status_code == 200
    # nobody else notices
    planned(kept.bob)
    # room can be made, and takes none
    for number in range(RENAMES):
        headers = {"idempotency-key": f"cancel-{number}"}
        assert kept.ann.post(f"{jobs[0]}/cancel", headers=headers).status_code == 200
    assert kept.used() == full
    assert kept.ann.post(f"{jobs[1]}/cancel").json()["state"] == "cancelled"
    assert kept.ann.delete(jobs[1]).status_code == 204
    assert kept.ann.delete(plan).status_code == 204
    planned(kept.ann)
    assert kept.used() == kept.summed("ann")
    assert sum(kept.used().values()) < MOST
