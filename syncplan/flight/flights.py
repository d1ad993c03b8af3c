"""Many flights of a team: trials side by side and over threads, the same bytes on any number.

Trials are flown in chunks of CHUNK_TRIALS, as those of a validation are. Of a chunk that is cut
short, figures are those of the whole chunk to rounding; with batch solutions, to how far these
converge: they begin from one sighting in several, of those that any trial beside has made.
"""

import threading
from collections.abc import Callable
from contextlib import closing

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.augmented_setup import AugmentedStatistics, empty_augmented_statistics
from syncplan.estimation.filter_statistics import empty_series
from syncplan.estimation.trial_chunks import StoppedError, chunks_in_order
from syncplan.estimation.trials import CHUNK_TRIALS, Branch, result_of
from syncplan.flight.flight_records import Track
from syncplan.flight.flight_results import (
    FlightFigures,
    FlightResult,
    joined_figures,
    joined_flights,
)
from syncplan.flight.flight_series import sums_of, tracks_of
from syncplan.flight.flown_figures import figures_of, without_gone
from syncplan.flight.flown_lanes import ClosedLoop, FlownLanes
from syncplan.flight.flown_team import FlownTeam
from syncplan.runtime.machine import threads_for


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
    parts: list[FlightResult] = []
    end = first_trial + trials

    def chunk(trials: range, stop: threading.Event) -> FlightResult:
        return _chunk(team, trials, stop)

    found = chunks_in_order(chunk, first_trial, end, threads_for(threads))
    with closing(found) as results:
        for part in results:
            parts.append(part)
            if progress is not None:
                done = part.estimates
                progress(done.first_trial + done.trials - first_trial)
    return joined_flights(parts)


def _chunk(team: FlownTeam, trials: range, stop: threading.Event) -> FlightResult:
    """The result of the trials of a chunk."""
    n, e = team.team.count, len(team.layout.sigmas)
    none = empty_series(n, 0, wanted=False), np.zeros((0, e, 3))
    counted: list[AugmentedStatistics] = []
    figures: list[FlightFigures] = []
    sums: list[Array] = []
    tracks: list[Track] = []
    lanes, judged_from = ClosedLoop.lanes_for(n), 0
    for first in range(trials.start, trials.stop, lanes):
        if stop.is_set():
            raise StoppedError
        part = range(first, min(first + lanes, trials.stop))
        flown = FlownLanes.begun(team, part, empty_augmented_statistics(n, e, len(part), none))
        flown.advance(team.steps)
        judged_from = flown.setup.poses.judged_from
        counted.append(without_gone(team, flown))
        figures.append(figures_of(team, flown))
        if flown.records is not None:
            sums.append(sums_of(team, flown))
            tracks += tracks_of(team, flown, part.start)
    estimates = result_of(
        [one.poses for one in counted],
        [one.errors for one in counted],
        steps=team.steps,
        seed=team.options.seed,
        first_trial=trials.start,
        judged_from=judged_from,
    )
    place = trials.start // CHUNK_TRIALS
    branches = (Branch(0, place, np.sum(sums, axis=0)),) if sums else ()
    return FlightResult(estimates, joined_figures(figures), branches, tuple(tracks))
