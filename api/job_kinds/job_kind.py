"""What a kind of job is made of: its request, its task and the words that present it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

from pydantic import BaseModel

from api.job_kinds.job_tasks import TrialTask, WholeTask
from api.limits import RequestLimits
from syncplan.planning.plan_files import Loaded
from syncplan.plotting.figure_table import SubjectKind
from syncplan.recordings.log import Overview
from syncplan.reports.job_contract import JobKindName
from syncplan.scenario.quantities import Section

JobSubject = Loaded | Overview | None
"""What a job is about: a stored plan, a stored recording in short, or neither."""


class JobRequest(Section):
    """The body of a request for a job."""

    limited: ClassVar[Mapping[str, str]] = {}
    """Numbers that the service limits, each with the limit's name in RequestLimits."""

    def settled(self, subject: JobSubject, limits: RequestLimits) -> Self:
        """Return the request with defaults of this service filled in."""
        return self

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the amount of work, in the kind's unit.

        Raises InputError if the request exceeds a limit.
        """
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class JobOperation:
    """How a job of a kind is requested.

    Attributes
    ----------
    id : operationId in the OpenAPI document
    path : below /v1; holds {plan_id} or {recording_id} if the job is about one
    body, body_required : what the body says, and whether there must be one
    """

    id: str
    path: str
    summary: str
    description: str
    body: str
    body_required: bool

    @property
    def about(self) -> Literal["plan", "recording"] | None:
        """What the job is about, of what is stored."""
        if "{plan_id}" in self.path:
            return "plan"
        return "recording" if "{recording_id}" in self.path else None


@dataclass(frozen=True, slots=True)
class JobKind:
    """A kind of job.

    Attributes
    ----------
    title, plural : the kind as sentences name it
    unit : what its work is counted in
    report : model of the report it results in; None if it results in a plan
    figures : what figures of that report are figures of; None if none can be drawn
    keeps_trials : whether the values of each trial can be read
    """

    name: JobKindName
    title: str
    plural: str
    unit: str
    request: type[JobRequest]
    operation: JobOperation
    task: WholeTask | TrialTask[Any, Any]
    report: type[BaseModel] | None = None
    figures: SubjectKind | None = None
    keeps_trials: bool = False
