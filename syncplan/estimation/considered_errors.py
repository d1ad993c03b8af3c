"""What errors that the filter does not estimate cost: its true mean square error along the circles.

The filter's gains come from its own recursion, which knows nothing of these errors; its true
covariance from syncplan.estimation.wide_covariances with all that the scenario names. Both are
linear: they hold while errors stay small beside the distances to what is seen. Where a filter is
so wrong that it is off by a large part of those, its tangents are taken elsewhere and its gate
rejects sightings; the true error can then be larger or smaller, and only trials show it.
"""

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.referred_system import PosteriorBound, ReferredSystem
from syncplan.estimation.wide_covariances import considered_along
from syncplan.estimation.wide_system import WideSystem
from syncplan.orbits.contacts import Windows
from syncplan.orbits.error_states import ERROR_STATES, StateLayout, layout_of
from syncplan.orbits.sightings import steps_within
from syncplan.orbits.team import Team

__all__ = ["expected_errors", "neglected_errors"]


def neglected_errors(team: Team) -> tuple[str, ...]:
    """Return the names of the errors that a team has and its filter does not estimate."""
    named, estimated = layout_of(team, tuple(ERROR_STATES)).names, layout_of(team).names
    return tuple(name for name in named if name not in estimated)


def expected_errors(team: Team, windows: Windows, duration: float) -> PosteriorBound:
    """Return the mean square errors over `duration` s of a filter that neglects errors.

    They are no bound but what that filter is to be expected to make of its sightings; where it
    neglects nothing, both are the same. Its further states follow layout_of(team, ERROR_STATES).
    Raises NoSolutionError as posterior_bound.
    """
    poses = ReferredSystem.along(team, windows, steps_within(duration, team.sensors.sample_time))
    own = WideSystem.widened(poses, layout_of(team))
    whole = WideSystem.widened(poses, layout_of(team, tuple(ERROR_STATES)))
    held = _places(own.layout, whole.layout)

    def carried(covariance: Array) -> PosteriorBound:
        starts = own.with_errors(covariance), whole.with_errors(covariance)
        return whole.carried(considered_along(own.run, whole.run, held, starts))

    return poses.from_start(carried)


def _places(own: StateLayout, whole: StateLayout) -> Index:
    """(own.size,) where the states of a layout are in one with more errors."""
    held = np.arange(own.size)
    for name in own.names:
        has = own.columns[name] >= 0
        held[own.columns[name][has]] = whole.columns[name][has]
    return held
