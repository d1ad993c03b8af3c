"""A full disk: readiness says what storing says, what is stored is read, also after a restart.

What fills it can be deleted.
"""

import contextlib
import time
from pathlib import Path

import httpx2
import psycopg
import pytest

from tests.tools.api_servers import problem
from tests.tools.busy_children import busy
from tests.tools.full_disk import fill, no_room, small_disk
from tests.tools.processes import wait_until
from tests.tools.record_examples import RECORDED
from tests.tools.recordings import zipped
from tests.tools.scenarios import document
from tests.tools.serving import Postgres, free_port, own_postgres
from tests.tools.survival import Site, quick, refinement, validation

pytestmark = pytest.mark.long


def see_only_reads_served(site: Site, plan_id: str, *statuses: int) -> None:
    """Fail unless nothing can be stored and readiness says so, and what is stored can be read."""
    reported: list[str] = []

    def nothing_stored() -> bool:
        # what room is left inside the files is used up first
        answer = site.ask("POST", "/v1/plans", json=document())
        if answer.status_code == 201:
            site.plans[answer.json()["id"]] = answer.text
            return False
        assert answer.status_code in statuses
        reported.append(problem(answer, answer.status_code).detail)
        return site.ask("GET", "/readyz").status_code == 503

    wait_until(nothing_stored, otherwise=site.logs)
    assert "storage is full" in reported[-1] or 503 in statuses
    assert (
        problem(site.ask("GET", "/readyz"), 503).detail
        == f"{reported[-1]}; what is stored can be read"
    )
    for path in ("/v1/plans", f"/v1/plans/{plan_id}", "/v1/jobs", "/healthz"):
        assert site.ask("GET", path).status_code == 200, path


def see_all_served(site: Site) -> None:
    """Fail unless plans and jobs are taken again, and done."""
    wait_until(lambda: site.ask("GET", "/readyz").status_code == 200, otherwise=site.logs)
    site.hand_in(validation(10, 0))
    site.see_all_done()


def test_readiness_says_that_nothing_can_be_stored(tmp_path: Path) -> None:
    with quick(tmp_path) as site:
        server = site.serve()
        plan_id = site.hand_in_plan()
        with no_room(server.popen.pid):
            see_only_reads_served(site, plan_id, 503, 507)
        see_all_served(site)


def test_readiness_says_that_postgresql_is_read_only(tmp_path: Path, postgres: Postgres) -> None:
    address = postgres.new_database()
    name = address.rpartition("/")[2]
    with quick(tmp_path, address) as site:
        site.serve("--no-worker")
        plan_id = site.hand_in_plan()
        with psycopg.connect(postgres.url, autocommit=True) as connection:

            def only_read(yes: bool) -> None:
                connection.execute(
                    f"ALTER DATABASE {name} SET default_transaction_read_only = {yes}"
                )
                # the setting is for connections to come
                connection.execute(
                    "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = %s",
                    [name],
                )

            only_read(True)
            see_only_reads_served(site, plan_id, 503)
            only_read(False)
        site.work()
        see_all_served(site)


def test_a_restart_on_a_full_disk_serves_what_is_stored(tmp_path: Path) -> None:
    with small_disk() as disk, quick(tmp_path, SYNCPLAN_DATA_DIR=str(disk / "data")) as site:
        server = site.serve()
        plan_id = site.hand_in_plan()
        site.hand_in(validation(10, 0), plan_id)
        site.kill(server)
        ballast = fill(disk)
        port = free_port()
        site.url = f"http://127.0.0.1:{port}"
        site.begin("serve", "--port", str(port))

        def answers() -> bool:
            with contextlib.suppress(httpx2.TransportError):
                return site.ask("GET", "/healthz").status_code == 200
            return False

        wait_until(answers, otherwise=site.logs)
        see_only_reads_served(site, plan_id, 507)
        ballast.unlink()
        see_all_served(site)


def test_what_is_stored_on_a_full_disk_can_be_deleted(tmp_path: Path) -> None:
    with small_disk() as disk, quick(tmp_path, SYNCPLAN_DATA_DIR=str(disk / "data")) as site:
        site.serve()
        plan_ids = [site.hand_in_plan("pair") for _ in range(10)]
        job_id = site.hand_in(validation(10, 0))
        site.wait_for(job_id, "succeeded")
        archive = zipped({f"hall/{name}": text.encode() for name, text in RECORDED.items()})
        zipped_type = {"content-type": "application/zip"}
        kept = site.ask("POST", "/v1/recordings", content=archive, headers=zipped_type)
        ballast = fill(disk)
        see_only_reads_served(site, plan_ids[0], 507)
        stored = [f"/v1/plans/{plan_id}" for plan_id in plan_ids]
        for path in (kept.headers["location"], f"/v1/jobs/{job_id}", *stored):
            assert site.ask("DELETE", path).status_code == 204, path
            problem(site.ask("GET", path), 404)
        # there is room for as much again
        wait_until(
            lambda: site.ask("POST", "/v1/plans", json=document()).status_code == 201,
            otherwise=site.logs,
        )
        ballast.unlink()
        site.wait_for(site.hand_in(validation(10, 0)), "succeeded")


@pytest.mark.parametrize("kind", ["sqlite", "postgresql"])
def test_jobs_that_a_full_disk_meets_wait_until_there_is_room(tmp_path: Path, kind: str) -> None:
    with contextlib.ExitStack() as opened:
        disk = opened.enter_context(small_disk())
        if kind == "sqlite":
            site = quick(tmp_path, SYNCPLAN_DATA_DIR=str(disk / "data"))
        else:
            # a server of its own, whose tables alone are there and go with the small disk: one
            # that can't write its log stops by itself
            postgres = opened.enter_context(own_postgres())
            site = quick(tmp_path, postgres.new_database(postgres.folder_for(disk / "tables")))
        opened.enter_context(site)
        server = site.serve()
        plan_id = site.hand_in_plan()
        site.hand_in(validation(2400, 1), plan_id)
        site.hand_in(refinement(0))
        busy(site, server, 2)
        ballast = fill(disk)
        see_only_reads_served(site, plan_id, 507)
        # long enough for what was under way to want to be stored
        time.sleep(5.0)
        assert server.popen.poll() is None
        ballast.unlink()
        site.see_all_done()
