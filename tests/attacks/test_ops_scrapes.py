"""Scrapes of the metrics while the database hangs: they hold up neither each other nor requests."""

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx2
import psycopg
import pytest

from api.storage.database import BUSY_S
from tests.tools.processes import PATIENCE_S
from tests.tools.serving import NO_CERTIFICATES, Postgres, open_server

SCRAPES = 60
"""More than the 40 threads that answer requests."""

pytestmark = pytest.mark.long


def test_scrapes_of_a_locked_table_leave_room_for_requests(
    postgres: Postgres, tmp_path: Path
) -> None:
    """A backup or a migration locks tables; each scrape used to wait for them in a thread."""
    address = postgres.new_database()

    def asked(path: str) -> tuple[int, float]:
        began = time.monotonic()
        url = f"{server.url}{path}"
        status = httpx2.get(url, timeout=PATIENCE_S, verify=NO_CERTIFICATES).status_code
        return status, time.monotonic() - began

    with (
        open_server(tmp_path, "--no-worker", SYNCPLAN_DATABASE_URL=address) as server,
        psycopg.connect(address) as other,
        ThreadPoolExecutor(SCRAPES + 1) as clients,
    ):
        # the first readings, and what they load
        assert asked("/metrics")[0] == 200
        time.sleep(1.1)
        other.execute("LOCK TABLE jobs IN ACCESS EXCLUSIVE MODE")
        scrapes = [clients.submit(asked, "/metrics") for _ in range(SCRAPES)]
        time.sleep(0.5)
        status, took_s = asked("/v1/plans")
        answers = [one.result() for one in scrapes]
        other.rollback()
    print(f"a list of plans took {took_s:.2f} s, scrapes {max(s for _, s in answers):.2f} s")
    assert status == 200
    assert {one for one, _ in answers} == {200}
    # what waits for the table waits so long
    assert took_s < BUSY_S
    assert max(seconds for _, seconds in answers) < BUSY_S
