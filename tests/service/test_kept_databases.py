"""Databases that released versions have left: all that was there is served, what waited is done."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.tools.kept_databases import kept, restore_postgresql, restore_sqlite
from tests.tools.record_database import ASKED, HALF_DONE, IDEMPOTENCY, QUEUED, states_of
from tests.tools.survival import (
    Site,
    quick,
    refinement,
    sweep_of_ranges,
    validation,
)


def restored(kind: str, tmp_path: Path, request: pytest.FixtureRequest) -> Site:
    """A service, not yet started, on what was kept."""
    settings = {
        # what has ended was kept long ago
        "SYNCPLAN_KEEP_JOBS_S": "1e9",
        "SYNCPLAN_KEEP_ANSWERS_S": "1e9",
        # jobs of a version that nobody runs any more need not wait for it
        "SYNCPLAN_VERSION_GRACE_S": "0.5",
    }
    if kind == "sqlite":
        data = tmp_path / "data"
        data.mkdir()
        restore_sqlite(data / "syncplan.db")
        return quick(tmp_path, **settings)
    address = request.getfixturevalue("postgres").new_database()
    restore_postgresql(address)
    return quick(tmp_path, address, **settings)


@pytest.mark.parametrize("kind", ["sqlite", pytest.param("postgresql", marks=pytest.mark.long)])
@pytest.mark.long
def test_what_version_1_has_kept_is_served_as_it_was(
    kind: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    said: dict[str, Any] = json.loads(kept(f"{kind}.json.gz"))
    with restored(kind, tmp_path, request) as site:
        before = {state for state, _ in states_of(site.database).values()}
        assert before == {"queued", "running", "succeeded", "failed", "cancelled"}
        site.serve("--no-worker")
        for path, answer in said["answers"].items():
            assert site.ask("GET", path, headers=ASKED).text == answer, path
        repeated = said["repeated"]
        again = site.ask("POST", repeated["path"], json=repeated["body"], headers=IDEMPOTENCY)
        assert (again.status_code, again.text) == (202, repeated["answer"])
        assert site.count("plans") == len(said["plans"]) + 1


@pytest.mark.long
@pytest.mark.parametrize("kind", ["postgresql"])
def test_jobs_that_version_1_has_not_finished_are_finished(
    kind: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    said: dict[str, Any] = json.loads(kept(f"{kind}.json.gz"))
    with restored(kind, tmp_path, request) as site:
        assert states_of(site.database)[said["half_done"]][1] > 0
        site.serve("--no-worker")
        site.work()
        # version 1 has named the filter in each job, in its own words
        named = "arc"
        orders = [validation(**QUEUED, model=named), refinement(0), sweep_of_ranges(20, 3)]
        site.jobs = dict(zip(said["queued"], orders, strict=True))
        site.jobs[said["half_done"]] = validation(**HALF_DONE, model=named)
        site.see_results()
        site.see_nothing_left()
