"""Records databases as a released version leaves them, for `tests.service.test_kept_databases`.

    git worktree add ../old COMMIT
    cp tests/tools/record_database.py ../old/tests/tools/
    (cd ../old && python -m tests.tools.record_database FOLDER)

writes FOLDER/sqlite.db.gz, FOLDER/postgresql.sql.gz, and FOLDER/sqlite.json.gz, postgresql.json.gz:
what the service answered about plans, jobs, results and events, and which jobs it had not finished
when it was killed. It holds plans and jobs of all kinds and states, answers kept under
Idempotency-Keys, and the tables of the queue, with a job that is half done.
"""

import gzip
import json
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from sqlalchemy import create_engine, text

from tests.tools.processes import wait_until
from tests.tools.scenarios import shared_circles
from tests.tools.serving import own_postgres
from tests.tools.survival import Site, flight, quick, refinement, sweep_of_ranges, validation

__all__ = ["record", "states_of"]

HALF_DONE: dict[str, Any] = {"trials": 4800, "seed": 1}
TOO_LONG = {"scenario": shared_circles(8), "range_m": [50.0], "trials": 1}
"""A sweep whose row takes more than LIMITS allow a part."""

LIMITS = {"SYNCPLAN_JOB_TASK_S": "5"}
QUEUED: dict[str, Any] = {"trials": 10, "seed": 5}
ASKED = {"x-request-id": "kept"}
"""What problems name is the same whenever they are asked for."""

IDEMPOTENCY = {"idempotency-key": "of-before"}
ENDED = ("succeeded", "failed", "cancelled")


def record(site: Site) -> dict[str, Any]:
    """Use a service, kill it, and return what it said."""
    server = site.serve()
    plan_id = site.hand_in_plan()
    for order in (validation(10, 0), flight(4, 2, 20.0), refinement(0), sweep_of_ranges(20, 3)):
        given = plan_id if order.kind in ("validation", "flight") else None
        site.wait_for(site.hand_in(order, given), *ENDED)
    path = f"/v1/plans/{plan_id}/validations"
    body = dict(QUEUED)
    again = site.ask("POST", path, json=body, headers=IDEMPOTENCY)
    site.wait_for(again.json()["id"], *ENDED)
    cancelled = site.ask("POST", path, json={"trials": 100_000, "seed": 0}).json()["id"]
    site.ask("POST", f"/v1/jobs/{cancelled}/cancel")
    failed = site.ask("POST", "/v1/sweeps", json=TOO_LONG).json()["id"]
    site.wait_for(failed, "failed")
    said = _said(site)
    half = site.hand_in(validation(**HALF_DONE), plan_id)
    wait_until(lambda: states_of(site.database)[half][1] > 0)
    site.kill(server)
    states = states_of(site.database)
    assert states[half][1] > 0, states
    server = site.serve("--no-worker")
    waiting = [
        site.hand_in(order, plan_id if order.kind == "validation" else None)
        for order in (validation(**QUEUED), refinement(0), sweep_of_ranges(20, 3))
    ]
    site.kill(server)
    # those that handing them in has made are there as well
    return {
        "answers": said,
        "plans": list(site.plans),
        "half_done": half,
        "queued": waiting,
        "repeated": {"path": path, "body": body, "answer": again.text},
    }


def _said(site: Site) -> dict[str, str]:
    """All that is asked about what there is, by path."""
    plans = [one["id"] for one in site.ask("GET", "/v1/plans").json()["items"]]
    jobs = [one["id"] for one in site.ask("GET", "/v1/jobs").json()["items"]]
    paths = [f"/v1/plans/{one}" for one in plans]
    for one in jobs:
        paths += [f"/v1/jobs/{one}", f"/v1/jobs/{one}/events", f"/v1/jobs/{one}/result"]
    return {path: site.ask("GET", path, headers=ASKED).text for path in paths}


def states_of(database: str) -> dict[str, tuple[str, int]]:
    """Return state and number of finished batches of each job in a database."""
    engine = create_engine(database)
    with engine.connect() as connection:
        kept = "(SELECT count(data) FROM job_parts WHERE job_id = jobs.id)"
        rows = connection.execute(text(f"SELECT id, state, {kept} FROM jobs")).all()
    engine.dispose()
    return {row[0]: (row[1], row[2]) for row in rows}


def main(folder: Path) -> None:
    """Record both databases."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        with quick(Path(scratch) / "site", **LIMITS) as site:
            said = record(site)
            small = Path(scratch) / "small.db"
            source = sqlite3.connect(site.database.removeprefix("sqlite:///"))
            source.execute("VACUUM INTO ?", [str(small)])
            source.close()
            content = small.read_bytes()
        _keep(folder, "sqlite", "db", content, said)
    with own_postgres() as server, tempfile.TemporaryDirectory() as scratch:
        address = server.new_database()
        with quick(Path(scratch) / "site", address, **LIMITS) as site:
            said = record(site)
        dump = ["pg_dump", "--no-owner", "--no-privileges", "--inserts", address]
        content = subprocess.run(dump, check=True, capture_output=True).stdout
        _keep(folder, "postgresql", "sql", content, said)


def _keep(folder: Path, kind: str, ending: str, content: bytes, said: dict[str, Any]) -> None:
    (folder / f"{kind}.{ending}.gz").write_bytes(gzip.compress(content, 9, mtime=0))
    shown = json.dumps(said, indent=1).encode()
    (folder / f"{kind}.json.gz").write_bytes(gzip.compress(shown, 9, mtime=0))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
