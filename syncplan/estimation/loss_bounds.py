"""The posterior bound of what losses leave of a team, many losses in little time.

The noise, the rows and the displacements of the whole team's run are prepared once and selected
from for each loss.
"""

from dataclasses import dataclass

from syncplan.estimation.covariance_kernel import compiled_variances_along
from syncplan.estimation.referred_system import PosteriorBound, ReferredSystem
from syncplan.orbits.contacts import Windows
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.sightings import Remainder, steps_within
from syncplan.orbits.team import Team


@dataclass(frozen=True, slots=True)
class LossBounds:
    """A run of a whole team, to find the bounds of its remainders from."""

    system: ReferredSystem

    @classmethod
    def along(cls, team: Team, windows: Windows, duration: float) -> "LossBounds":
        """Return the run of a team over `duration` s."""
        steps = steps_within(duration, team.sensors.sample_time)
        return cls(ReferredSystem.along(team, windows, steps, layout_of(team, ())))

    def after(self, left: Remainder) -> PosteriorBound:
        """Return the bound of what a loss leaves; raises NoSolutionError as posterior_bound."""
        system = self.system.left_by(left, layout_of(left.team))
        if not system.run.poses_alone:
            return system.from_start(system.bound)
        return system.from_start(
            lambda covariance: system.of_poses(compiled_variances_along(system.run, covariance))
        )
