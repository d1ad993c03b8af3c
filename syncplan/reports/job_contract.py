"""Kinds and states of jobs, shared by the service and its clients.

queued --> running --> succeeded | failed
   \\__________\\______> cancelled          an ended job changes no more
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

JobKindName = Literal["refinement", "validation", "flight", "sweep", "replay", "design"]
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
