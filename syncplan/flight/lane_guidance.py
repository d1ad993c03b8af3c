"""Guidance `mpc` for trials side by side: a decision for each lane, from its own estimates.

Decisions are made where a leg of the flight begins, and hold until the next. The estimate is that
of the filter, carried on by the readings where sightings arrive late.
"""

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.augmented_frame import GUST, WIND
from syncplan.estimation.augmented_setup import AugmentedReadings, AugmentedSetup
from syncplan.estimation.lane_filter import Lanes
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
        state: tuple[Array, ...],
        at: int,
        filtered: tuple[AugmentedSetup, AugmentedReadings],
        lanes: Lanes,
    ) -> None:
        """Write the commands of the leg that begins now; `state` is the filter's at step `at`."""
        step, n = int(flown.places[0]), len(flown.scales)
        (setup, readings), slopes = filtered, np.empty((12, len(lanes)))
        read = readings.speeds[at:step], readings.turn_rates[at:step]
        poses, errors = carry_on(state[0], state[1], *read, setup, slopes, lanes)
        columns = setup.columns - 3 * n
        mishaps = flight.mishaps
        gone = mishaps.gone_from[:n] <= step
        held = gone | ((mishaps.held_from <= step) & (step < mishaps.held_until)).any(axis=1)
        places = poses.copy()
        places[gone, :2] = FAR * (1.0 + np.arange(n)[gone])[:, None, None]
        for lane, guidance in enumerate(self._guidances):
            decision = guidance.decide(
                step * flight.time,
                np.ascontiguousarray(places[..., lane]),
                winds_of(errors[:, lane], columns),
                np.ascontiguousarray(flown.commands[..., lane]),
                held,
                np.ascontiguousarray(flown.moved[..., lane]),
            )
            flown.commands[..., lane] = decision.commands
            self.refused[:, lane] += decision.status == Status.REFUSED
        self.decisions += 1


def winds_of(errors: Array, columns: Index) -> Array:
    """Return (n, 2) m/s, of the air about each vehicle: wind and own gust, where they are states.

    `columns` are those of the set-up, counted among the further states `errors` (e,).
    """
    found = np.zeros((len(columns), 2))
    for begin in (WIND, GUST):
        own = columns[:, begin : begin + 2]
        found += np.where(own >= 0, errors[np.maximum(own, 0)] if len(errors) else 0.0, 0.0)
    return found
