"""Models of answers that are not contracts of syncplan itself."""

import json
from typing import Annotated, Any, Generic, TypeVar

from pydantic import BaseModel, ConfigDict, Field
from sqlalchemy import Row

from api.storage.holdings import RecordingRow
from api.storage.job_records import JobRow
from syncplan.reports.covariance_report import PositionCovariancesDocument
from syncplan.reports.design_report import FrontPoint
from syncplan.reports.plan_report import PlanDocument
from syncplan.reports.refinement_report import PlanSoFar
from syncplan.studies.job_contract import JobKindName, JobState

Id = Annotated[str, Field(examples=["019a2b3c-4d5e-7f60-8123-456789abcdef"])]
Time = Annotated[str, Field(description="RFC 3339, UTC", examples=["2026-05-01T09:00:00.000000Z"])]


class _Answer(BaseModel):
    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True
    )


Entry = TypeVar("Entry", bound=_Answer)


class _Page(_Answer, Generic[Entry]):
    items: list[Entry]
    next: str | None
    """Path of the next page; null on the last"""


class StoredPlan(PlanDocument):
    """A plan as the library makes it, with what was added when it was stored."""

    model_config = ConfigDict(use_attribute_docstrings=True)

    id: Id
    created_at: Time
    parent_id: str | None
    """The plan this one was refined from"""


class Outline(_Answer):
    """What a small map of a plan shows, in m: three significant digits of its extent."""

    circles: list[tuple[float, float, float]] = Field(examples=[[[0.0, 0.0, 20.0]]])
    """Centre x, y and radius of each circle, of the first 200"""
    landmarks: list[tuple[float, float]] = Field(examples=[[[0.0, 40.0]]])
    """Positions [x, y] of landmarks, of the first 200"""
    area: list[tuple[float, float]] | None
    """Corners [x, y] of the area that circles lie within; null where there is none"""


class PlanSummary(_Answer):
    """Summary of a plan in lists."""

    id: Id
    parent_id: str | None
    """The plan this one was refined from"""
    created_at: Time
    name: str | None = Field(examples=["survey"])
    """The scenario's title"""
    vehicles: int = Field(examples=[6])
    observable: bool
    go: bool | None = Field(examples=[True])
    """Whether the verdict is GO; null for a plan of an early version, which has none"""
    predicted_rms_m: float | None = Field(examples=[1.29])
    """RMS over all vehicles"""
    worst_predicted_rms_m: float | None = Field(examples=[1.57])
    """Predicted RMS error of the worst vehicle; null where unknown, and for plans stored by earlier
    versions"""
    outline: Outline | None
    """What a small map needs; null for plans stored by earlier versions"""


class PlanPage(_Page[PlanSummary]):
    """Plans, newest first."""


class Recording(_Answer):
    """Overview of a recording."""

    id: Id
    created_at: Time
    size: int = Field(examples=[184_320])
    """Stored size in bytes"""
    name: str = Field(examples=["hall"])
    robots: list[str] = Field(examples=[["rover", "mule"]])
    """Names of the robots"""
    landmarks: list[int | str] = Field(examples=[["pole", "gate"]])
    """Names of the landmarks; numbers where the files number them"""
    begin_s: float
    """Start of the odometry, by the recording's clock"""
    duration_s: float
    """Duration of the odometry"""
    bearings: int
    """Sightings with a direction"""
    distances: int
    """Sightings with a distance"""
    has_truth: bool
    """Whether it holds ground truth for every robot"""


class RecordingPage(_Page[Recording]):
    """Recordings, newest first."""


class KeptBytes(_Answer):
    """Bytes of an owner's plans, jobs with their events and results, answers under an
    Idempotency-Key, and recordings; each counts with its content and some hundred bytes more.
    """

    plans: int
    jobs: int
    answers: int
    recordings: int


class Usage(_Answer):
    """What an owner uses of the service, and the most allowed."""

    bytes: KeptBytes
    max_bytes: int
    """Most bytes of all kinds together"""
    computing_s: float
    """Computing time of the jobs of the last 24 hours"""
    max_job_seconds: float
    """Computing time in 24 hours after which no more jobs are taken"""


class FigureValues(_Answer):
    """A figure for Plotly."""

    data: list[dict[str, Any]]
    """Plotly's traces"""
    layout: dict[str, Any]
    """Plotly's layout"""
    frames: list[dict[str, Any]] | None = None
    """Plotly's frames of an animation"""


class Preview(_Answer):
    """A plan that was not stored, with its figures."""

    plan: PlanDocument
    figures: dict[str, FigureValues]
    """The figures asked for, by name"""
    covariances: PositionCovariancesDocument | None = None
    """Predicted covariances of positions; absent where not asked for"""


class Progress(_Answer):
    """Progress of a job, in trials; starts of a refinement, sightings of a replay, searches of a
    design.
    """

    done: int
    total: int


class Failure(_Answer):
    """Reason why a job failed."""

    title: str
    detail: str
    errors: list[dict[str, str]] | None = None


class Job(_Answer):
    """A job: its state, its progress and the path of its result."""

    id: Id
    kind: JobKindName
    state: JobState
    progress: Progress
    request: dict[str, Any] | None
    """The request with defaults filled in; null in lists"""
    plan_id: str | None
    """The plan it is about; null for a sweep, a replay and a design"""
    recording_id: str | None = Field(default=None, exclude_if=lambda value: value is None)
    """The recording it is about; present only for a replay"""
    created_at: Time
    started_at: str | None
    ended_at: str | None
    result: str | None
    """Path of the result, once the job has succeeded"""
    result_plan_id: str | None
    """The plan a refinement made"""
    error: Failure | None
    """Reason why the job failed"""


class JobPage(_Page[Job]):
    """Jobs, newest first."""


class JobEvent(_Answer):
    """A change of a job, as an event of its stream."""

    state: JobState
    progress: Progress
    at: Time
    doing: str | None = Field(default=None, exclude_if=lambda value: value is None)
    """What is done at present; present only in some events of a design"""
    front: list[FrontPoint] | None = Field(default=None, exclude_if=lambda value: value is None)
    """What was found so far for each team; present only in some events of a design"""
    best: PlanSoFar | None = Field(default=None, exclude_if=lambda value: value is None)
    """The best plan found so far; present only in some events of a refinement"""
    finished: int | None = Field(default=None, exclude_if=lambda value: value is None)
    """Number of first trials that the figures of the running job are of; present only in some
    events of a validation or a flight"""


def plan_summary(row: Row[*tuple[Any, ...]]) -> PlanSummary:
    """Return the summary of a stored plan for answers."""
    outline = row.outline and json.loads(row.outline)
    return PlanSummary(**{**row._mapping, "outline": outline})


def recording_answer(row: RecordingRow) -> Recording:
    """Return the model of a stored recording for answers."""
    return Recording(
        id=row.id, created_at=row.created_at, size=row.size, **json.loads(row.overview)
    )


def job_answer(row: JobRow) -> Job:
    """Return the model of a stored job for answers."""
    return Job(
        id=row.id,
        kind=row.kind,
        state=row.state,
        progress=Progress(done=row.done, total=row.total),
        request=None if row.request is None else json.loads(row.request),
        plan_id=row.plan_id,
        recording_id=row.recording_id,
        created_at=row.created_at,
        started_at=row.started_at,
        ended_at=row.ended_at,
        result=f"/v1/jobs/{row.id}/result" if row.state == "succeeded" else None,
        result_plan_id=row.result_plan_id,
        error=None if row.error is None else Failure.model_validate_json(row.error),
    )
