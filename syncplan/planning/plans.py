"""Plan: a judged team with its verdict, and the covariances behind its predicted errors."""

from dataclasses import dataclass, field

from syncplan.errors import NoSolutionError
from syncplan.estimation.bounds import PositionCovariances, position_covariances
from syncplan.planning import judged_team
from syncplan.planning.verdict_checks import verdict_of
from syncplan.results.result import Result
from syncplan.runtime.machine import single_threaded_blas


@dataclass(frozen=True, slots=True, repr=False)
class Plan(Result, judged_team.JudgedTeam):
    """Orbits with the results of the exact code; attributes are those of JudgedTeam."""

    _verdict: judged_team.PlanVerdict | None = field(default=None, init=False, compare=False)

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
    def verdict(self) -> judged_team.PlanVerdict:
        """Whether the plan can be flown, with all findings.

        Computed at the first access and kept.
        """
        verdict = self._verdict
        if verdict is None:
            verdict = verdict_of(self)
            object.__setattr__(self, "_verdict", verdict)
        return verdict

    @single_threaded_blas
    def position_covariances(self, moments: int = 48) -> PositionCovariances:
        """Return the covariance of each vehicle's position at moments of the last period.

        It is that of the bound behind the predicted errors. Where the plan is not observable, it
        keeps growing with the duration. Raises NoSolutionError for teams too large for the exact
        bound.
        """
        duration = self.scenario.duration_s
        if not judged_team.bound_is_affordable(self.team, duration):
            many = f"{self.team.count} vehicles over {duration:g} s"
            raise NoSolutionError(
                f"{many} are too many for error ellipses; plan a shorter duration"
            )
        return position_covariances(self.team, self.windows, duration, moments)
