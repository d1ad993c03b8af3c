"""Heartbeats, and recovery of the work of dead processes and of jobs that nobody works on.

Every process raises its count in the database every few seconds and watches the counts of the
others: a count that has not changed for a while belongs to a dead process. A watcher may have been
unable to look for a time, because the database was away or locked, or because it was frozen itself.
It counts that time as one heartbeat at most, since the others could do no better; so an outage
declares no process dead.

Workflows begun by a process that is not on the list go back to their queues. So do those that this
process has begun and no longer runs, because a fault ended them without a trace in the database.
Each goes back unchanged, to be taken by a worker of its version.

The rows of jobs are authoritative. A job whose workflows are gone begins again and keeps its
finished parts. A job that another version has begun waits for a worker of that version. When none
has been alive for a stated time, this version begins the job again and drops its finished parts, as
another version may compute other numbers. Only a job whose workflow ended by a fault fails.
"""

import logging
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

from sqlalchemy import Connection

from api.jobs.queue import APPLICATION, VERSION, JobQueue
from api.settings import Settings
from api.storage import executors, job_records
from api.storage.database import Database, unavailable
from api.storage.holdings import forget_answers, forget_plans, forget_recordings
from api.storage.job_records import (
    ANY_VERSION,
    WaitingJob,
    begin_anew,
    ended_before,
    forget_jobs,
    jobs_that_wait,
)
from api.storage.tables import earlier

# --- stranded jobs --------------------------------------------------------------------------------


_ACTIVE = ["ENQUEUED", "PENDING", "DELAYED"]
_BROKEN = ["ERROR", "MAX_RECOVERY_ATTEMPTS_EXCEEDED", "CANCELLED"]
_ID_LENGTH = 36
_LOST = {"title": "Internal fault", "detail": "the job was lost; see the service's log"}
_MOST_BEGUN = 50

_logger = logging.getLogger("syncplan.guard")


@dataclass(slots=True, eq=False)
class StrandedJobs:
    """Search for jobs that nobody works on.

    Attributes
    ----------
    version_grace_s : s, time that jobs wait for a worker of the version that began them; None to
        leave jobs of other versions alone
    job_over : called with each job that is failed
    """

    database: Database
    queue: JobQueue
    version_grace_s: float | None
    job_over: Callable[[str], None]
    _suspects: set[WaitingJob] = field(default_factory=set)

    def look(self) -> None:
        """Begin stranded jobs anew, move them to this version, or fail them."""
        with self.database.reading() as connection:
            waiting = jobs_that_wait(connection)
            is_gone = self._gone_versions(connection)
        active = self._active_versions()
        suspects = set()
        for job in waiting:
            known = active.get(job.id)
            version = job.version
            if version == ANY_VERSION and known:
                # begun by nobody, or just taken by a version
                version = next(iter(known)) or VERSION
            if version not in (VERSION, ANY_VERSION):
                if is_gone(version):
                    _logger.warning("job %s moves from version %s to %s", job.id, version, VERSION)
                    self._begin_anew(job, VERSION, keep=False)
            elif not known:
                suspects.add(job)
        for job in suspects:
            self._revive(job)
        self._suspects = suspects

    def _gone_versions(self, connection: Connection) -> Callable[[str | None], bool]:
        """Test of whether nobody runs a version any more; None is one before schema version 2."""
        if self.version_grace_s is None:
            return lambda version: False
        living, seen = executors.living_versions(connection), executors.last_seen(connection)
        since = earlier(executors.agreed_moment(connection), self.version_grace_s)
        return lambda version: (
            version not in living and (version is None or seen.get(version, "") < since)
        )

    def _active_versions(self) -> Mapping[str, set[str | None]]:
        """Versions of the workflows that wait or run, by job."""
        found: defaultdict[str, set[str | None]] = defaultdict(set)
        # of this application only: others may keep theirs in the same database
        for one in self.queue.workflows(status=_ACTIVE, application_name=APPLICATION):
            found[one.workflow_id[:_ID_LENGTH]].add(one.app_version)
        return found

    def _revive(self, job: WaitingJob) -> None:
        """Fail a job that a fault has ended; begin one anew if two looks find it stranded."""
        broken = self.queue.workflows(workflow_id_prefix=job.id, status=_BROKEN, limit=1)
        if broken or job.begun >= _MOST_BEGUN:
            _logger.error("job %s was lost: workflows %s", job.id, [one.status for one in broken])
            if self.database.write(job_records.end_job, job.id, "failed", error=_LOST):
                self.job_over(job.id)
        elif job in self._suspects:
            _logger.warning("job %s has no workflow; it begins anew", job.id)
            self._begin_anew(job, job.version or ANY_VERSION, keep=True)

    def _begin_anew(self, job: WaitingJob, version: str, *, keep: bool) -> None:
        if not self.database.write(begin_anew, job, version, keep=keep):
            return
        # no job is entered without a row, and none twice: if this process ends here, the job has
        # no workflow, and the next look finds it
        self.queue.delete(job.id)
        self.database.write(self.queue.add_job, job.id, job.owner, version or None)


# --- heartbeats -----------------------------------------------------------------------------------


_SWEEP_EVERY_S = 20.0
_SWEPT_AT_ONCE = 20


@dataclass(eq=False)
class Guard:
    """Thread that keeps this process on the list of live processes and watches the others.

    Attributes
    ----------
    executor_id : identifier of this process; None if it runs no jobs and only looks after others
    at_work : workflows that this process runs, kept current by the caller
    job_over : called with each job that is failed
    """

    settings: Settings
    database: Database
    queue: JobQueue
    executor_id: str | None
    at_work: Collection[str] = ()
    job_over: Callable[[str], None] = lambda _job_id: None
    clock: Callable[[], float] = time.monotonic

    def __post_init__(self) -> None:
        # a process that runs no jobs leaves those of other versions to workers
        grace_s = None if self.executor_id is None else self.settings.version_grace_s
        self._stranded = StrandedJobs(self.database, self.queue, grace_s, self.job_over)
        self._seen: dict[str, tuple[int, float]] = {}
        self._looked = self._swept = self._beaten = self.clock()
        self._watched_s = 0.0
        self._dropped: set[str] = set()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name="guard")

    @property
    def silent_s(self) -> float:
        """Time since the last heartbeat, in seconds."""
        return self.clock() - self._beaten

    def start(self) -> None:
        """Enter this process on the list, unless it runs no jobs, and start the thread."""
        try:
            self.look_after()
        except Exception as error:
            if self.executor_id is not None or not unavailable(error):
                raise
            _logger.warning("could not look after others: %s", error)
        if self._thread.ident is None:
            self._thread.start()

    def close(self) -> None:
        """Stop, and remove this process from the list; its work continues elsewhere."""
        self._stop.set()
        self._thread.join(timeout=10.0)
        if self.executor_id is not None:
            try:
                self.database.write(executors.forget, self.executor_id)
                self._resume_orphans()
            except Exception as error:
                _logger.warning("could not remove this process from the list: %s", error)

    def _run(self) -> None:
        while not self._stop.wait(self.settings.heartbeat_s):
            try:
                self.look_after()
            except Exception as error:
                _logger.warning("no heartbeat: %s", error)

    def look_after(self) -> None:
        """Raise this process's count, remove dead processes, and resume their work."""
        with self.database.writing() as connection:
            if self.executor_id is not None:
                executors.beat(connection, self.executor_id, VERSION)
            for dead, beats in self._dead(executors.living(connection)).items():
                _logger.warning("process %s is dead; its jobs continue elsewhere", dead)
                executors.forget(connection, dead, beats)
            versions = executors.living_versions(connection)
        self._beaten = self.clock()
        if self.executor_id is not None:
            self._take_new_jobs(versions)
        self._resume_orphans()
        if self.clock() - self._swept >= _SWEEP_EVERY_S:
            self._swept = self.clock()
            self._stranded.look()
            self._sweep()

    def _dead(self, living: dict[str, int]) -> dict[str, int]:
        """Counts of processes silent for too long; this process has just raised its own."""
        now = self.clock()
        self._watched_s += min(now - self._looked, self.settings.heartbeat_s)
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
            if self._watched_s - since >= self.settings.dead_after_s
        }

    def _take_new_jobs(self, living: Collection[str | None]) -> None:
        """Make this version the newest, which begins jobs, if the newest has no live worker."""
        known = self.queue.client.list_application_versions()
        names = [one["version_name"] for one in known]
        if VERSION in names and names[0] != VERSION and names[0] not in living:
            _logger.warning("version %s is gone; version %s begins jobs now", names[0], VERSION)
            self.queue.promote(VERSION, known[0]["version_timestamp"] + 1)

    def _resume_orphans(self) -> None:
        """Requeue abandoned workflows: of processes not on the list, or dropped by this one."""
        # of this application only: others may keep theirs in the same database
        begun = self.queue.workflows(status="PENDING", application_name=APPLICATION)
        living = self.database.read(executors.living)
        orphans: dict[str | None, list[str]] = defaultdict(list)
        dropped = set()
        for workflow in begun:
            name = workflow.workflow_id
            if workflow.executor_id == self.executor_id and name not in self.at_work:
                dropped.add(name)
            # at the first look it may be about to begin, or about to end
            if workflow.executor_id not in living or name in dropped & self._dropped:
                orphans[workflow.queue_name].append(name)
        self._dropped = dropped
        for queue_name, identifiers in orphans.items():
            _logger.warning("resuming %d abandoned workflows", len(identifiers))
            self.queue.client.resume_workflows(identifiers, queue_name=queue_name)

    def _sweep(self) -> None:
        """Delete expired records; jobs after their workflows, so that none is left half deleted."""
        settings = self.settings
        with self.database.reading() as connection:
            time = executors.agreed_moment(connection)
            old = ended_before(connection, earlier(time, settings.keep_jobs_s), _SWEPT_AT_ONCE)
        for job_id in old:
            self.queue.delete(job_id)
        with self.database.writing() as connection:
            forget_answers(connection, earlier(time, settings.keep_answers_s))
            forget_jobs(connection, old)
            forget_recordings(connection, earlier(time, settings.keep_recordings_s))
            if settings.keep_plans_s is not None:
                forget_plans(connection, earlier(time, settings.keep_plans_s))
