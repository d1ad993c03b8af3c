"""The posterior bound of what losses leave of a team, many losses in little time.

The noise, the rows and the displacements of the whole team's run are prepared once and selected
from for each loss.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.covariance_kernel import compiled_variances_along
from syncplan.estimation.referred_run import Run
from syncplan.estimation.referred_system import PosteriorBound, ReferredSystem
from syncplan.estimation.wide_system import WideSystem
from syncplan.observability.referred_rows import sighting_rows
from syncplan.orbits.contacts import Windows
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.sightings import Remainder, Sightings, steps_within
from syncplan.orbits.team import Team

SAME_SCALE = 1e-12
"""Relative difference up to which two mean radii are the same."""


@dataclass(frozen=True, slots=True)
class LossBounds:
    """A run of a whole team, to find the bounds of its remainders from."""

    system: ReferredSystem

    @classmethod
    def along(cls, team: Team, windows: Windows, duration: float) -> "LossBounds":
        """Return the run of a team over `duration` s."""
        steps = steps_within(duration, team.sensors.sample_time)
        return cls(ReferredSystem.along(team, windows, steps))

    def after(self, left: Remainder) -> PosteriorBound:
        """Return the bound of what a loss leaves; raises NoSolutionError as posterior_bound."""
        whole = self.system
        sightings, kept = left.sightings(whole.sightings)
        run = Run(
            noise=whole.run.noise[:, left.vehicles],
            rows=whole.run.rows[kept] if self._same_scale(left) else self._rows(left, sightings),
            observers=sightings.observers,
            targets=np.where(sightings.targets < left.team.count, sightings.targets, 0),
            first=sightings.first_of_steps(whole.run.noise.shape[-1] - 1),
        )
        moved = whole.moved[:, left.vehicles]
        system = ReferredSystem(run, moved, whole.scale, left.team, sightings)
        layout = layout_of(left.team)
        if layout.names:
            wide = WideSystem.widened(system, layout)
            return wide.from_start(wide.bound)
        return system.from_start(
            lambda covariance: system.carried(compiled_variances_along(run, covariance))
        )

    def _same_scale(self, left: Remainder) -> bool:
        """Whether rows keep their weights, which near passes take from the mean radius."""
        mean = float(left.team.orbits.radii.mean())
        return abs(mean - self.system.scale) <= SAME_SCALE * mean

    def _rows(self, left: Remainder, sightings: Sightings) -> Array:
        return sighting_rows(left.team, sightings, self.system.scale)
