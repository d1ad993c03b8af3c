"""Trials of a flight as the package flies them, looked at from inside."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.filter_setup import empty_statistics
from syncplan.flight.flying import flight_run
from syncplan.guidance.flight_results import FlightFigures
from syncplan.guidance.flown_figures import figures_of
from syncplan.guidance.flown_lanes import FlownLanes
from syncplan.guidance.flown_team import FlownTeam
from syncplan.planning.plan_flights import FlightRun
from tests.tools.plain_truth import Sighting


@dataclass(frozen=True, slots=True)
class FlownTrials:
    """Trials side by side that were flown to their end."""

    run: FlightRun
    lanes: FlownLanes
    figures: FlightFigures

    @property
    def path(self) -> Array:
        """(steps + 1, n, 3, lanes) m, m, rad."""
        return self.lanes.flown.path

    def state(self, lane: int) -> Array:
        """(3n + e,) the estimate at the end."""
        return self.lanes.run.state[0][:, lane]

    def covariance(self, lane: int) -> Array:
        """(3n + e, 3n + e) at the end."""
        P = self.lanes.run.state[1][..., lane]
        return np.asarray(np.tril(P) + np.tril(P, -1).T)

    def sightings(self, lane: int) -> list[list[Sighting]]:
        """Of each step."""
        setup, read = self.lanes.setup, self.lanes.readings.sightings[:, lane]
        columns = (setup.observers, setup.targets, setup.kinds, read)
        every = [Sighting(*row) for row in zip(*(one.tolist() for one in columns), strict=False)]
        return [
            [one for one in every[begin:end] if np.isfinite(one.reading)]
            for begin, end in pairwise(setup.first.tolist())
        ]


def flown(subject: Any, chosen: range, **changes: Any) -> FlownTrials:
    """Return some trials of a flight, flown side by side."""
    return flown_of(flight_run(subject, None, **changes), chosen)


def flown_of(run: FlightRun, chosen: range) -> FlownTrials:
    """Return some trials of a flight that is set up, flown side by side."""
    lanes = lanes_begun(run.team, chosen)
    lanes.advance(run.team.steps)
    return FlownTrials(run, lanes, figures_of(run.team, lanes))


def lanes_begun(team: FlownTeam, chosen: range) -> FlownLanes:
    """Return some trials of a flight at time 0."""
    return FlownLanes.begun(team, chosen, empty_statistics(len(chosen), team.size))
