"""Rows of the queue that hold pickles, by whoever can write to its tables, run no command."""

import base64
import pickle
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import MetaData, create_engine, insert, select, update

from api.jobs.queue import JSON_ROWS, RefusedRowError, refuse_pickles
from tests.tools.processes import wait_until
from tests.tools.survival import Site, quick, validation

PICKLED = "py_pickle"
"""What DBOS calls rows that hold pickles."""


class Opens:
    """What leaves a file behind when its pickle is read."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __reduce__(self) -> Any:
        return open, (str(self._path), "w")


def plant(site: Site, job_id: str, other_id: str, pickled: str) -> None:
    """Let every row that DBOS keeps of two jobs hold a pickle, and add workflows of all states."""
    engine = create_engine(site.database)
    found = MetaData()
    found.reflect(engine)
    status, inputs, outputs = (
        found.tables[name] for name in ("workflow_status", "workflow_input", "operation_outputs")
    )
    how = {"serialization": PICKLED}
    with engine.begin() as connection:
        mine = status.c.workflow_uuid == job_id
        connection.execute(update(status).where(mine).values(inputs=pickled, **how))
        own = inputs.c.workflow_uuid == job_id
        connection.execute(update(inputs).where(own).values(inputs=pickled))
        for number in range(6):
            step = {"function_id": number, "function_name": "start" if number < 2 else "cut"}
            done = insert(outputs).values(workflow_uuid=other_id, output=pickled, **step, **how)
            connection.execute(done)
        like = dict(connection.execute(select(status).where(mine)).mappings().one())
        like |= {"executor_id": "nobody", "output": pickled, "error": pickled}
        for state in ("ENQUEUED", "PENDING", "SUCCESS", "ERROR", "CANCELLED"):
            planted = {**like, "workflow_uuid": f"{job_id}-{state}", "status": state}
            connection.execute(insert(status).values(planted))
    engine.dispose()


@pytest.mark.long
def test_a_row_that_holds_a_pickle_runs_nothing(tmp_path: Path) -> None:
    left = tmp_path / "left"
    pickled = base64.b64encode(pickle.dumps(Opens(left))).decode()
    with quick(tmp_path) as site:
        site.serve("--no-worker")
        job_id, other_id = (site.hand_in(validation(10, 0)) for _ in range(2))
        plant(site, job_id, other_id, pickled)
        site.work()

        def refused() -> list[str]:
            return [line for line in site.log_lines() if "holds a pickle" in line]

        wait_until(lambda: left.exists() or len(refused()) >= 3, otherwise=site.logs)
        assert not left.exists()
        site.wait_for(site.hand_in(validation(10, 0)), "succeeded")
        assert not left.exists()
        # a line for each row that was met, not one for each look at it
        assert len(refused()) <= 8


def test_pickles_are_refused_and_json_is_read() -> None:
    refuse_pickles()
    from dbos._serialization import DBOSDefaultSerializer, deserialize_args, deserialize_exception

    pickled = DBOSDefaultSerializer.serialize({"args": (), "kwargs": {}})
    for read in (deserialize_args, deserialize_exception):
        with pytest.raises(RefusedRowError):
            read(pickled, PICKLED, JSON_ROWS)
    assert JSON_ROWS.deserialize(JSON_ROWS.serialize(["a", 1])) == ["a", 1]


def test_a_dbos_that_would_read_them_nevertheless_is_not_started(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("api.jobs.queue.deserialize_value", lambda *_: "read")
    with pytest.raises(RuntimeError, match="reads pickles"):
        refuse_pickles()
