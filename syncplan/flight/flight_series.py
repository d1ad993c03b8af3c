"""Flights over time, over all trials: sums that join exactly, and what they come to.

The sums follow the binary tree of `syncplan.estimation.trials`.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, short_repr
from syncplan.errors import InputError
from syncplan.flight.flight_measures import off_plan
from syncplan.flight.flight_records import RecordedSteps, Track
from syncplan.flight.flight_results import FlightResult
from syncplan.flight.flown_lanes import FlownLanes
from syncplan.flight.flown_team import FlownTeam


@dataclass(frozen=True, slots=True, repr=False)
class FlightSeries:
    """Root mean squares over trials, at k times, of n vehicles; NaN where a vehicle is gone.

    Attributes
    ----------
    times : (k,) s
    tracking : (k, n) m, distance from the planned place
    phase : (k, n) s, ahead of or behind the plan
    error : (k, n) m, of the estimated place
    sigma : (k, n) m, the filter's own, root of the mean of Pxx + Pyy
    bound : (k, n) m, of the bound along the path flown
    """

    times: Array
    tracking: Array
    phase: Array
    error: Array
    sigma: Array
    bound: Array

    __repr__ = short_repr


def sums_of(team: FlownTeam, lanes: FlownLanes) -> Array:
    """Return (k, n, 5) sums over trials that have been flown, in the order of FlightSeries.

    Raises InputError for trials without records.
    """
    records = lanes.records
    if records is None:
        raise _no_series()
    every = records.steps.every
    away, ahead = off_plan(
        team.team.orbits, lanes.flown.path[records.steps.series], every * team.setup.time
    )
    squares = away**2, ahead**2, records.squares, records.variances, records.bounds
    return np.stack([one.sum(axis=-1) for one in squares], axis=-1)


def tracks_of(team: FlownTeam, lanes: FlownLanes, first_trial: int) -> tuple[Track, ...]:
    """Return the tracks of the trials, from `first_trial` on, that have any."""
    records = lanes.records
    if records is None:
        return ()
    steps, present = records.steps, team.present
    true = lanes.flown.path[steps.tracks, :, :2]
    away = ~present[steps.tracks, :, None]
    unknown = ~present[steps.moments, :, None]
    return tuple(
        Track(
            first_trial + lane,
            np.where(away, np.nan, true[..., lane]),
            np.where(away, np.nan, records.estimated[..., lane]),
            np.where(unknown, np.nan, records.covariances[..., lane]),
        )
        for lane in range(records.estimated.shape[-1])
    )


def mean_series(team: FlownTeam, result: FlightResult) -> FlightSeries:
    """Return what the sums come to; raises InputError for a flight without series."""
    if not result.branches:
        raise _no_series()
    total = result.branches[0].sums
    for branch in result.branches[1:]:
        total = total + branch.sums
    time = team.setup.time
    steps = RecordedSteps.of(team.steps, time, team.team.orbits.period).series
    there = team.present[steps][..., None]
    roots = np.where(there, np.sqrt(total / result.trials), np.nan)
    tracking, phase, error, sigma, bound = (roots[..., k] for k in range(roots.shape[-1]))
    times = np.asarray(steps * time, dtype=float)
    return FlightSeries(times, tracking, phase, error, sigma, bound)


def _no_series() -> InputError:
    return InputError("the flight kept no series; fly it with_series=True", key="with_series")
