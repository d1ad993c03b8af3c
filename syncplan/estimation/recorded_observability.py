"""Observability of a recording over time: rank and certificate of its sightings in windows.

The sightings of each window of `window` s are judged like those of a plan's window. Paths follow
odometry from the true poses at the beginning of the window or, without truth, from the filter's
estimates then.
"""

from dataclasses import dataclass
from itertools import groupby

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.recorded_run import FilteredRun, RecordedRun
from syncplan.observability.sliding_windows import (
    Placed,
    SeenWindow,
    WatchedTeam,
    judged_windows,
    undetermined,
)
from syncplan.orbits.circles import unit

STEPS_IN_WINDOW = 3
MOST_WINDOWS = 300
"""Largest number of windows: a longer recording has them further apart."""


@dataclass(frozen=True, slots=True)
class Gap:
    """Time span over which the team was not observable.

    Attributes
    ----------
    begin, end : s since the beginning of the run; no window that ends between them determined all
    least_rank : least rank of these windows
    robots : indices of the robots with some coordinate undetermined
    """

    begin: float
    end: float
    least_rank: int
    robots: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class SeenOverTime:
    """Observability over windows of a recording, each standing for the step that ends with it.

    Attributes
    ----------
    window, step : s
    judged, observable, certified : s, total length of the steps for which this holds
    state_dim : rank of a window that determines all
    gaps : in order of time
    position_sigmas : (w,) m, of the worst robot from each window alone; infinite where it is not
        observable
    """

    window: float
    step: float
    judged: float
    observable: float
    certified: float
    state_dim: int
    gaps: tuple[Gap, ...]
    position_sigmas: Array

    @property
    def longest_gap(self) -> float:
        """Length in s of the longest gap; 0 if the team was always observable."""
        return max((gap.end - gap.begin for gap in self.gaps), default=0.0)


def seen_over_time(run: RecordedRun, made: FilteredRun, window: float) -> SeenOverTime:
    """Return the observability from the accepted sightings of a run, in windows of `window` s.

    If the recording has no truth, `made` must hold the estimates.
    """
    clock = run.clock
    samples = max(min(round(window / clock.sample_time), clock.samples), 1)
    step = max(samples // STEPS_IN_WINDOW, -(-(clock.samples - samples) // MOST_WINDOWS), 1)
    ends = np.arange(samples, clock.samples + 1, step)
    used = np.flatnonzero(made.weights > 0.0)
    seen, setup = run.sightings, run.setup
    poses = run.truth if run.has_truth else made.estimates
    begins = ends - samples
    watched = WatchedTeam(
        times=seen.times[used],
        observers=seen.observers[used],
        targets=seen.targets[used],
        kinds=seen.kinds[used],
        sigmas=np.sqrt(setup.variances[used]),
        count=run.layout.count,
        landmarks=setup.landmarks,
        scale=_scale(poses[:, :, :2]),
    )
    times = clock.times
    found = list(
        judged_windows(
            watched, _along_odometry(run, poses, used, begins), times[begins], times[ends]
        )
    )
    length = step * clock.sample_time
    return SeenOverTime(
        window=samples * clock.sample_time,
        step=length,
        judged=len(found) * length,
        observable=length * sum(one.observability.observable for one in found),
        certified=length * sum(one.certificate.holds for one in found),
        state_dim=3 * watched.count,
        gaps=_gaps(found, length),
        position_sigmas=np.array([one.position_sigma for one in found]),
    )


def _along_odometry(run: RecordedRun, poses: Array, used: Index, begins: Index) -> Placed:
    """Positions in windows from samples `begins`, by odometry from the last known poses till there.

    `poses` are (samples + 1, n, 3) m, m, rad.
    """
    setup, n, paths = run.setup, run.layout.count, _paths(run)
    o, t = run.sightings.observers[used], run.sightings.targets[used]
    step_of = setup.sighted_at[used]
    known = np.maximum.accumulate(np.where(run.known, np.arange(len(run.known)), 0))

    def placed(k: int, of: slice) -> tuple[Array, Array]:
        last = known[begins[k]]
        start, begin = poses[last], paths[run.at_samples[last]]
        turn = start[:, 2] - begin[:, 2]
        now, a, b = paths[step_of[of]], o[of], t[of]
        places = np.empty((len(a), 2, 2))
        for side, body in ((0, a), (1, np.minimum(b, n - 1))):
            gone = now[np.arange(len(a)), body, :2] - begin[body, :2]
            places[:, side] = start[body, :2] + _turned(gone, turn[body])
        fixed = b >= n
        places[fixed, 1] = setup.landmarks[b[fixed] - n]
        gone = paths[run.at_samples[begins[k]], :, :2] - begin[:, :2]
        return start[:, :2] + _turned(gone, turn), places

    return placed


def _gaps(found: list[SeenWindow], length: float) -> tuple[Gap, ...]:
    """Gaps: runs of unobservable windows, each window counting for the step before its end."""
    gaps = []
    for observable, group in groupby(found, key=lambda one: one.observability.observable):
        if not observable:
            short = list(group)
            robots = {k for one in short for k in undetermined(one.observability)}
            least = min(one.observability.rank for one in short)
            gaps.append(
                Gap(max(short[0].end - length, 0.0), short[-1].end, least, tuple(sorted(robots)))
            )
    return tuple(gaps)


def _paths(run: RecordedRun) -> Array:
    """Odometry from the origin, (steps + 1, n, 3) m, m, rad, at the end of each step."""
    spans = run.setup.spans[:, None]
    speeds, turns = run.readings.speeds[..., 0], run.readings.turn_rates[..., 0] * spans
    headings = np.vstack([np.zeros(turns.shape[1]), np.cumsum(turns, axis=0)])
    half = 0.5 * turns
    chords = (speeds * spans * np.sinc(half / np.pi))[..., None] * unit(headings[:-1] + half)
    places = np.concatenate([np.zeros((1, *chords.shape[1:])), np.cumsum(chords, axis=0)])
    return np.concatenate([places, headings[..., None]], axis=2)


def _turned(vectors: Array, angles: Array) -> Array:
    """Vectors (s, 2) turned by angles (s,)."""
    cos, sin = np.cos(angles), np.sin(angles)
    x, y = vectors[:, 0], vectors[:, 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def _scale(places: Array) -> float:
    """RMS distance in m of the robots from the mean of all their positions."""
    away = places - places.mean(axis=(0, 1))
    return max(float(np.sqrt(np.mean(np.sum(away**2, axis=2)))), 1e-3)
