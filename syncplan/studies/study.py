"""The form that all studies have.

A study is a class in a module of this package and a line in study_table. Its command, its job in
the service and Client.start follow from these. The modules that compute are imported within
methods: the command line lists all studies, and starts fast.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol

if TYPE_CHECKING:
    from pydantic import BaseModel

    from syncplan.estimation.divided_runs import RunOfTrials
    from syncplan.runtime.task_crew import EarlierSearch

Subject = Literal["plan", "scenario", "recording", "team"]
STORED: tuple[Subject, ...] = ("plan", "recording")
"""Subjects that the service stores; a request states any other."""


class StudyProgress(Protocol):
    """Callback that receives the work done, in the study's unit, and what is known so far."""

    def __call__(self, done: int, **known: Any) -> None:
        """Take the work done, and values by the keys that they have in the events of a job."""


def unheard(done: int, **known: Any) -> None:
    """Take progress that nobody asks for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Execution:
    """How a study is carried out; none of it changes a result.

    Attributes
    ----------
    workers : number of threads or processes; all cores if None
    progress : called with the work done, and with what is known so far
    earlier : what an interrupted search kept
    """

    workers: int | None = None
    progress: StudyProgress = unheard
    earlier: "EarlierSearch | None" = None


ALONE = Execution()
"""On all cores, with nobody to hear of its progress."""


@dataclass(frozen=True, slots=True)
class DocumentKind:
    """A kind of document.

    Attributes
    ----------
    module, name : module and name of its model, which is loaded on demand
    mode : Pydantic's mode: validation for documents read, serialization for documents written
    published : whether the command line prints its schema
    title : title of a report without a name; empty for documents that are no reports
    """

    module: str
    name: str
    mode: Literal["validation", "serialization"] = "serialization"
    published: bool = True
    title: str = ""

    @property
    def model(self) -> "type[BaseModel]":
        """Model of the document."""
        model: type[BaseModel] = getattr(import_module(self.module), self.name)
        return model


class Study(ABC):
    """A study.

    Attributes
    ----------
    name : noun for its reports and its jobs
    verb : name of its command
    of : what it is about; a team is one that is still to be found
    sentence : what it does
    unit : unit of its work
    example : arguments of its command, for the help; empty if its command is written by hand
    requires : names of the verdicts that its command can require, see syncplan.cli.arguments
    left_out : names of options that neither the command line nor the service offers
    hidden : names of options that the command line does not offer
    body : description of a request to the service
    events : what the events of its jobs carry beside progress; empty for nothing
    document : kind of its result; None where it is a plan
    ends_early : whether it can end early, with the best result so far
    parallel : whether it can use several threads or processes
    """

    name: ClassVar[str]
    verb: ClassVar[str]
    of: ClassVar[Subject]
    sentence: ClassVar[str]
    unit: ClassVar[str]
    example: ClassVar[str] = ""
    requires: ClassVar[tuple[str, ...]] = ()
    left_out: ClassVar[tuple[str, ...]] = ()
    hidden: ClassVar[tuple[str, ...]] = ()
    body: ClassVar[str]
    events: ClassVar[str] = ""
    document: ClassVar[DocumentKind | None] = None
    ends_early: ClassVar[bool] = False
    parallel: ClassVar[bool] = False

    @property
    def plural(self) -> str:
        """Plural of its name."""
        return f"{self.name}s"

    @property
    def path(self) -> str:
        """Path of its jobs, below /v1 of the service."""
        stored = f"/{self.of}s/{{{self.of}_id}}" if self.of in STORED else ""
        return f"{stored}/{self.plural}"

    @property
    @abstractmethod
    def options(self) -> type[Any]:
        """Class of its options: of RunOptions, or a Pydantic model."""

    def work(self, subject: Any, options: Any) -> int:
        """Return the amount of work in the study's unit.

        `subject` is a plan, or a plan file's content, with a `scenario`; for a recording, it is an
        Overview. Other subjects are those of `run`.
        """
        return 1

    @abstractmethod
    def run(self, subject: Any, options: Any, how: Execution = ALONE) -> Any:
        """Return the result, which syncplan.reports.presentations has a document of."""


class TrialStudy(Study):
    """A study of independent trials, in runs that may be computed in parts.

    Attributes
    ----------
    keeps_trials : whether the figures of each trial of the first run can be read
    """

    unit = "trials"
    parallel = True
    keeps_trials: ClassVar[bool] = True

    def work(self, subject: Any, options: Any) -> int:
        """Return the number of trials."""
        return int(options.trials)

    @abstractmethod
    def first_run(self, subject: Any, options: Any) -> "RunOfTrials":
        """Return the set-up of the first run; raises InputError naming the option at fault."""

    def runs(self, subject: Any, options: Any) -> "Iterable[RunOfTrials]":
        """Yield the set-ups of all runs."""
        return [self.first_run(subject, options)]

    def joined(self, subject: Any, options: Any, results: Sequence[Any]) -> Any:
        """Return the result of the study from those of its runs, in order."""
        return results[0]

    def run(self, subject: Any, options: Any, how: Execution = ALONE) -> Any:
        """Return the result of all trials."""
        from syncplan.estimation.divided_runs import results_of

        runs = self.runs(subject, options)
        results = results_of(runs, threads=how.workers, progress=how.progress)
        return self.joined(subject, options, results)
