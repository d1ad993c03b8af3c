"""Parts of a kind of job: its request, its task and the words that present it.

A task is computed whole, or divided into batches of trials that any worker may compute. Both run in
child processes: plain values in, plain values out.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, Literal, Protocol, Self, TypeVar

from pydantic import BaseModel

from api.documents import PlanText
from api.limits import RequestLimits
from syncplan.planning.plan_files import Loaded
from syncplan.plotting.figure_table import SubjectKind
from syncplan.recordings.log import Overview
from syncplan.reports.job_contract import JobKindName
from syncplan.runtime.task_crew import EarlierSearch
from syncplan.scenario.quantities import Section

# --- tasks ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class FinishedSearch:
    """Result of one of a job's searches, as the library keeps it: of a start, or of a team."""

    number: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Shown:
    """Work done so far, and further keys of the job's next event."""

    done: int
    keys: Mapping[str, Any]


Progress = Callable[[int | Shown | FinishedSearch], None]
"""Callback that receives the work done so far, or a finished search, which can be kept."""

TrialProgress = Callable[[int], None] | None
"""Callback that receives the number of trials done so far, if any is given."""


@dataclass(frozen=True, slots=True)
class JobSpec:
    """A job to compute: its kind, its request, and the plan or the recording that it is about.

    `overview` is that of the recording, as JSON.
    """

    id: str
    kind: JobKindName
    request: str
    plan: str | None
    recording: bytes | None = field(default=None, repr=False)
    overview: str | None = None


@dataclass(frozen=True, slots=True)
class Batch:
    """Trials of one of a job's runs."""

    run: int
    first_trial: int
    trials: int


@dataclass(frozen=True, slots=True)
class JobReport:
    """Text of a report's file, and the packed figures of each trial if they are kept."""

    text: str
    trials: bytes | None = None


@dataclass(frozen=True, slots=True)
class EarlierWork:
    """Work kept from earlier attempts at a job that is computed whole.

    Attributes
    ----------
    searches : finished searches by number
    spent_s : computing time
    """

    searches: Mapping[int, bytes]
    spent_s: float

    def resumed(self, progress: Progress) -> EarlierSearch:
        """Return the search as the library goes on with it; `progress` gets what it finishes."""
        return EarlierSearch(
            self.searches,
            self.spent_s,
            lambda number, data: progress(FinishedSearch(number, data)),
        )


@dataclass(frozen=True, slots=True)
class WholeTask:
    """A task that one worker computes whole.

    Attributes
    ----------
    compute : function of the job, earlier work on it, the number of processes to use and a progress
        callback; returns the result
    finishes : whether Ctrl-C makes it return the best found so far
    """

    compute: Callable[[JobSpec, EarlierWork, int, Progress], PlanText | JobReport]
    finishes: bool = False


class RunOfTrials(Protocol):
    """Set-up of a run, of which any worker may compute trials."""

    @property
    def trials(self) -> int:
        """Number of trials."""
        ...


RunT = TypeVar("RunT", bound=RunOfTrials)
FoundT = TypeVar("FoundT")


@dataclass(frozen=True, slots=True)
class TrialMethod(Generic[RunT, FoundT]):
    """Functions that compute the trials of a run and conclude it.

    Attributes
    ----------
    compute : function of a run, the first trial, their number and a progress callback; returns
        their bytes
    conclude : function of a run and the bytes of all its trials, in order; returns its result
    effort : approximate work of a trial of a run, relative to other runs
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
    method : functions for the trials
    report : function of the job and the results of its runs, all trials done; returns the report
    """

    runs: Callable[[JobSpec], list[RunT]]
    method: TrialMethod[RunT, FoundT]
    report: Callable[[JobSpec, Sequence[FoundT]], JobReport]


# --- kinds ----------------------------------------------------------------------------------------


JobSubject = Loaded | Overview | None
"""Subject of a job: a stored plan, the overview of a stored recording, or neither."""


class JobRequest(Section):
    """The body of a request for a job."""

    limited: ClassVar[Mapping[str, str]] = {}
    """Keys of numbers that the service limits, each with the limit's name in RequestLimits."""

    def settled(self, subject: JobSubject, limits: RequestLimits) -> Self:
        """Return the request with this service's defaults filled in."""
        return self

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the amount of work, in the kind's unit.

        Raises InputError if the request exceeds a limit.
        """
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class JobKind:
    """A kind of job, and the operation that requests one.

    Attributes
    ----------
    unit : unit of its work
    operation, summary, description : operationId of its operation, and the texts about it
    body : description of the request's body
    about : kind of stored object that the job is about
    report : model of the resulting report; None if the result is a plan
    figures : subject kind of that report's figures; None if none can be drawn
    keeps_trials : whether the values of each trial can be read
    """

    name: JobKindName
    unit: str
    request: type[JobRequest]
    operation: str
    summary: str
    description: str
    body: str
    task: WholeTask | TrialTask[Any, Any]
    about: Literal["plan", "recording"] | None = None
    report: type[BaseModel] | None = None
    figures: SubjectKind | None = None
    keeps_trials: bool = False

    @property
    def plural(self) -> str:
        """Plural of its name, in sentences and paths."""
        return f"{self.name}s"

    @property
    def path(self) -> str:
        """Path of its operation, below /v1."""
        subject = f"/{self.about}s/{{{self.about}_id}}" if self.about else ""
        return f"{subject}/{self.plural}"

    @property
    def finishes(self) -> bool:
        """Whether its jobs can end early, with the best found so far."""
        return isinstance(self.task, WholeTask) and self.task.finishes
