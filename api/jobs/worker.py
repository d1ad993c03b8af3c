"""Worker of a process: its workflows, its children and its heartbeat."""

import logging
import os
import secrets
import socket
import threading

from dbos import DBOS

import api.jobs.workflows  # noqa: F401
from api.computing.pool import Pool
from api.jobs import parts
from api.jobs.guard import Guard
from api.jobs.job_counts import JobCounts
from api.jobs.parts import PartWatch, Runtime
from api.jobs.queue import APPLICATION, JSON_ROWS, PARTS_QUEUE, VERSION, JobQueue
from api.settings import Settings
from api.storage.database import Database, unavailable

_POLL_S = 0.25
_DBOS_CONNECTIONS = 10
_AGAIN_S = 2.0

_logger = logging.getLogger("syncplan.worker")


class Worker:
    """Worker that runs jobs from its creation to `close`; one per process at a time.

    Attributes
    ----------
    guard : thread of its heartbeat
    """

    def __init__(
        self,
        settings: Settings,
        database: Database,
        counts: JobCounts,
        queue: JobQueue,
        *,
        patient: bool = False,
    ) -> None:
        """Begin at once; if the database can't be written to, begin later if `patient`.

        If it is not, raises the error of writing.
        """
        self.executor_id = f"{socket.gethostname()[:32]}-{os.getpid()}-{secrets.token_hex(4)}"
        self.pool = Pool(
            settings.process_count,
            niceness=settings.job_niceness,
            memory_bytes=settings.task_memory,
        )
        self.queue = queue
        watch = PartWatch(database, VERSION)
        self._runtime = Runtime(settings, database, self.queue, self.pool, counts, watch)
        parts.use(self._runtime)
        self.guard = Guard(
            settings,
            database,
            self.queue,
            self.executor_id,
            at_work=self._runtime.at_work,
            job_over=counts.job_over,
        )
        self._stopping = threading.Event()
        self._beginning = threading.Thread(target=self._begin_later, daemon=True, name="begin")
        try:
            self._begin()
        except Exception as error:
            if not patient or not unavailable(error):
                raise
            _logger.warning("no jobs are run until the database can be written to: %s", error)
            self._beginning.start()

    def _begin_later(self) -> None:
        while not self._stopping.wait(_AGAIN_S):
            try:
                return self._begin()
            except Exception as error:
                if not unavailable(error):
                    _logger.exception("the worker could not begin")
                    return

    def _begin(self) -> None:
        settings = self._runtime.settings
        # DBOS would wait for the database, and keep readers waiting too
        self._runtime.database.check_writing()
        # first: others take over the work of a process that is not on the list
        self.guard.start()
        DBOS(
            config={
                "name": APPLICATION,
                "system_database_url": settings.database,
                "sys_db_pool_size": _DBOS_CONNECTIONS,
                "executor_id": self.executor_id,
                "application_version": VERSION,
                "serializer": JSON_ROWS,
                "log_level": "WARNING",
                "enable_otlp": False,
            }
        )
        DBOS.listen_queues([PARTS_QUEUE])
        DBOS.launch()
        DBOS.register_queue(
            PARTS_QUEUE,
            # for each owner: the pool decides whose turn it is
            partition_worker_concurrency=settings.process_count,
            polling_interval_sec=_POLL_S,
            on_conflict="always_update",
        )
        _logger.info("worker %s with %d processes", self.executor_id, settings.process_count)

    def close(self) -> None:
        """Give up the jobs that run; another process, or this one's successor, continues them."""
        self._stopping.set()
        if self._beginning.ident is not None:
            self._beginning.join(_AGAIN_S)
        self._runtime.closing.set()
        self._runtime.watch.close()
        self.pool.close()
        DBOS.destroy(workflow_completion_timeout_sec=0)
        self.guard.close()
        parts.use(None)
