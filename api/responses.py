"""What answers hold, where it is not a contract of syncplan itself."""

import json
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from api.storage.holdings import RecordingRow
from api.storage.job_records import JobRow
from syncplan.reports.job_contract import JobKindName, JobState
from syncplan.reports.plan_report import PlanDocument

_ID = "019a2b3c-4d5e-7f60-8123-456789abcdef"
_TIME = "2026-05-01T09:00:00.000000Z"


class _Answer(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class StoredPlan(PlanDocument):
    """A plan as the library makes it, with what was added when it was stored."""

    id: str = Field(examples=[_ID])
    created_at: str = Field(description="RFC 3339, UTC", examples=[_TIME])
    parent_id: str | None = Field(description="The plan this one was refined from")


class PlanSummary(_Answer):
    """A plan as lists show it."""

    id: str = Field(examples=[_ID])
    parent_id: str | None = Field(description="The plan this one was refined from")
    created_at: str = Field(description="RFC 3339, UTC", examples=[_TIME])
    name: str | None = Field(description="The scenario's title", examples=["survey"])
    vehicles: int = Field(examples=[6])
    observable: bool
    predicted_rms_m: float | None = Field(description="Of all vehicles", examples=[1.29])


class PlanPage(_Answer):
    """Plans, newest first."""

    items: list[PlanSummary]
    next: str | None = Field(description="Where the next page is; null on the last")


class Recording(_Answer):
    """A recording in short."""

    id: str = Field(examples=[_ID])
    created_at: str = Field(description="RFC 3339, UTC", examples=[_TIME])
    size: int = Field(description="Bytes that it takes here", examples=[184_320])
    name: str = Field(examples=["hall"])
    robots: list[str] = Field(description="Names", examples=[["rover", "mule"]])
    landmarks: list[int | str] = Field(
        description="Names; numbers where the files number them", examples=[["pole", "gate"]]
    )
    begin_s: float = Field(description="When the odometry begins, by the recording's clock")
    duration_s: float = Field(description="Of the odometry")
    bearings: int = Field(description="Sightings with a direction")
    distances: int = Field(description="Sightings with a distance")
    has_truth: bool = Field(description="Whether it holds where every robot truly was")


class RecordingPage(_Answer):
    """Recordings, newest first."""

    items: list[Recording]
    next: str | None = Field(description="Where the next page is; null on the last")


class FigureValues(_Answer):
    """A figure as Plotly takes it."""

    data: list[dict[str, Any]] = Field(description="Plotly's traces")
    layout: dict[str, Any] = Field(description="Plotly's layout")
    frames: list[dict[str, Any]] | None = Field(
        default=None, description="Plotly's frames, of an animation"
    )


class Preview(_Answer):
    """A plan that was not stored, with figures of it."""

    plan: PlanDocument
    figures: dict[str, FigureValues] = Field(description="The figures asked for, by name")


class Progress(_Answer):
    """How far a job is, in trials; a refinement in starts, a replay in sightings."""

    done: int
    total: int


class Failure(_Answer):
    """Why a job failed."""

    title: str
    detail: str
    errors: list[dict[str, str]] | None = None


class Job(_Answer):
    """A job: its state, how far it is, and where its result is."""

    id: str = Field(examples=[_ID])
    kind: JobKindName
    state: JobState
    progress: Progress
    request: dict[str, Any] | None = Field(
        description="What was asked, defaults filled in; null in lists"
    )
    plan_id: str | None = Field(description="The plan it is about; null for a sweep and a replay")
    recording_id: str | None = Field(
        default=None,
        description="The recording it is about; only there for a replay",
        exclude_if=lambda value: value is None,
    )
    created_at: str = Field(description="RFC 3339, UTC", examples=[_TIME])
    started_at: str | None
    ended_at: str | None
    result: str | None = Field(description="Where the result is, once the job has succeeded")
    result_plan_id: str | None = Field(description="The plan a refinement made")
    error: Failure | None = Field(description="Why the job failed")


class JobPage(_Answer):
    """Jobs, newest first."""

    items: list[Job]
    next: str | None = Field(description="Where the next page is; null on the last")


class JobEvent(_Answer):
    """A change of a job, as an event of its stream."""

    state: JobState
    progress: Progress
    at: str = Field(description="RFC 3339, UTC", examples=[_TIME])


def recording_answer(row: RecordingRow) -> Recording:
    """Return a stored recording as answers show it."""
    return Recording(
        id=row.id, created_at=row.created_at, size=row.size, **json.loads(row.overview)
    )


def job_answer(row: JobRow) -> Job:
    """Return a stored job as answers show it."""
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
