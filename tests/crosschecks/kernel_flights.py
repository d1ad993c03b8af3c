"""What syncplan.flight itself flies: the simple model beside which plants are flown."""

import numpy as np

from syncplan.flight.flown_lanes import FlownLanes
from syncplan.flight.flown_team import FlownTeam
from tests.crosschecks.comparisons import Summary, kept_of
from tests.tools.flown_trials import lanes_begun

__all__ = ["flown_by_kernels", "summary_of_kernels"]


def flown_by_kernels(flown: FlownTeam, trials: int) -> FlownLanes:
    """Return the first trials of a team, flown to their end."""
    lanes = lanes_begun(flown, range(trials))
    lanes.advance(flown.steps)
    return lanes


def summary_of_kernels(flown: FlownTeam, trials: int) -> Summary:
    """Return the figures of the first trials of a team."""
    lanes = flown_by_kernels(flown, trials)
    path = np.moveaxis(lanes.flown.path, -1, 1)
    kept = kept_of(path, flown.team.orbits, flown.setup.time)
    late = flown.steps - flown.steps // 2
    n = flown.team.count
    poses = lanes.statistics.late_squares[: 3 * n].reshape(n, 3, -1)
    squares = poses[:, :2].sum(axis=1).mean(axis=0) / late
    sighted = np.isfinite(lanes.run.readings.sightings[: lanes.flown.places[1]])
    return Summary(np.sqrt(squares), *kept, sighted.sum(axis=0).astype(float))
