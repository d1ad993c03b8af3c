"""The plan: a judged team, and the verdict on flying it."""

from dataclasses import dataclass, field

from syncplan.planning.findings import Verdict
from syncplan.planning.judged_team import JudgedTeam
from syncplan.planning.verdict_checks import verdict_of
from syncplan.results import Result


@dataclass(frozen=True, slots=True, repr=False)
class Plan(Result, JudgedTeam):
    """Orbits with all that the exact code found of them; attributes are those of JudgedTeam."""

    _verdict: Verdict | None = field(default=None, init=False, compare=False)

    def __repr__(self) -> str:
        """Return one line: name, vehicles, rank, period."""
        verdict, count = self.observability, self.team.count
        name = f"{self.scenario.name!r}: " if self.scenario.name else ""
        return (
            f"<{type(self).__name__} {name}{count} vehicle{'s' if count > 1 else ''}, "
            f"rank {verdict.rank} of {verdict.state_dim}, "
            f"{'observable' if verdict.observable else 'not observable'}, "
            f"period {self.orbits.period:.4g} s>"
        )

    @property
    def observable(self) -> bool:
        """Whether every position and heading is determined over the window."""
        return self.observability.observable

    @property
    def verdict(self) -> Verdict:
        """Whether the plan can be flown, with all that was found for and against it.

        Computed at the first access and kept.
        """
        found = self._verdict
        if found is None:
            found = verdict_of(self)
            object.__setattr__(self, "_verdict", found)
        return found
