"""Durable queue of jobs and their parts, entered in the caller's transaction for workers to take.

Parts wait in one queue with a partition for each owner, so that no owner's parts wait for
another's. Within a partition, the parts with the lowest priority number come first.

Rows of the queue hold JSON. A row that claims to hold anything else is refused, never read: DBOS
reads a row in the format that the row names, which may be a pickle, and reading a pickle runs its
commands. Anyone who can write to the table could then run commands in every server and worker.
"""

import base64
import logging
import pickle
from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Any, NoReturn

from dbos import (
    DBOS,
    DBOSClient,
    DBOSPortableJSONSerializer,
    EnqueueOptions,
    Serializer,
    WorkflowStatus,
)
from dbos._serialization import DefaultSerializer, deserialize_value
from sqlalchemy import Connection

from api.storage.database import unavailable
from syncplan import __version__

# --- rows -----------------------------------------------------------------------------------------


# not public, both watched by tests/attacks/test_store_pickles.py (pickles_are_refused):
# DefaultSerializer reads pickles, and no setting of DBOS keeps it from rows that name it;
# deserialize_value reads rows, and shows at each start that the replacement is in use

JSON_ROWS: Serializer = DBOSPortableJSONSerializer()
"""Serializer of rows."""


class RefusedRowError(ValueError):
    """A row of the queue holds something other than JSON."""


def refuse_pickles() -> None:
    """Make DBOS raise RefusedRowError in this process when a row holds a pickle.

    Raises RuntimeError if DBOS reads it nevertheless, as another version of it might.
    """
    DefaultSerializer.deserialize = _refuse  # type: ignore[assignment, method-assign]
    harmless = base64.b64encode(pickle.dumps("harmless")).decode()
    try:
        deserialize_value(harmless, DefaultSerializer().name(), JSON_ROWS)
    except RefusedRowError:
        return
    raise RuntimeError("this version of DBOS reads pickles from rows; install the one locked")


def _refuse(_serializer: DefaultSerializer, _serialized: Any) -> NoReturn:
    raise RefusedRowError("the row holds a pickle, which is not read")


# --- the queue ------------------------------------------------------------------------------------


APPLICATION = "syncplan"
PARTS_QUEUE = "syncplan-work"

BEGIN_WORKFLOW = "syncplan-begin"
BATCH_WORKFLOW = "syncplan-batch"
CONCLUDE_WORKFLOW = "syncplan-conclude"

_STRUCTURE = 2
"""Incremented when the workflows change so that jobs under way can't be continued."""

VERSION = f"{__version__}+{_STRUCTURE}"
"""Version that finishes the jobs it has begun: another one may compute other numbers."""

_FIRST = 1
"""Priority of a job's first and last part, and of its first batch."""

_logger = logging.getLogger("syncplan.jobs")


def batch_id(job_id: str, number: int) -> str:
    """Return the identifier of the workflow of a batch."""
    return f"{job_id}-{number}"


def conclusion_id(job_id: str) -> str:
    """Return the identifier of the workflow that concludes a job."""
    return f"{job_id}-end"


class JobQueue:
    """The durable queue, seen from outside the workflows; makes its tables if missing."""

    def __init__(self, url: str) -> None:
        refuse_pickles()
        try:
            DBOS.migrate(url)
        except Exception as error:
            # on a full disk, for example: a worker makes up for it before it begins
            if not unavailable(error):
                raise
            _logger.warning("the queue's tables can't be brought up to date: %s", error)
        self.client = DBOSClient(
            system_database_url=url,
            serializer=JSON_ROWS,
            application_name=APPLICATION,
            lazy=True,
            retry_connection_errors=False,
        )

    def add_job(
        self, connection: Connection, job_id: str, owner: str, version: str | None = None
    ) -> None:
        """Enter the first part of a job; any version may begin it unless one is given."""
        self._enter(connection, BEGIN_WORKFLOW, job_id, owner, version, _FIRST, job_id)

    def add_batches(
        self, connection: Connection, job_id: str, owner: str, numbers: Iterable[tuple[int, int]]
    ) -> None:
        """Enter batches of a job, given as (number, turn); those entered before stay as they are.

        The first turns of all the owner's jobs come before the second turn of any.
        """
        for number, turn in numbers:
            batch, priority = (job_id, number), _FIRST + turn
            self._enter(
                connection, BATCH_WORKFLOW, batch_id(*batch), owner, VERSION, priority, *batch
            )

    def add_conclusion(self, connection: Connection, job_id: str, owner: str) -> None:
        """Enter the last part of a job."""
        identifier = conclusion_id(job_id)
        self._enter(connection, CONCLUDE_WORKFLOW, identifier, owner, VERSION, _FIRST, job_id)

    def _enter(
        self,
        connection: Connection,
        workflow: str,
        identifier: str,
        owner: str,
        version: str | None,
        priority: int,
        *arguments: str | int,
    ) -> None:
        options: EnqueueOptions = {
            "workflow_name": workflow,
            "queue_name": PARTS_QUEUE,
            "queue_partition_key": owner,
            "workflow_id": identifier,
            "priority": priority,
        }
        if version is not None:
            options["app_version"] = version
        self.client.enqueue_in_transaction(connection, options, *arguments)

    def workflows(self, **which: Any) -> list[WorkflowStatus]:
        """Return the workflows that DBOS lists for `which`, without their inputs and outputs."""
        return self.client.list_workflows(**which, load_input=False, load_output=False)

    def oldest(self) -> datetime | None:
        """Return the time at which the longest-waiting part was entered; None if none waits."""
        found = self.workflows(
            status="ENQUEUED", queue_name=PARTS_QUEUE, application_name=APPLICATION, limit=1
        )
        if not found or found[0].created_at is None:
            return None
        return datetime.fromtimestamp(found[0].created_at / 1000.0, UTC)

    def drop(self, job_id: str) -> None:
        """Remove the waiting parts of a job that has ended, which would do nothing."""
        waiting = self.workflows(workflow_id_prefix=job_id, status="ENQUEUED", app_version=VERSION)
        self.client.cancel_workflows([one.workflow_id for one in waiting])

    def delete(self, job_id: str) -> None:
        """Delete all workflows of a job, whatever their states."""
        found = self.workflows(workflow_id_prefix=job_id)
        self.client.delete_workflows([one.workflow_id for one in found])

    def promote(self, version: str, timestamp: int) -> None:
        """Make a version the newest, dated by a timestamp in ms."""
        # not public: `set_latest_application_version` reads the machine's clock, which may be
        # behind, and test_the_newest_version_that_lives_begins_jobs would fail
        self.client._sys_db.update_application_version_timestamp(version, timestamp)

    def close(self) -> None:
        """Close the connection to the database."""
        self.client.destroy()
