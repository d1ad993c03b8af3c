"""Kinds and states of jobs, shared by the service and its clients.

queued --> running --> succeeded | failed
   \\__________\\______> cancelled          an ended job changes no more
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, TypeAlias

from syncplan.studies.study_table import STUDIES

if TYPE_CHECKING:
    JobKindName: TypeAlias = str
else:
    JobKindName = Literal[tuple(STUDIES)]
"""Name in STUDIES, for models that check it and describe it in their JSON schemas."""

JobState = Literal["queued", "running", "succeeded", "failed", "cancelled"]
EndState = Literal["succeeded", "failed", "cancelled"]

STATES: Mapping[JobState, str] = MappingProxyType(
    {
        "queued": "waits for a worker",
        "running": "a worker computes it",
        "succeeded": "its result can be read",
        "failed": "it has no result; `error` says why",
        "cancelled": "it was stopped on request",
    }
)
"""States of a job, with their meanings."""

UNFINISHED: tuple[JobState, ...] = ("queued", "running")
"""States of a job that has not ended."""


def has_ended(state: JobState) -> bool:
    """Return whether a job in this state has ended and no longer changes."""
    return state not in UNFINISHED
