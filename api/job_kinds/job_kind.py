"""Kinds of jobs: a study, and the request for one. Jobs, and what their tasks take and return.

A study is computed whole, or divided into batches of trials that any worker may compute. Both run
in child processes: plain values in, plain values out.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Self

from api.limits import RequestLimits
from syncplan.planning.plan_files import Loaded
from syncplan.plotting.figure_table import SubjectKind
from syncplan.recordings.log import Overview
from syncplan.runtime.task_crew import EarlierSearch
from syncplan.scenario.quantities import Section
from syncplan.studies.job_contract import JobKindName
from syncplan.studies.study import STORED, Study, Subject, TrialStudy

if TYPE_CHECKING:
    from pydantic import BaseModel

# --- jobs -----------------------------------------------------------------------------------------


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


# --- kinds ----------------------------------------------------------------------------------------


JobSubject = Loaded | Overview | None
"""Subject of a job: a stored plan, the overview of a stored recording, or neither."""


class JobRequest(Section):
    """The body of a request for a job."""

    study: ClassVar[Study]

    @classmethod
    def further_keys(cls, study: Study) -> dict[str, Any]:
        """Return keys that a study adds, as types and fields by name."""
        return {}

    @classmethod
    def limited(cls) -> dict[str, str]:
        """Return the keys of numbers that the service limits, each with the name of its limit."""
        return {}

    def options(self) -> Any:
        """Return the options of the study."""
        return self.study.options.of_request(self.model_dump(exclude_none=True))

    def subject(self) -> Any:
        """Return the subject of a study that is not about something stored."""
        return None

    def settled(self, subject: JobSubject, limits: RequestLimits) -> Self:
        """Return the request with this service's defaults filled in."""
        return self

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the amount of work, in the study's unit.

        Raises InputError if the request exceeds a limit.
        """
        return self.study.work(subject, self.options())


@dataclass(frozen=True, slots=True)
class JobKind:
    """A kind of job: a study, and the request for one."""

    study: Study
    request: type[JobRequest]

    @property
    def operation(self) -> str:
        """Name of the operation that requests one."""
        return f"{self.study.verb}{self.study.of.capitalize()}"

    @property
    def summary(self) -> str:
        """Summary of that operation."""
        return f"{self.study.verb.capitalize()} a {self.study.of}"

    @property
    def description(self) -> str:
        """Description of that operation."""
        result = "a plan" if self.report is None else "a report"
        events = f" Its events carry {self.study.events}." if self.study.events else ""
        return f"{self.study.sentence} This is a job, whose result is {result}.{events}"

    @property
    def about(self) -> Subject | None:
        """Kind of stored object that the job is about."""
        return self.study.of if self.study.of in STORED else None

    @property
    def report(self) -> "type[BaseModel] | None":
        """Model of the resulting report; None if the result is a plan."""
        document = self.study.document
        return None if document is None else document.model

    @property
    def figures(self) -> SubjectKind | None:
        """Subject kind of that report's figures; None if none can be drawn."""
        return getattr(self.report, "drawn_as", None) or None

    @property
    def divided(self) -> bool:
        """Whether its jobs are divided into batches of trials."""
        return isinstance(self.study, TrialStudy)

    @property
    def keeps_trials(self) -> bool:
        """Whether the figures of each trial can be read."""
        return isinstance(self.study, TrialStudy) and self.study.keeps_trials
