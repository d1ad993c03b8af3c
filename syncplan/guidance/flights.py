"""Flights of a team: trials side by side and over threads, the same bytes on any number of them.

Trials are flown in chunks of CHUNK_TRIALS, as in a validation. A chunk that is cut short has the
figures of the whole chunk to rounding, or with batch solutions to the accuracy to which these
converge: they begin from one in several of the sightings made in any of the trials side by side.

Figures over time are sums over all trials, which follow the binary tree of
`syncplan.estimation.trials` and so join exactly.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from syncplan.arrays import Array, short_repr
from syncplan.errors import InputError
from syncplan.estimation.batch_solution import compile_solver, solver_is_compiled
from syncplan.estimation.filter_setup import FilterStatistics, empty_statistics
from syncplan.estimation.kernels import compiled_beside
from syncplan.estimation.lane_filter import compile_steps
from syncplan.estimation.montecarlo import chunks_in_order, lanes_side_by_side
from syncplan.estimation.trials import CHUNK_TRIALS, Branch, result_of
from syncplan.guidance.flight_records import RecordedSteps, Track
from syncplan.guidance.flight_results import (
    FlightFigures,
    FlightResult,
    joined_figures,
    joined_flights,
)
from syncplan.guidance.flown_figures import compile_bound, figures_of, off_plan, without_gone
from syncplan.guidance.flown_lanes import ClosedLoop, FlownLanes
from syncplan.guidance.flown_team import FlownTeam
from syncplan.runtime.machine import threads_for

# --- over time ------------------------------------------------------------------------------------


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
    """Return (k, n, 5) sums of squares over flown trials, in the order of FlightSeries.

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
    """Return the tracks of those trials, from `first_trial` on, that have any."""
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
    """Return root mean squares from the sums; raises InputError for a flight without series."""
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


def fly_trials(
    team: FlownTeam,
    first_trial: int,
    trials: int,
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> FlightResult:
    """Return `trials` flights from `first_trial` on, a multiple of CHUNK_TRIALS.

    `progress` is called with the number of trials done. Raises InputError for fewer than 1 thread.
    """
    compile_flights(team)
    asked, compute = range(first_trial, first_trial + trials), partial(_chunk, team)
    return joined_flights(list(chunks_in_order(compute, asked, threads_for(threads), progress)))


def flight_is_compiled(team: FlownTeam) -> bool:
    """Return whether the kernels that a team's flights need are in memory or on disk."""
    solves = team.options.filter_model.finds_start
    return ClosedLoop.is_compiled() and (not solves or solver_is_compiled(team.team.count))


def compile_flights(team: FlownTeam) -> None:
    """Compile the kernels that a team's flights need, where they are not in memory or on disk."""
    n = team.team.count
    if not flight_is_compiled(team):
        with compiled_beside("syncplan.guidance.flights:compile_rest", n):
            compile_steps(n)
            FlownLanes.begun(team, range(1), empty_statistics(1, team.size)).advance(1)


def compile_rest(n: int) -> None:
    """Compile what flights of n vehicles need beside the loop, the solver of every filter too."""
    compile_solver(n)
    # by then, steps that the bound shares are compiled
    compile_bound(n)


def _chunk(team: FlownTeam, trials: range, stop: threading.Event) -> FlightResult:
    """Result of the trials of a chunk."""
    n = team.team.count
    counted: list[FilterStatistics] = []
    figures: list[FlightFigures] = []
    sums: list[Array] = []
    tracks: list[Track] = []
    judged_from = 0
    for part in lanes_side_by_side(trials, n, stop):
        flown = FlownLanes.begun(team, part, empty_statistics(len(part), team.size))
        flown.advance(team.steps)
        judged_from = flown.setup.judged_from
        counted.append(without_gone(team, flown))
        figures.append(figures_of(team, flown))
        if flown.records is not None:
            sums.append(sums_of(team, flown))
            tracks += tracks_of(team, flown, part.start)
    estimates = result_of(
        counted,
        n,
        steps=team.steps,
        seed=team.options.seed,
        first_trial=trials.start,
        judged_from=judged_from,
    )
    place = trials.start // CHUNK_TRIALS
    branches = (Branch(0, place, np.sum(sums, axis=0)),) if sums else ()
    return FlightResult(estimates, joined_figures(figures), branches, tuple(tracks))
