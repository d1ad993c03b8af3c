"""Killed processes fail no job, unless it is the job that kills them."""

import contextlib
import os
import signal
from pathlib import Path

import pytest

from tests.tools.busy_children import at_work, on_duty
from tests.tools.processes import wait_until, worked
from tests.tools.survival import Site, quick, validation

WELL_INTO_IT_S = 0.3
"""Processor time after which a child computes, beyond what it takes to get ready."""


class OneChild:
    """A worker with one child, to be killed while it computes and not while it gets ready."""

    def __init__(self, site: Site) -> None:
        self._site = site
        site.serve("--no-worker")
        self.worker = site.work()
        on_duty(site, 1)
        wait_until(lambda: not at_work(site, self.worker), otherwise=site.logs)
        self._ready_s = self._computed_s()

    def _computed_s(self) -> float:
        return max((worked(child) for child in self._site.family(self.worker)), default=0.0)

    def kill_at_work(self, job_id: str) -> None:
        """Kill the child once it computes, if a job has not ended by then."""
        enough_s = self._ready_s + WELL_INTO_IT_S

        def over() -> bool:
            return self._computed_s() > enough_s or bool(self._site.job(job_id)["ended_at"])

        wait_until(over, otherwise=self._site.logs)
        for child in self._site.family(self.worker):
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)


def one_batch(folder: Path) -> Site:
    """A site where each job is one batch, so that each death is one of the same part."""
    return quick(folder, SYNCPLAN_PROCESSES="1", SYNCPLAN_BATCH_S="600")


@pytest.mark.long
def test_a_part_that_kills_its_processes_fails_and_says_so(tmp_path: Path) -> None:
    with one_batch(tmp_path) as site:
        child = OneChild(site)
        path = f"/v1/plans/{site.hand_in_plan()}/validations"
        job_id = site.ask("POST", path, json={"trials": 20_000, "seed": 1}).json()["id"]
        site.wait_for(job_id, "running")
        # the first deaths may be those of the measuring part
        while site.job(job_id)["state"] == "running":
            child.kill_at_work(job_id)
        shown = site.job(job_id)
        assert shown["state"] == "failed", shown
        assert "5 processes ended while they computed" in shown["error"]["detail"]
        assert "give the workers more memory" in shown["error"]["detail"]
        # whoever comes next finds a child that computes
        site.wait_for(site.hand_in(validation(10, 1)), "succeeded")
