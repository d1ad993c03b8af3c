"""Records kept during a flight: errors and sigmas over time, and tracks of the first trials.

    samples   .................................................
    tracks    .   .   .   .   .   .   .   .   .   .   .   .   .     TRACK_POINTS a period
    series    .       .       .       .       .       .       .     at most MOST_TIMES
    moments               .                       .           .     MOMENTS, see below

Moments are spread over the run, each a share of a turn further round than the last, so that they do
not overlap.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index, short_repr
from syncplan.estimation.filter_setup import poses_of

TRACK_POINTS = 60
MOST_POINTS = 2400
"""Points of a track in a period, and at most in all."""

MOST_TIMES = 601

MOMENTS = 12

TRACKED, TRACKED_OF_MANY, MANY_VEHICLES = 3, 1, 20
"""Number of trials with tracks: for up to MANY_VEHICLES vehicles, and for more."""


def tracked_trials(count: int) -> int:
    """Return the number of trials with tracks, for `count` vehicles."""
    return TRACKED if count <= MANY_VEHICLES else TRACKED_OF_MANY


@dataclass(frozen=True, slots=True)
class RecordedSteps:
    """Steps at which tracks, series and moments are recorded, each in order.

    Attributes
    ----------
    tracks : (t,) of places
    series : (k,) of sums over trials, every few steps of `tracks`
    moments : (m,) of covariances, a subset of `tracks`
    """

    tracks: Index
    series: Index
    moments: Index

    @classmethod
    def of(cls, steps: int, sample_time: float, period: float) -> "RecordedSteps":
        """Return the recorded steps of a run of `steps` samples of `sample_time` s."""
        every = max(1, round(period / sample_time / TRACK_POINTS), -(-steps // MOST_POINTS))
        tracks = np.arange(0, steps + 1, every)
        few = -(-len(tracks) // MOST_TIMES)
        share = np.arange(1, MOMENTS + 1) / MOMENTS
        turns = steps * sample_time / period
        # whole turns, and a share of one that grows to a whole turn at the end
        at = share * turns if turns < 2.0 else np.floor(share * (turns - 1.0)) + share
        places = np.floor(at * period / (every * sample_time) + 1e-6).astype(np.int64)
        return cls(tracks, tracks[::few], tracks[np.unique(np.minimum(places, len(tracks) - 1))])

    @property
    def every(self) -> int:
        """Samples from one step of the series to the next."""
        return int(self.series[1]) if len(self.series) > 1 else 1


@dataclass(frozen=True, slots=True, repr=False)
class Track:
    """True and estimated places of the vehicles of a trial.

    Attributes
    ----------
    trial : its number
    true, estimated : (t, n, 2) m, at steps RecordedSteps.tracks; NaN where a vehicle is gone
    covariances : (m, n, 3) m^2, the filter's own xx, yy and xy, at RecordedSteps.moments
    """

    trial: int
    true: Array
    estimated: Array
    covariances: Array

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, repr=False)
class LaneRecords:
    """Records of trials in progress, a lane each; the first few have tracks.

    Attributes
    ----------
    steps : steps at which they are recorded
    squares : (k, n, lanes) m^2, squared errors of places
    variances : (k, n, lanes) m^2, the filter's own
    bounds : (k, n, lanes) m^2, variances of the bound along the path; filled in after the flight
    estimated : (t, n, 2, tracked) m
    covariances : (m, n, 3, tracked) m^2, xx, yy and xy
    """

    steps: RecordedSteps
    squares: Array
    variances: Array
    bounds: Array
    estimated: Array
    covariances: Array

    __repr__ = short_repr

    @classmethod
    def empty(cls, steps: RecordedSteps, n: int, trials: range) -> "LaneRecords":
        """Return empty records of n vehicles."""
        tracked = len(range(trials.start, min(trials.stop, tracked_trials(n))))
        over_time = len(steps.series), n, len(trials)
        return cls(
            steps,
            squares=np.zeros(over_time),
            variances=np.zeros(over_time),
            bounds=np.zeros(over_time),
            estimated=np.zeros((len(steps.tracks), n, 2, tracked)),
            covariances=np.zeros((len(steps.moments), n, 3, tracked)),
        )

    def stops(self, begin: int, end: int) -> Iterator[int]:
        """Yield the steps after `begin`, up to `end`, at which something is recorded."""
        of = self.steps.tracks if self.estimated.shape[-1] else self.steps.series
        first, last = np.searchsorted(of, [begin, end], side="right")
        yield from of[first:last].tolist()

    def take(self, step: int, state: tuple[Array, Array], path: Array) -> None:
        """Record the filter's state at a step; `path` (steps + 1, n, 3, lanes) is the truth."""
        estimate, P = state
        places = poses_of(estimate, path.shape[1])[:, :2]
        x = np.arange(0, 3 * len(places), 3)
        variances = P[x, x], P[x + 1, x + 1]
        k = _place_of(step, self.steps.series)
        if k is not None:
            self.squares[k] = ((places - path[step, :, :2]) ** 2).sum(axis=1)
            self.variances[k] = variances[0] + variances[1]
        tracked = self.estimated.shape[-1]
        k = _place_of(step, self.steps.tracks)
        if k is not None:
            self.estimated[k] = places[..., :tracked]
        k = _place_of(step, self.steps.moments)
        if k is not None:
            own = np.stack([*variances, P[x + 1, x]], axis=1)
            self.covariances[k] = own[..., :tracked]


def _place_of(step: int, steps: Index) -> int | None:
    k = int(np.searchsorted(steps, step))
    return k if k < len(steps) and steps[k] == step else None
