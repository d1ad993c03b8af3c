"""The user and database that `docker/database.sql` makes: enough for the service, no more."""

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import psycopg
import pytest

from tests.tools.serving import ROOT, Postgres, own_postgres
from tests.tools.survival import quick, validation

PASSWORD = "correct 'horse' battery"


@pytest.fixture
def postgres() -> Iterator[Postgres]:
    with own_postgres(superuser="postgres") as started:
        yield started


@pytest.mark.long
def test_the_service_works_as_an_ordinary_user(tmp_path: Path, postgres: Postgres) -> None:
    script = str(ROOT / "docker" / "database.sql")
    subprocess.run(
        ["psql", "--no-psqlrc", "--set=ON_ERROR_STOP=1", "--quiet", "-f", script, postgres.url],
        env={**os.environ, "SYNCPLAN_DATABASE_PASSWORD": PASSWORD},
        check=True,
    )
    with psycopg.connect(postgres.url) as connection:
        roles = connection.execute(
            "SELECT rolsuper, rolcreatedb, rolcreaterole, rolreplication, rolpassword IS NOT NULL "
            "FROM pg_authid WHERE rolname = 'syncplan'"
        ).fetchall()
        assert roles == [(False, False, False, False, True)]
        query = "SELECT rolpassword FROM pg_authid WHERE rolname = 'postgres'"
        assert connection.execute(query).fetchone() == (None,)
    ordinary = postgres.url.replace("postgres@", "syncplan@")
    for other in ("postgres", "template1"):
        with pytest.raises(psycopg.OperationalError, match="permission denied for database"):
            psycopg.connect(f"{ordinary.rpartition('/')[0]}/{other}")
    with quick(tmp_path, f"{ordinary.rpartition('/')[0]}/syncplan") as site:
        site.serve("--no-worker")
        site.work()
        site.hand_in(validation(10, 0))
        site.see_all_done()
