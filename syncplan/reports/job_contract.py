"""What the service and its clients agree on about jobs: their kinds and their states.

queued --> running --> succeeded | failed
   \\__________\\______> cancelled          an ended job changes no more
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

JobKindName = Literal["refinement", "validation", "flight", "sweep", "replay"]
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
"""Every state of a job, with what it means."""

UNFINISHED: tuple[JobState, ...] = ("queued", "running")
"""The states that change; a job in any other has ended."""


def has_ended(state: JobState) -> bool:
    """Return whether a job in this state changes no more."""
    return state not in UNFINISHED
