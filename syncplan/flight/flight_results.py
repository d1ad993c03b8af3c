"""Results of flights: what the filter found, and how the plan was kept; parts join exactly.

Sums over trials follow the binary tree of `syncplan.estimation.trials`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.trials import Branch, MonteCarloResult, joined, merge
from syncplan.flight.flight_records import Track


@dataclass(frozen=True, slots=True)
class FlightFigures:
    """How some trials kept their plan; of n vehicles, p planned pairs and h holds.

    Attributes
    ----------
    planned_meetings : (p,) number of each pair's in a trial
    tracking_squares : (trials, n) m^2, mean square of the distance from the planned place over the
        second half; NaN for a vehicle that is gone by then, here and below
    phase_squares, worst_phases : (trials, n) s^2, s, ahead of or behind the plan, second half
    bound_squares : (trials, n) m^2, mean of the bound's variance along the path, second half
    state_bound_squares : (trials, e) the same of the filter's bias states, in their units
    separations : (trials,) m, the closest that any two come
    nearest : (trials, 2) which two
    nearest_times : (trials,) s
    kept_meetings : (trials, p)
    longest_unseen : (trials, n) s, without a sighting of or by a vehicle
    slowest, fastest : (trials, n) m/s, of the speeds commanded in the second half
    saturated, sought : (trials, n) share of samples
    refused : (trials, n) share of decisions whose program was not solved
    sightings : (trials,) made
    settled : (trials, h) s, from the end of each hold until the vehicle has its phase again; NaN
        where it never has
    """

    planned_meetings: Index
    tracking_squares: Array
    phase_squares: Array
    worst_phases: Array
    bound_squares: Array
    state_bound_squares: Array
    separations: Array
    nearest: Index
    nearest_times: Array
    kept_meetings: Array
    longest_unseen: Array
    slowest: Array
    fastest: Array
    saturated: Array
    sought: Array
    refused: Array
    sightings: Index
    settled: Array


@dataclass(frozen=True, slots=True)
class FlightResult:
    """Trials of a flight, in order.

    Attributes
    ----------
    estimates : errors of estimates against the truth flown; its series are not kept
    figures : how the plan was kept
    branches : sums over trials (k, n, 5) of a FlightSeries; none unless asked for
    tracks : of the first trials; none unless asked for
    """

    estimates: MonteCarloResult
    figures: FlightFigures
    branches: tuple[Branch, ...] = ()
    tracks: tuple[Track, ...] = ()

    @property
    def trials(self) -> int:
        """Number of trials."""
        return self.estimates.trials


SHARED = ("planned_meetings",)
"""Figures that all trials have in common."""


def joined_figures(parts: Sequence[FlightFigures]) -> FlightFigures:
    """Return the figures of all trials of consecutive parts."""
    values = {}
    for one in fields(FlightFigures):
        each = [getattr(part, one.name) for part in parts]
        values[one.name] = each[0] if one.name in SHARED else np.concatenate(each)
    return FlightFigures(**values)


def joined_flights(parts: Sequence[FlightResult]) -> FlightResult:
    """Return one result from consecutive parts of a flight, with the bytes of an undivided one.

    Raises InputError as syncplan.estimation.trials.merge does.
    """
    return FlightResult(
        merge([part.estimates for part in parts]),
        joined_figures([part.figures for part in parts]),
        joined([branch for part in parts for branch in part.branches]),
        tuple(track for part in parts for track in part.tracks),
    )
