"""The schema: each version from the one before, and the newest as the tables say."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import Connection, create_engine, insert, inspect, select
from sqlalchemy.pool import NullPool

from api.settings import load_settings
from api.storage.migrations import FIRST_METADATA, MIGRATIONS, upgrade
from api.storage.tables import METADATA, schema_version
from tests.tools.schemas import schema_of

EACH = pytest.mark.parametrize(
    "address", ["sqlite", pytest.param("postgresql", marks=pytest.mark.long)], indirect=True
)


@pytest.fixture
def empty(address: str | None, tmp_path: Path) -> Iterator[Connection]:
    """A transaction on an empty database, of which nothing stays."""
    url = load_settings(data_dir=tmp_path, database_url=address).database
    engine = create_engine(url, poolclass=NullPool)
    with engine.connect() as connection:
        yield connection


@EACH
def test_migrations_end_with_the_tables_of_today(empty: Connection) -> None:
    names = [*METADATA.tables]
    upgrade(empty)
    assert sorted(inspect(empty).get_table_names()) == sorted(names)
    migrated = schema_of(empty, *names)
    METADATA.drop_all(empty)
    METADATA.create_all(empty)
    assert migrated == schema_of(empty, *names)


@EACH
def test_a_database_of_the_first_version_keeps_its_rows(empty: Connection) -> None:
    FIRST_METADATA.create_all(empty)
    old = FIRST_METADATA.tables
    job = {
        "id": "j",
        "owner": "ann",
        "kind": "validation",
        "state": "running",
        "request": "{}",
        "done": 3,
        "total": 9,
        "created_at": "2026-01-01T00:00:00.000000Z",
        "events": 1,
    }
    part = {"job_id": "j", "number": 0, "run": 0, "first_trial": 0, "trials": 9, "done": 3}
    empty.execute(insert(old["syncplan_schema"]).values(version=1))
    empty.execute(insert(old["jobs"]).values(job))
    empty.execute(insert(old["job_parts"]).values(part))
    empty.execute(insert(old["executors"]).values(id="one", beats=7))
    upgrade(empty)
    new = METADATA.tables
    assert empty.execute(select(schema_version)).all() == [(len(MIGRATIONS), 1)]
    found = empty.execute(select(new["jobs"])).mappings().one()
    assert job.items() <= dict(found).items()
    assert (found["version"], found["computed_s"]) == (None, 0.0)
    kept = empty.execute(select(new["job_parts"])).mappings().one()
    assert part.items() <= dict(kept).items()
    assert (kept["attempts"], kept["deaths"]) == (0, 0)
    assert empty.execute(select(new["executors"])).all() == [("one", 7, None, None)]
    # a process of the version before, which knows no more columns than it had
    empty.execute(insert(old["jobs"]).values({**job, "id": "k"}))
    empty.execute(insert(old["job_parts"]).values({**part, "job_id": "k"}))
    empty.execute(insert(old["executors"]).values(id="two", beats=0))
