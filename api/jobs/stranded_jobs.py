"""Jobs that nobody works on: begun anew, by this version or by the one that began them.

The rows of jobs are the truth. A job whose workflows are gone begins again with what is finished of
it. One that another version has begun waits for a worker of that version; when none has been alive
for a stated time it moves: what is finished is dropped, as another version may compute other
numbers, and this version begins it again. Only a job whose workflow ended by a fault fails.
"""

import logging
from collections import defaultdict
from collections.abc import Callable, Mapping

from sqlalchemy import Connection

from api.jobs.queue import APPLICATION, VERSION, JobQueue
from api.storage import executors, job_records
from api.storage.clock import earlier
from api.storage.database import Database
from api.storage.job_records import ANY_VERSION
from api.storage.waiting_jobs import WaitingJob, begin_anew, jobs_that_wait

_ACTIVE = ["ENQUEUED", "PENDING", "DELAYED"]
_BROKEN = ["ERROR", "MAX_RECOVERY_ATTEMPTS_EXCEEDED", "CANCELLED"]
_ID_LENGTH = 36
_LOST = {"title": "Internal fault", "detail": "the job was lost; see the service's log"}
_MOST_BEGUN = 50

_logger = logging.getLogger("syncplan.guard")


class StrandedJobs:
    """Looks for jobs that nobody works on.

    Parameters
    ----------
    version_grace_s : how long jobs wait for a worker of the version that began them; None where
        jobs of other versions are left alone
    job_over : called with each job that is failed
    """

    def __init__(
        self,
        database: Database,
        queue: JobQueue,
        version_grace_s: float | None,
        job_over: Callable[[str], None],
    ) -> None:
        self._database = database
        self._queue = queue
        self._grace_s = version_grace_s
        self._job_over = job_over
        self._suspects: set[WaitingJob] = set()

    def look(self) -> None:
        """Begin jobs anew, move them to this version, or fail them, as they need."""
        with self._database.reading() as connection:
            waiting = jobs_that_wait(connection)
            gone = _GoneVersions(self._grace_s, connection)
        active = self._active_versions()
        suspects = set()
        for job in waiting:
            known = active.get(job.id)
            version = job.version
            if version == ANY_VERSION and known:
                # begun by nobody, or just taken by a version
                version = next(iter(known)) or VERSION
            if version not in (VERSION, ANY_VERSION):
                if gone.is_gone(version):
                    _logger.warning("job %s moves from version %s to %s", job.id, version, VERSION)
                    self._begin_anew(job, VERSION, keep=False)
            elif not known:
                suspects.add(job)
        for job in suspects:
            self._revive(job)
        self._suspects = suspects

    def _active_versions(self) -> Mapping[str, set[str | None]]:
        """The versions of the workflows that wait or run, for each job."""
        found: defaultdict[str, set[str | None]] = defaultdict(set)
        # of this application: others may keep theirs in the same database
        for one in self._queue.client.list_workflows(
            status=_ACTIVE, application_name=APPLICATION, load_input=False, load_output=False
        ):
            found[one.workflow_id[:_ID_LENGTH]].add(one.app_version)
        return found

    def _revive(self, job: WaitingJob) -> None:
        """Fail a job that a fault has ended; begin it anew if nothing works on it for two looks."""
        broken = self._queue.client.list_workflows(
            workflow_id_prefix=job.id, status=_BROKEN, load_input=False, load_output=False, limit=1
        )
        if broken or job.begun >= _MOST_BEGUN:
            _logger.error("job %s was lost: workflows %s", job.id, [one.status for one in broken])
            with self._database.writing() as connection:
                ended = job_records.end_job(connection, job.id, "failed", error=_LOST)
            if ended:
                self._job_over(job.id)
        elif job in self._suspects:
            _logger.warning("job %s has no workflow; it begins anew", job.id)
            self._begin_anew(job, job.version or ANY_VERSION, keep=True)

    def _begin_anew(self, job: WaitingJob, version: str, *, keep: bool) -> None:
        with self._database.writing() as connection:
            if not begin_anew(connection, job, version, keep=keep):
                return
        # no job without a row is entered, and none entered twice: should this process end here,
        # the job has no workflow, and the next look finds it
        self._queue.delete(job.id)
        with self._database.writing() as connection:
            self._queue.add_job(connection, job.id, job.owner, version or None)


class _GoneVersions:
    """Which versions nobody runs any more, as of one moment."""

    def __init__(self, grace_s: float | None, connection: Connection) -> None:
        self._grace_s = grace_s
        self._living = executors.living_versions(connection)
        self._last_seen = executors.last_seen(connection)
        now = executors.agreed_moment(connection)
        self._since = "" if grace_s is None else earlier(now, grace_s)

    def is_gone(self, version: str | None) -> bool:
        """Return whether jobs of a version wait no longer; one from before version 2 is None."""
        if self._grace_s is None or version in self._living:
            return False
        return version is None or self._last_seen.get(version, "") < self._since
