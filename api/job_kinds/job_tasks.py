"""What computes jobs: whole, or divided into batches of trials that any worker may compute.

Both run in child processes: plain values in, plain values out.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

from api.plan_texts import PlanText
from syncplan.reports.job_contract import JobKindName


@dataclass(frozen=True, slots=True)
class FinishedStart:
    """What a start of a refinement has found, as syncplan.refinement.parallel_starts keeps it."""

    number: int
    data: bytes


Progress = Callable[[int | FinishedStart], None]
"""Takes the work done so far, and what can be kept of it."""

TrialProgress = Callable[[int], None] | None
"""Takes the number of trials done so far, where anybody wants to know."""


@dataclass(frozen=True, slots=True)
class JobSpec:
    """A job to compute: its kind, its request, and the plan or the recording that it is about."""

    id: str
    kind: JobKindName
    request: str
    plan: str | None
    recording: bytes | None = field(default=None, repr=False)


@dataclass(frozen=True, slots=True)
class Batch:
    """Trials of one of a job's runs."""

    run: int
    first_trial: int
    trials: int


@dataclass(frozen=True, slots=True)
class JobReport:
    """A report as the text of its file, and the figures of each trial, packed, if it keeps them."""

    text: str
    trials: bytes | None = None


@dataclass(frozen=True, slots=True)
class EarlierWork:
    """What earlier attempts at a job that is computed whole have left.

    Attributes
    ----------
    starts : finished starts by number
    spent_s : computing time
    """

    starts: Mapping[int, bytes]
    spent_s: float


@dataclass(frozen=True, slots=True)
class WholeTask:
    """A task that one worker computes whole.

    Attributes
    ----------
    compute : from the job, earlier work on it, the number of processes to use and a callback for
        progress to the result
    """

    compute: Callable[[JobSpec, EarlierWork, int, Progress], PlanText | JobReport]


class RunOfTrials(Protocol):
    """The set-up of a run, of which any worker may compute trials."""

    @property
    def trials(self) -> int:
        """Number of trials."""
        ...


RunT = TypeVar("RunT", bound=RunOfTrials)
FoundT = TypeVar("FoundT")


@dataclass(frozen=True, slots=True)
class TrialMethod(Generic[RunT, FoundT]):
    """How trials of a run are computed and what they come to.

    Attributes
    ----------
    compute : from a run, the first trial, their number and a callback for progress to their bytes
    conclude : from a run and the bytes of all its trials, in order, to what it has found
    effort : about how much work a trial of a run is, beside one of another run
    """

    compute: Callable[[RunT, int, int, TrialProgress], bytes]
    conclude: Callable[[RunT, Sequence[bytes]], FoundT]
    effort: Callable[[RunT], float]


@dataclass(frozen=True, slots=True)
class TrialTask(Generic[RunT, FoundT]):
    """A task whose trials are divided into batches.

    Attributes
    ----------
    runs : set-ups of the job's runs; a child process keeps those of its last job
    method : of the trials
    report : from the job and what its runs have found, all trials done, to the result
    """

    runs: Callable[[JobSpec], list[RunT]]
    method: TrialMethod[RunT, FoundT]
    report: Callable[[JobSpec, Sequence[FoundT]], JobReport]
