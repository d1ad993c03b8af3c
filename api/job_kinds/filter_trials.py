"""Trials of the filter on a plan: those of validations and sweeps."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from api.job_kinds.job_tasks import TrialMethod, TrialProgress

if TYPE_CHECKING:
    from syncplan.planning.validation import TrialRun, Validation


def _computed(run: "TrialRun", first: int, trials: int, progress: TrialProgress) -> bytes:
    from syncplan.estimation.trial_archive import pack
    from syncplan.planning.validation import run_part

    return pack(run_part(run, first, trials, threads=1, progress=progress))


def _concluded(run: "TrialRun", parts: Sequence[bytes]) -> "Validation":
    from syncplan.estimation.trial_archive import unpack
    from syncplan.planning.validation import conclude

    return conclude(run, [unpack(one) for one in parts])


def _effort(run: "TrialRun") -> float:
    """Samples and sightings of a trial."""
    return run.steps + len(run.sightings.observers)


FILTER_TRIALS: "TrialMethod[TrialRun, Validation]" = TrialMethod(_computed, _concluded, _effort)
