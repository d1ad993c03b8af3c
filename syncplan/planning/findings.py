"""Findings: what speaks against flying a plan, or has to be known of it, and the verdict."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Level = Literal["stop", "warning", "note"]

MOST_NAMED = 5
"""Findings of one code, or subjects of one finding, that are worded one by one; the rest is
counted."""


@dataclass(frozen=True, slots=True)
class Cure:
    """What would remedy a finding.

    Attributes
    ----------
    text : in words
    change : scenario keys, dotted, with the values that cure it; empty where none is known
    """

    text: str
    change: Mapping[str, float | str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing found of a plan.

    Attributes
    ----------
    code : stable word by which software knows the finding
    level : stop, the plan is not to be flown; warning, it may fail; note
    message : a sentence with its figures
    subjects : names of the vehicles and landmarks concerned
    cure : what would remedy it; None where nothing is to be remedied
    """

    code: str
    level: Level
    message: str
    subjects: tuple[str, ...] = ()
    cure: Cure | None = None


@dataclass(frozen=True, slots=True)
class Verdict:
    """All findings of a plan, in the order of the checks."""

    findings: tuple[Finding, ...]

    @property
    def go(self) -> bool:
        """Whether nothing found stops the flight."""
        return not self.stops

    @property
    def stops(self) -> tuple[Finding, ...]:
        """The findings that stop the flight."""
        return tuple(one for one in self.findings if one.level == "stop")

    @property
    def headline(self) -> str:
        """GO, or NO-GO with the number of reasons."""
        return headline_of(len(self.stops))


def headline_of(stops: int) -> str:
    """Return the first line on a plan with that many findings that stop the flight."""
    return f"NO-GO: {stops} reason{'s' if stops > 1 else ''}" if stops else "GO"
