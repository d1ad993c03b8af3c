"""Run of the filter on a recording.

Each sample and each time of a sighting ends a step of the filter; errors are evaluated at the
samples. Odometry is integrated over each step along an arc. The filter runs as for one trial of a
Monte Carlo (`lane_filter.LaneFilter.run`), so its figures mean the same. If the recording has no
truth, zeros stand for it: the errors that the filter records are then its estimates.

Sums of innovations over blocks show whether the errors of sightings last. Innovations are white if
each sighting has an independent error. If the errors of one observer and target last, k of them in
a block add up to more than root k. With normalised innovations e of a block,

    ratio = sum over blocks of (sum of e)^2 / sum of e^2

is 1 for white ones, give or take root of 2 / blocks. NIS times the ratio is the NIS of sums. If
NIS is small but that of sums is not, errors last, and smaller sigmas would make the filter
overconfident.

Source: Bar-Shalom, Li, Kirubarajan (2001), 5.4.2 (whiteness of innovations); Newey, West (1987),
Econometrica 55 (the variance of sums).
"""

from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as NotYetError
from dataclasses import dataclass
from threading import Thread
from types import MappingProxyType

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.filter_options import FilterOptions, lane_filter_of
from syncplan.estimation.filter_setup import (
    FilterRun,
    FilterSetup,
    FilterStatistics,
    Readings,
    Truth,
    build_setup,
    empty_statistics,
)
from syncplan.estimation.recorded_readings import (
    Clock,
    RecordedSightings,
    clock_of,
    mean_odometry,
    sightings_of,
    true_poses,
    truth_known,
)
from syncplan.estimation.replay_settings import STARTS, ReplaySettings
from syncplan.estimation.trials import MonteCarloResult, result_of, series
from syncplan.orbits.circles import wrap
from syncplan.orbits.error_states import ERROR_STATES, StateLayout
from syncplan.recordings.log import Log

LOOK_EVERY_S = 0.1
"""Interval in s between reports of a run's progress."""

Seen = Callable[[int], None]
"""Callback that receives the number of sightings processed so far."""

PERIOD = 59.9
"""Time in s that a batch solution covers; its estimate counts from one minute on."""

REACH = 5.0
"""Typical position error in m of a lost robot."""


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """A run of the filter on a recording.

    Attributes
    ----------
    clock, sightings : of the run
    landmarks : indices of the chosen ones among the recording's
    setup, readings : of the filter, with a single lane
    truth : (samples + 1, n, 3) m, m, rad; zeros if not recorded
    known : (samples + 1,) whether the truth is known; errors of other samples do not count
    at_samples : (samples + 1,) step of the filter that ends at each sample
    layout : of poses and bias states
    has_truth : whether the true poses of all robots are recorded
    """

    clock: Clock
    sightings: RecordedSightings
    landmarks: Index
    setup: FilterSetup
    readings: Readings
    truth: Array
    known: Flags
    at_samples: Index
    layout: StateLayout
    has_truth: bool


@dataclass(frozen=True, slots=True)
class FilteredRun:
    """Result of a filter over a run.

    Attributes
    ----------
    result : one trial's errors
    innovations, weights : (s,) in the unit of each sighting's kind, and 1 over the innovation's
        variance, 0 where the sighting was rejected
    errors, error_sigmas : (e,) estimated lasting errors at the end, in the order of the layout
    estimates : (samples + 1, n, 3) m, m, rad, estimated poses, headings wrapped, NaN in gaps of
        the truth; no rows unless a series was kept
    """

    result: MonteCarloResult
    innovations: Array
    weights: Array
    errors: Array
    error_sigmas: Array
    estimates: Array


def run_of(log: Log, settings: ReplaySettings, options: FilterOptions) -> RecordedRun:
    """Return the run of a recording; raises InputError naming what does not fit."""
    settings.check_start(log.name, has_truth=log.has_truth)
    used = log.landmark_places(settings.landmarks)
    clock = clock_of(log, settings.sample_time, settings.portion)
    known = truth_known(log, clock, settings.max_truth_gap)
    first = int(np.argmax(known))
    if not known[first + 1 :].any():
        problem = "the truth is known at less than two samples of the run; bridge longer gaps of it"
        raise InputError(problem, key="max_truth_gap")
    if settings.start_poses is None:
        # nothing is known of a start in a gap of the truth
        clock, known = clock.later(first), known[first:]
    seen, truth = sightings_of(log, clock, used, settings), true_poses(log, clock)
    # exact equality: sightings at a sample have the same time
    ends = np.unique(np.concatenate([clock.times, seen.times]))
    compared, at_samples = np.full(len(ends), -1), np.searchsorted(ends, clock.times)
    compared[at_samples] = np.where(known, np.arange(len(known)), -1)
    step_of = np.searchsorted(ends, seen.times)
    sigmas = np.array([settings.bearing_sigma, settings.range_sigma])
    layout = _layout(len(log.robots), settings)
    setup = build_setup(
        layout=layout,
        landmarks=log.landmarks[used],
        first=np.searchsorted(step_of, np.arange(len(ends) + 1)).astype(np.int64),
        observers=seen.observers,
        targets=seen.targets,
        kinds=seen.kinds,
        variances=np.square(sigmas[seen.kinds]),
        noise=settings.noise,
        sample_time=settings.sample_time,
        period=PERIOD,
        reach=REACH,
        options=options,
        samples=clock.samples,
        spans=np.diff(ends),
        compared=compared,
        noise_known=False,
    )
    readings = Readings(
        initial=_start_of(truth[0], settings, options.seed)[..., None],
        speeds=mean_odometry(log, clock, ends, 1)[..., None],
        turn_rates=mean_odometry(log, clock, ends, 2)[..., None],
        sightings=seen.values[:, None],
    )
    return RecordedRun(
        clock, seen, used, setup, readings, truth, known, at_samples, layout, log.has_truth
    )


def _start_of(truth: Array, settings: ReplaySettings, seed: int) -> Array:
    """Initial estimate (n, 3) in m, m, rad: as given, or at or about the true poses."""
    if settings.start_poses is not None:
        poses = np.array(settings.start_poses, dtype=np.float64)
        if poses.shape != truth.shape:
            problem = f"has shape {poses.shape}; needed are x, y and heading of {len(truth)} robots"
            raise InputError(problem, key="start_poses")
        if not np.isfinite(poses).all():
            raise InputError("holds a value that is not finite", key="start_poses")
        return poses
    if not STARTS[settings.start].is_drawn:
        return truth.copy()
    noise, random = settings.noise, np.random.default_rng(seed)
    sigmas = np.array([noise.position_sigma, noise.position_sigma, noise.heading_sigma])
    return np.asarray(truth + sigmas * random.standard_normal(truth.shape))


def filtered(run: RecordedRun, options: FilterOptions, progress: Seen | None = None) -> FilteredRun:
    """Return the result of the options' filter over a run.

    Raises NoSolutionError if the filter diverges. An interrupt ends the wait at once.
    """
    n, sightings = run.layout.count, len(run.sightings.times)
    samples = run.clock.samples if options.with_series else None
    counted = empty_statistics(1, run.layout.size, samples, sightings)
    x, P = _in_thread(run, options, counted, progress)
    counted.series[~run.known[: len(counted.series)]] = np.nan
    judged_from, known = run.setup.judged_from, run.known[1:]
    result = result_of([counted], n, steps=len(known), judged_from=judged_from, known=known)
    if not np.isfinite(result.mean_squares).all():
        raise NoSolutionError(
            "the filter diverged: its errors are no longer finite; larger sigmas may help"
        )
    innovations, weights = counted.innovations[..., 0].T
    sigmas = np.sqrt(np.diag(P[3 * n :, 3 * n :, 0]))
    estimates = _estimates(run.truth, result)
    return FilteredRun(result, innovations, weights, x[3 * n :, 0], sigmas, estimates)


def _estimates(truth: Array, result: MonteCarloResult) -> Array:
    """Estimated poses over time, from the truth and the errors."""
    if not result.branches:
        return np.zeros((0, *truth.shape[1:]))
    estimates = truth + series(result).mean_errors
    estimates[..., 2] = wrap(estimates[..., 2])
    return estimates


def _in_thread(
    run: RecordedRun, options: FilterOptions, counted: FilterStatistics, progress: Seen | None
) -> tuple[Array, Array]:
    """Filter in another thread; return the final state (3n + e, 1) and covariance.

    In the main thread, compiled code would delay an interrupt and lose it.
    """
    done: Future[tuple[Array, Array]] = Future()

    def work() -> None:
        try:
            done.set_result(_run(run, options, counted))
        except BaseException as error:
            done.set_exception(error)

    Thread(target=work, daemon=True).start()
    while progress is not None:
        try:
            return done.result(LOOK_EVERY_S)
        except NotYetError:
            progress(int(counted.accepted[0] + counted.gated[0]))
    return done.result()


def _run(
    run: RecordedRun, options: FilterOptions, counted: FilterStatistics
) -> tuple[Array, Array]:
    constants = run.layout.first_changing - 3 * run.layout.count
    changing = len(run.layout.sigmas) - constants
    truth = Truth(
        run.truth[..., None],
        # the true bias states are not known
        constants=np.zeros((constants, 1)),
        changing=np.zeros((run.clock.samples + 1, changing, 1)),
    )
    streams = [np.random.SeedSequence(options.seed)]
    filter_ = lane_filter_of(options.filter_model)
    return filter_.run(FilterRun(run.setup, run.readings, truth, counted), streams)


def _layout(count: int, settings: ReplaySettings) -> StateLayout:
    """Layout of the poses, then of the lasting errors with a sigma above 0."""
    columns: dict[str, Index] = {}
    sigmas: list[float] = []
    times: list[float] = []
    for name, key in settings.lasting_errors().items():
        sigma = float(getattr(settings, key))
        if sigma > 0.0:
            columns[name] = (3 * count + len(sigmas) + np.arange(count))[:, None]
            sigmas += [sigma] * count
            times += [np.inf if ERROR_STATES[name].constant else settings.bearing_walk_time] * count
    return StateLayout(
        tuple(columns), MappingProxyType(columns), np.array(sigmas), np.array(times), count
    )


# --- lasting errors -------------------------------------------------------------------------------


BLOCK_S = 10.0
SURE = 3.0
"""Standard errors by which a ratio must exceed 1 to show lasting errors."""


@dataclass(frozen=True, slots=True)
class Lasting:
    """Scatter of sums of one kind's innovations, relative to that of white ones.

    Attributes
    ----------
    ratio : mean square of the sums, relative to that of white innovations
    blocks : number of sums
    """

    ratio: float
    blocks: int

    @property
    def lasts(self) -> bool:
        """Whether errors last, beyond chance."""
        return bool(self.ratio > 1.0 + SURE * np.sqrt(2.0 / max(self.blocks, 1)))

    @property
    def growth(self) -> float:
        """Factor by which lasting errors enlarge a sigma; 1 if errors do not last."""
        return float(np.sqrt(self.ratio)) if self.lasts else 1.0


def lasting_of(run: RecordedRun, made: FilteredRun, kind: int) -> Lasting:
    """Return the scatter of sums of a kind's innovations, by observer and target."""
    seen, used = run.sightings, (made.weights > 0.0) & (run.sightings.kinds == kind)
    if not used.any():
        return Lasting(1.0, 0)
    scaled = (made.innovations * np.sqrt(made.weights))[used]
    block = (seen.times[used] // BLOCK_S).astype(np.int64)
    blocks = np.column_stack([seen.observers[used], seen.targets[used], block])
    _, number = np.unique(blocks, axis=0, return_inverse=True)
    sums = np.bincount(number.ravel(), scaled)
    return Lasting(float(np.sum(sums**2) / np.sum(scaled**2)), len(sums))
