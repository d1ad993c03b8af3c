"""Heartbeats, and what happens to the work of processes without one.

Every process raises its count in the database every few seconds and watches the counts of the
others: a count that has not changed for a while belongs to a dead process. A watcher that could not
look for a time, because the database was away or locked, or because it was frozen itself,
counts no more of that time than one heartbeat, since the others could do no better; so an outage
declares no process dead. Workflows begun by a process that is not on the list go back to their
queues, and so do those that this process has begun and no longer runs, because a fault ended them
without a trace in the database. Each goes back as it is, to be taken by a worker of its version.
"""

import logging
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Collection

from api.jobs.queue import APPLICATION, VERSION, JobQueue
from api.jobs.stranded_jobs import StrandedJobs
from api.storage import executors
from api.storage.clock import earlier
from api.storage.database import Database, unavailable
from api.storage.ended_jobs import delete_jobs, ended_before
from api.storage.kept_answers import forget_answers
from api.storage.plan_records import forget_plans
from api.storage.recording_records import forget_recordings

_SWEEP_EVERY_S = 20.0
_SWEPT_AT_ONCE = 20

_logger = logging.getLogger("syncplan.guard")


class Guard:
    """A thread that keeps this process on the list of live processes and watches the others.

    Parameters
    ----------
    executor_id : of this process; None for one that runs no jobs and only looks after others
    at_work : the workflows that this process is at, as they come and go
    heartbeat_s, dead_after_s : between heartbeats; without one until a process is dead
    keep_jobs_s, keep_answers_s : how long ended jobs and given answers are kept
    keep_plans_s, keep_recordings_s : how long plans and recordings are kept; None: for ever
    version_grace_s : how long jobs wait for a worker of the version that began them
    job_over : called with each job that is failed
    """

    def __init__(
        self,
        database: Database,
        queue: JobQueue,
        executor_id: str | None,
        *,
        at_work: Collection[str] = (),
        heartbeat_s: float,
        dead_after_s: float,
        keep_jobs_s: float,
        keep_answers_s: float,
        keep_plans_s: float | None = None,
        keep_recordings_s: float | None = None,
        version_grace_s: float,
        job_over: Callable[[str], None] = lambda _job_id: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._database = database
        self._queue = queue
        self._client = queue.client
        self._executor_id = executor_id
        self._at_work = at_work
        self._heartbeat_s = heartbeat_s
        self._dead_after_s = dead_after_s
        self._keep_jobs_s = keep_jobs_s
        self._keep_answers_s = keep_answers_s
        self._keep_plans_s = keep_plans_s
        self._keep_recordings_s = keep_recordings_s
        self._clock = clock
        # what runs no jobs leaves those of other versions to workers
        grace_s = None if executor_id is None else version_grace_s
        self._stranded = StrandedJobs(database, queue, grace_s, job_over)
        self._seen: dict[str, tuple[int, float]] = {}
        self._looked = self._swept = self._beaten = clock()
        self._watched_s = 0.0
        self._dropped: set[str] = set()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name="guard")

    @property
    def silent_s(self) -> float:
        """How long ago the last heartbeat was, in seconds."""
        return self._clock() - self._beaten

    def start(self) -> None:
        """Enter this process on the list, and begin; one that runs no jobs has nothing to enter."""
        try:
            self.look_after()
        except Exception as error:
            if self._executor_id is not None or not unavailable(error):
                raise
            _logger.warning("could not look after others: %s", error)
        if self._thread.ident is None:
            self._thread.start()

    def close(self) -> None:
        """Stop, and remove this process from the list: what it had begun continues elsewhere."""
        self._stop.set()
        self._thread.join(timeout=10.0)
        if self._executor_id is not None:
            try:
                with self._database.writing() as connection:
                    executors.forget(connection, self._executor_id)
                self._resume_orphans()
            except Exception as error:
                _logger.warning("could not remove this process from the list: %s", error)

    def _run(self) -> None:
        while not self._stop.wait(self._heartbeat_s):
            try:
                self.look_after()
            except Exception as error:
                _logger.warning("no heartbeat: %s", error)

    def look_after(self) -> None:
        """Raise this process's count, remove dead processes, and resume what they left."""
        with self._database.writing() as connection:
            if self._executor_id is not None:
                executors.beat(connection, self._executor_id, VERSION)
            for dead, beats in self._dead(executors.living(connection)).items():
                _logger.warning("process %s is dead; its jobs continue elsewhere", dead)
                executors.forget(connection, dead, beats)
            versions = executors.living_versions(connection)
        self._beaten = self._clock()
        if self._executor_id is not None:
            self._take_new_jobs(versions)
        self._resume_orphans()
        if self._clock() - self._swept >= _SWEEP_EVERY_S:
            self._swept = self._clock()
            self._stranded.look()
            self._sweep()

    def _dead(self, living: dict[str, int]) -> dict[str, int]:
        """Who has been silent for too long; this process itself has just raised its count."""
        now = self._clock()
        self._watched_s += min(now - self._looked, self._heartbeat_s)
        self._looked = now
        self._seen = {
            name: self._seen[name]
            if name in self._seen and self._seen[name][0] == beats
            else (beats, self._watched_s)
            for name, beats in living.items()
        }
        return {
            name: beats
            for name, (beats, since) in self._seen.items()
            if self._watched_s - since >= self._dead_after_s
        }

    def _take_new_jobs(self, living: Collection[str | None]) -> None:
        """Make this version the newest, which begins jobs, where nothing of that one is alive."""
        known = self._client.list_application_versions()
        names = [one["version_name"] for one in known]
        if VERSION in names and names[0] != VERSION and names[0] not in living:
            _logger.warning("version %s is gone; version %s begins jobs now", names[0], VERSION)
            self._queue.promote(VERSION, known[0]["version_timestamp"] + 1)

    def _resume_orphans(self) -> None:
        """Put abandoned workflows back: of processes not on the list, or dropped by this one."""
        # of this application: others may keep theirs in the same database
        begun = self._client.list_workflows(
            status="PENDING",
            application_name=APPLICATION,
            load_input=False,
            load_output=False,
        )
        with self._database.reading() as connection:
            living = executors.living(connection)
        orphans: dict[str | None, list[str]] = defaultdict(list)
        dropped = set()
        for workflow in begun:
            name = workflow.workflow_id
            if workflow.executor_id == self._executor_id and name not in self._at_work:
                dropped.add(name)
            # at the first look it may be about to begin, or about to end
            if workflow.executor_id not in living or name in dropped & self._dropped:
                orphans[workflow.queue_name].append(name)
        self._dropped = dropped
        for queue_name, identifiers in orphans.items():
            _logger.warning("resuming %d abandoned workflows", len(identifiers))
            self._client.resume_workflows(identifiers, queue_name=queue_name)

    def _sweep(self) -> None:
        """Delete what was kept long enough; jobs last, so that none is forgotten half deleted."""
        with self._database.reading() as connection:
            time = executors.agreed_moment(connection)
            old = ended_before(connection, earlier(time, self._keep_jobs_s), _SWEPT_AT_ONCE)
        for job_id in old:
            self._queue.delete(job_id)
        with self._database.writing() as connection:
            forget_answers(connection, earlier(time, self._keep_answers_s))
            delete_jobs(connection, old)
            if self._keep_recordings_s is not None:
                forget_recordings(connection, earlier(time, self._keep_recordings_s))
            if self._keep_plans_s is not None:
                forget_plans(connection, earlier(time, self._keep_plans_s))
