"""Guidance `mpc` for trials side by side: a decision for each lane, from its own estimates.

Decisions are made where a leg of the flight begins, and hold until the next. The estimate is that
of the filter, carried on by the readings where sightings arrive late.
"""

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.filter_setup import DRIFT, FilterSetup, Readings, States, poses_of
from syncplan.estimation.kernels import Lanes
from syncplan.flight.closed_loop import carry_on
from syncplan.flight.flight_setup import FlightSetup, Flown
from syncplan.flight.flown_team import FlownTeam
from syncplan.flight.predictive_guidance import PredictiveGuidance, PredictiveOptions, Status

FAR = 1e7
"""m, where vehicles are taken to be that are gone: nobody has to keep away from them."""


class LaneGuidance:
    """Guidance of some trials of a flight.

    Attributes
    ----------
    every : samples between decisions
    decisions : how many were made
    refused : (n, lanes) how often a vehicle's program was not solved
    """

    def __init__(self, team: FlownTeam, lanes: int) -> None:
        options = PredictiveOptions()
        self.every = max(1, round(options.interval / team.setup.time))
        self.decisions = 0
        self.refused = np.zeros((team.team.count, lanes), dtype=np.int64)
        self._guidances = [
            PredictiveGuidance(team.team.orbits, team.limits, options) for _ in range(lanes)
        ]

    def command(
        self,
        flight: FlightSetup,
        flown: Flown,
        x: Array,
        at: int,
        filtered: tuple[FilterSetup, Readings],
        lanes: Lanes,
    ) -> None:
        """Write the commands of the leg that begins now, from the estimate x at step `at`."""
        step, n = int(flown.places[0]), len(flown.scales)
        (setup, readings), slopes = filtered, np.empty((12, len(lanes)))
        read = readings.speeds[at:step], readings.turn_rates[at:step]
        carry_on(x, flown.ahead, *read, setup, slopes, lanes)
        mishaps = flight.mishaps
        gone = mishaps.gone_from[:n] <= step
        held = gone | ((mishaps.held_from <= step) & (step < mishaps.held_until)).any(axis=1)
        x = flown.ahead
        places = poses_of(x, n).copy()
        places[gone, :2] = FAR * (1.0 + np.arange(n)[gone])[:, None, None]
        for lane, guidance in enumerate(self._guidances):
            decision = guidance.decide(
                step * flight.time,
                np.ascontiguousarray(places[..., lane]),
                winds_of(x[:, lane], setup.states),
                np.ascontiguousarray(flown.commands[..., lane]),
                held,
                np.ascontiguousarray(flown.moved[..., lane]),
            )
            flown.commands[..., lane] = decision.commands
            self.refused[:, lane] += decision.status == Status.REFUSED
        self.decisions += 1


def winds_of(x: Array, states: States) -> Array:
    """Return (n, 2) m/s, of the air about each vehicle, from a state (3n + e,): wind and own gust.

    Zero where they are not states.
    """
    found, rows = np.zeros((len(states.first) - 1, 2)), np.flatnonzero(states.acts == DRIFT)
    vehicles = np.searchsorted(states.first, rows, side="right") - 1
    np.add.at(found, (vehicles, states.axes[rows, 0]), x[states.columns[rows]])
    return found
