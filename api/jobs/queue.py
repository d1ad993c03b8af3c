"""Submitting jobs: a job and its workflow are entered in one transaction."""

from dbos import DBOS, DBOSClient, EnqueueOptions
from sqlalchemy import Connection

from api.jobs.serialization import JSON_ROWS, refuse_pickles

__all__ = ["APPLICATION", "JOBS_QUEUE", "JOB_WORKFLOW", "WORKFLOWS_VERSION", "JobQueue"]

APPLICATION = "syncplan"
JOBS_QUEUE = "syncplan-jobs"
JOB_WORKFLOW = "syncplan-job"

WORKFLOWS_VERSION = "2"
"""Raised when jobs begun by an older syncplan can't be continued; they then fail and say so."""


class JobQueue:
    """The durable queue, seen from outside the workflows; its tables are made where missing."""

    def __init__(self, url: str) -> None:
        refuse_pickles()
        DBOS.migrate(url)
        self.client = DBOSClient(
            system_database_url=url,
            serializer=JSON_ROWS,
            application_name=APPLICATION,
            lazy=True,
            retry_connection_errors=False,
        )

    def enqueue(self, connection: Connection, job_id: str) -> None:
        """Enter the workflow of a job, in the caller's transaction."""
        options: EnqueueOptions = {
            "workflow_name": JOB_WORKFLOW,
            "queue_name": JOBS_QUEUE,
            "workflow_id": job_id,
            "app_version": WORKFLOWS_VERSION,
        }
        self.client.enqueue_in_transaction(connection, options, job_id)

    def close(self) -> None:
        """Close the connection to the database."""
        self.client.destroy()
