"""A worker whose clock is eight days ahead deletes nothing and puts nothing out of order."""

from pathlib import Path

import pytest
from sqlalchemy import create_engine, text

from tests.tools.processes import wait_until
from tests.tools.survival import Site, quick, refinement, validation
from tests.tools.wrong_clock import AHEAD_S, clock_ahead

END_LONG_AGO = "UPDATE jobs SET ended_at = '2020-01-01T00:00:00.000000Z' WHERE id = :id"
TOUCH = "UPDATE jobs SET kind = kind WHERE id = :id"


def change(site: Site, statement: str, job_id: str) -> int:
    """Change the row of a job behind the service's back; returns how many rows there were."""
    engine = create_engine(site.database)
    with engine.begin() as connection:
        changed = connection.execute(text(statement), {"id": job_id}).rowcount
    engine.dispose()
    return changed


@pytest.mark.long
@pytest.mark.parametrize("ahead_s", [-AHEAD_S])
def test_lists_are_in_order_though_a_worker_has_a_wrong_clock(
    tmp_path: Path, ahead_s: float
) -> None:
    with quick(tmp_path) as site:
        site.serve("--no-worker")
        first = site.hand_in_plan("pair")
        site.begin("worker", **clock_ahead(tmp_path / "wrong", ahead_s))
        job_id = site.hand_in(refinement(0), first)
        result = site.wait_for(job_id, "succeeded", "failed")["result"]
        refined = site.ask("GET", result).json()["id"]
        last = site.hand_in_plan("pair")
        listed = site.ask("GET", "/v1/plans").json()["items"]
        assert [one["id"] for one in listed] == [last, refined, first]
        made = [one["created_at"] for one in listed]
        assert made == sorted(made, reverse=True)


@pytest.mark.long
@pytest.mark.parametrize("address", ["postgresql"], indirect=True)
def test_results_are_kept_though_a_worker_has_a_wrong_clock(
    address: str | None, tmp_path: Path
) -> None:
    with quick(tmp_path, address) as site:
        server = site.serve("--no-worker")
        worker = site.work()
        old, kept = (site.hand_in(validation(10, seed)) for seed in (0, 1))
        for job_id in (old, kept):
            site.wait_for(job_id, "succeeded")
        site.kill(worker)
        site.kill(server)
        # the worker is the only one that deletes, and has begun to once this job is gone
        assert change(site, END_LONG_AGO, old) == 1
        site.begin("worker", **clock_ahead(tmp_path / "wrong"))
        wait_until(lambda: change(site, TOUCH, old) == 0, otherwise=site.logs)
        site.serve("--no-worker")
        assert site.job(kept)["state"] == "succeeded"
