"""The schema: each version from the one before, and the newest as the tables say."""

from pathlib import Path

import pytest
from sqlalchemy import Connection, MetaData, create_engine, insert, inspect, select
from sqlalchemy.pool import NullPool

from api.settings import load_settings
from api.storage.migrations import NEWEST, upgrade
from api.storage.tables import METADATA, schema_version
from tests.tools.kept_databases import restore_postgresql, restore_sqlite
from tests.tools.schemas import schema_of

EACH = pytest.mark.parametrize(
    "address", ["sqlite", pytest.param("postgresql", marks=pytest.mark.long)], indirect=True
)


def connected(address: str | None, folder: Path) -> Connection:
    """Return a connection to the database in a folder, or at an address; nothing stays of it."""
    url = load_settings(data_dir=folder, database_url=address).database
    return create_engine(url, poolclass=NullPool).connect()


def see_tables_of_today(upgraded: Connection) -> None:
    """Check that upgraded tables are as those that are made anew."""
    found = schema_of(upgraded, *METADATA.tables)
    METADATA.drop_all(upgraded)
    METADATA.create_all(upgraded)
    assert found == schema_of(upgraded, *METADATA.tables)


@EACH
def test_an_empty_database_gets_the_tables_of_today(address: str | None, tmp_path: Path) -> None:
    with connected(address, tmp_path) as empty:
        upgrade(empty)
        assert sorted(inspect(empty).get_table_names()) == sorted(METADATA.tables)
        see_tables_of_today(empty)


@EACH
def test_a_database_of_the_first_version_gets_the_tables_of_today_and_keeps_its_rows(
    address: str | None, tmp_path: Path
) -> None:
    if address is None:
        restore_sqlite("version-1", tmp_path / "syncplan.db")
    else:
        restore_postgresql("version-1", address)
    with connected(address, tmp_path) as first:
        assert not set(METADATA.tables) <= set(inspect(first).get_table_names())
        reflected = MetaData()
        reflected.reflect(first)
        old = reflected.tables
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
        first.execute(insert(old["jobs"]).values(job))
        first.execute(insert(old["job_parts"]).values(part))
        first.execute(insert(old["executors"]).values(id="one", beats=7))
        upgrade(first)
        new = METADATA.tables
        assert first.execute(select(schema_version)).all() == [(NEWEST, 1)]
        mine = select(new["jobs"]).where(new["jobs"].c.id == "j")
        found = first.execute(mine).mappings().one()
        assert job.items() <= dict(found).items()
        assert (found["version"], found["computed_s"]) == (None, 0.0)
        parts = select(new["job_parts"]).where(new["job_parts"].c.job_id == "j")
        kept = first.execute(parts).mappings().one()
        assert part.items() <= dict(kept).items()
        assert (kept["attempts"], kept["deaths"]) == (0, 0)
        living = first.execute(select(new["executors"])).all()
        assert ("one", 7, None, None) in living
        plans = first.execute(select(new["plans"].c.worst_predicted_rms_m, new["plans"].c.outline))
        assert set(plans) == {(None, None)}
        # a process of the version before, which knows no more columns than it had
        first.execute(insert(old["jobs"]).values({**job, "id": "k"}))
        first.execute(insert(old["job_parts"]).values({**part, "job_id": "k"}))
        first.execute(insert(old["executors"]).values(id="two", beats=0))
        see_tables_of_today(first)
