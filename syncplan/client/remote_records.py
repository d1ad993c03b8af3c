"""What the service keeps, as the client knows it: plans, recordings, jobs."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Self

from syncplan.planning.plan_files import loaded_from, plan_of
from syncplan.planning.planner import Plan
from syncplan.reports.job_contract import JobKindName, JobState, has_ended


@dataclass(frozen=True, slots=True, kw_only=True)
class RemotePlan(Plan):
    """A plan that the service keeps, judged by this library from the orbits it states.

    Attributes
    ----------
    id, parent_id : of the plan, and of the one it was refined from
    created_at : RFC 3339, UTC
    document : all that the service says of it, see syncplan.reports.plan_report.PlanDocument
    """

    id: str
    parent_id: str | None
    created_at: str
    document: Mapping[str, Any] = field(repr=False, compare=False)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Self:
        """Return what a document of the service says."""
        made = plan_of(loaded_from(document, max_vehicles=len(document["vehicles"])))
        values = {one.name: getattr(made, one.name) for one in fields(made) if one.init}
        return cls(
            **values,
            id=document["id"],
            parent_id=document["parent_id"],
            created_at=document["created_at"],
            document=document,
        )


@dataclass(frozen=True, slots=True)
class RemoteJob:
    """A job of the service as it was when last looked at.

    Attributes
    ----------
    done, total : how far it is, in trials; a refinement in starts, a replay in sightings
    document : all that the service says of it
    plan : what it is about, where the client was given that
    """

    id: str
    kind: JobKindName
    state: JobState
    done: int
    total: int
    document: Mapping[str, Any] = field(repr=False, compare=False)
    plan: RemotePlan | None = field(default=None, repr=False, compare=False)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Self:
        """Return what a document of the service says."""
        progress = document["progress"]
        return cls(
            id=document["id"],
            kind=document["kind"],
            state=document["state"],
            done=progress["done"],
            total=progress["total"],
            document=document,
        )

    @property
    def ended(self) -> bool:
        """Whether the job changes no more."""
        return has_ended(self.state)


@dataclass(frozen=True, slots=True)
class RemoteRecording:
    """A recording that the service keeps.

    Attributes
    ----------
    robots, landmarks : names; numbers where the files number landmarks
    document : all that the service says of it
    """

    id: str
    name: str
    robots: tuple[str, ...]
    landmarks: tuple[int | str, ...]
    document: Mapping[str, Any] = field(repr=False, compare=False)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Self:
        """Return what a document of the service says."""
        return cls(
            id=document["id"],
            name=document["name"],
            robots=tuple(document["robots"]),
            landmarks=tuple(document["landmarks"]),
            document=document,
        )
