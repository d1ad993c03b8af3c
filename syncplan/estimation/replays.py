"""The filter run on a recording of real robots, and its errors against their recorded truth.

Readings are brought onto the filter's own samples k Ts, which begin as soon as the truth of all
robots is known:

    odometry    held from one reading to the next, and averaged over each sample; zero before the
                first and after the last
    bearings    at the sample nearest to their time, in the order they were taken
    truth       straight lines between its entries; headings unwrapped

The filter then runs as for one trial of a Monte Carlo (`lane_filter.LaneFilter.run`), so its
figures mean the same. It starts at the truth and uses bearings, not ranges.
"""

from collections.abc import Iterable
from concurrent.futures import Future
from dataclasses import dataclass
from threading import Thread
from typing import Unpack

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.consistency import Consistency, coverage, recorded_anees, recorded_nis
from syncplan.estimation.filter_options import FilterChanges, FilterOptions, options_with
from syncplan.estimation.filter_setup import FilterSetup, Readings, build_setup
from syncplan.estimation.filter_statistics import empty_series, empty_statistics
from syncplan.estimation.trials import Accuracy, MonteCarloResult, accuracy, result_of
from syncplan.orbits.bearings import BEARING
from syncplan.orbits.noise import Noise
from syncplan.orbits.sighting_kinds import place_of
from syncplan.recordings.log import NOBODY, Log
from syncplan.results import Result
from syncplan.scenario.rules import excess

__all__ = ["GROUND_ROBOTS", "OPTIONS", "Replay", "longest_gap", "replay"]


GROUND_ROBOTS = Noise(
    speed_sigma=0.15, turn_rate_sigma=0.5, position_sigma=0.01, heading_sigma=0.01
)
"""Wide sigmas for the robots of the MRCLAM data sets, at samples of 0.05 s, from a known start."""

BEARING_SIGMA = 0.08
SAMPLE_TIME = 0.05
OPTIONS = FilterOptions(trials=1, gate_probability=0.999)
"""How the filter runs on a recording where nothing else is asked for."""

LEAST_SIGMA, LARGEST_SIGMA = 1e-6, 1e6
"""Limits of any sigma; those of motion and of the start may also be 0."""


@dataclass(frozen=True, slots=True, repr=False)
class Replay(Result):
    """The filter on a recording, and its errors.

    Attributes
    ----------
    log : the recording
    landmarks : l names, or numbers, of the landmarks whose bearings were used
    meetings : whether bearings between robots were used
    sample_time, duration, begin : s; when the run begins by the recording's clock
    bearing_sigma, noise : what the filter assumed, rad and as Noise
    options : which filter, and its gate
    result : one trial's errors
    accuracy : RMS errors by robot
    coverage : (n,) share of coordinates within the filter's own three sigma
    anees, nis : consistency figures
    unknown, not_asked_for, outside : number of readings of unknown targets; of landmarks or
        robots not asked for; asked for, but nearest to no sample k = 1, 2 .. of the run
    """

    log: Log
    landmarks: tuple[int | str, ...]
    meetings: bool
    sample_time: float
    duration: float
    begin: float
    bearing_sigma: float
    noise: Noise
    options: FilterOptions
    result: MonteCarloResult
    accuracy: Accuracy
    coverage: Array
    anees: Consistency
    nis: Consistency
    unknown: int
    not_asked_for: int
    outside: int

    def __repr__(self) -> str:
        """Return one line: how many robots, how long, and the error."""
        found = self.accuracy.overall()
        return (
            f"<{type(self).__name__}: {len(self.log.robots)} robots over {self.duration:.4g} s, "
            f"RMS {float(found.position):.3g} m>"
        )

    @property
    def gate_probability(self) -> float:
        """Of the innovation gate; 1 accepts all."""
        return 1.0 if self.options.gate_probability is None else self.options.gate_probability


def replay(
    log: Log,
    options: FilterOptions | None = None,
    *,
    landmarks: Iterable[int | str] | None = None,
    meetings: bool = True,
    bearing_sigma: float = BEARING_SIGMA,
    noise: Noise = GROUND_ROBOTS,
    sample_time: float = SAMPLE_TIME,
    **changes: Unpack[FilterChanges],
) -> Replay:
    """Return the errors of the filter on a recording's odometry and bearings.

    `landmarks` are the names of those whose bearings count (numbers, where the recording numbers
    them), all if None; `meetings` says whether bearings between robots count. `bearing_sigma` is
    in rad, `sample_time` in s; the sigmas of `noise`, a syncplan.orbits.noise.Noise, are per
    sample. `options`, or changes of it by name, choose the filter: a bearing counts while it is
    within the gate of `gate_probability`, 0.999 if not given, where 1 accepts all; `with_series`
    keeps errors and sigmas over time. A recording is one trial: `trials`, `seed` and `duration`
    have no effect. Raises InputError naming the argument or the robot at fault, and
    NoSolutionError where the filter diverges.
    """
    _check(bearing_sigma, noise, sample_time)
    chosen = _options(options, changes)
    used = log.landmark_places(landmarks)
    clock = _clock(log, sample_time)
    bearings = _bearings(log, clock, used, meetings=meetings)
    setup = build_setup(
        truth=_truth(log, clock),
        landmarks=log.landmarks[used],
        first=bearings.first,
        observers=bearings.observers,
        targets=bearings.targets,
        kinds=np.full(len(bearings.angles), place_of(BEARING)),
        variances=np.full(len(bearings.angles), bearing_sigma**2),
        noise=noise,
        sample_time=sample_time,
        options=chosen,
    )
    result = _filtered(setup, _readings(log, clock, setup, bearings), chosen)
    return Replay(
        log=log,
        landmarks=tuple(log.landmark_names[place] for place in used.tolist()),
        meetings=meetings,
        sample_time=sample_time,
        duration=clock.steps * sample_time,
        begin=clock.begin,
        bearing_sigma=bearing_sigma,
        noise=noise,
        options=chosen,
        result=result,
        accuracy=accuracy(result),
        coverage=coverage(result.covered[0], result.coverage_samples),
        anees=recorded_anees(float(result.nees[0]), 3 * len(log.robots)),
        nis=recorded_nis(
            float(result.nis_sums[0]), int(result.accepted[0]), chosen.gate_probability
        ),
        unknown=bearings.unknown,
        not_asked_for=bearings.not_asked_for,
        outside=bearings.outside,
    )


def longest_gap(recorded: Array, begin: float, duration: float) -> float:
    """Return the longest time in s between recorded times (k,), while a run lasts."""
    first, last = np.searchsorted(recorded, (begin, begin + duration))
    return float(np.diff(recorded[max(first - 1, 0) : last + 1]).max(initial=0.0))


@dataclass(frozen=True, slots=True)
class _Clock:
    """The filter's samples: k = 0..steps at begin + k sample_time, s by the recording's clock."""

    begin: float
    sample_time: float
    steps: int

    @property
    def times(self) -> Array:
        """(steps + 1,) s since the beginning."""
        return np.asarray(self.sample_time * np.arange(self.steps + 1))

    def since_begin(self, recorded: Array) -> Array:
        """The recording's times since the beginning, in s."""
        return recorded - self.begin


@dataclass(frozen=True, slots=True)
class _Bearings:
    """Bearings as the filter takes them: (s,) each; those of sample k are first[k] to first[k + 1].

    Targets from n on are landmarks, in the order they were chosen.
    """

    first: Index
    observers: Index
    targets: Index
    angles: Array
    unknown: int
    not_asked_for: int
    outside: int


def _readings(log: Log, clock: _Clock, setup: FilterSetup, bearings: _Bearings) -> Readings:
    """What the filter reads in its one lane; it starts at the truth."""
    return Readings(
        initial=setup.truth[0, :, :, None].copy(),
        speeds=_odometry(log, clock, 1)[..., None],
        turn_rates=_odometry(log, clock, 2)[..., None],
        sightings=bearings.angles[:, None],
    )


def _filtered(setup: FilterSetup, readings: Readings, options: FilterOptions) -> MonteCarloResult:
    """The result of the one trial, filtered in another thread.

    Compiled code would keep an interrupt waiting, and lose it.
    """
    n, steps = len(setup.initial_variances), len(setup.truth) - 1
    statistics = empty_statistics(n, 1, empty_series(n, steps, wanted=options.with_series))
    done: Future[None] = Future()

    def run() -> None:
        try:
            options.filter_model.lane_filter.run(setup, readings, statistics)
            done.set_result(None)
        except BaseException as error:
            done.set_exception(error)

    Thread(target=run, daemon=True).start()
    done.result()
    result = result_of([statistics], steps=steps)
    if not np.isfinite(result.mean_squares).all():
        raise NoSolutionError(
            "the filter diverged: its errors are no longer finite; larger sigmas may help"
        )
    return result


def _options(options: FilterOptions | None, changes: FilterChanges) -> FilterOptions:
    """The options of a replay, whose gate may also be 1: no gate."""
    gate = changes.get("gate_probability")
    if gate is not None and not 0.0 < gate <= 1.0:
        problem = f"{gate:g} given; allowed is more than 0, up to 1, which accepts all"
        raise InputError(problem, key="gate_probability")
    if gate == 1.0:
        changes = {**changes, "gate_probability": None}
    return options_with(options or OPTIONS, changes)


def _check(bearing_sigma: float, noise: Noise, sample_time: float) -> None:
    allowed = f"allowed is {LEAST_SIGMA:g} to {LARGEST_SIGMA:g}"
    for key, value in (("bearing_sigma", bearing_sigma), ("sample_time", sample_time)):
        if not LEAST_SIGMA <= value <= LARGEST_SIGMA:
            raise InputError(f"{value:g} given; {allowed}", key=key)
    for key in ("speed_sigma", "turn_rate_sigma", "position_sigma", "heading_sigma"):
        value = getattr(noise, key)
        if value != 0.0 and not LEAST_SIGMA <= value <= LARGEST_SIGMA:
            raise InputError(f"{value:g} given; {allowed}, or 0", key=key)


def _clock(log: Log, sample_time: float) -> _Clock:
    """The samples at which the truth of all robots is known."""
    if not log.has_truth:
        problem = "holds no truth; the filter starts at it, and its errors are from it"
        raise InputError(problem, source=log.name)
    begin = max(float(robot.truth[0, 0]) for robot in log.robots)
    end = min(float(robot.truth[-1, 0]) for robot in log.robots)
    duration = end - begin
    if duration < sample_time:
        raise InputError(
            f"the truth of all robots is known together for {max(duration, 0.0):g} s; at least "
            f"one sample time, {sample_time:g} s, is needed",
            source=log.name,
        )
    problem = excess(duration, sample_time, duration, len(log.robots))
    if problem:
        raise InputError(problem, key="sample_time")
    for robot in log.robots:
        read = robot.odometry[:, 0]
        if read[-1] <= begin or read[0] >= end:
            raise InputError(
                f"the odometry of {robot.name} is from {read[0] - begin:.6g} to "
                f"{read[-1] - begin:.6g} s after the beginning of the run, which lasts "
                f"{duration:.6g} s: by another clock?",
                source=log.name,
            )
    # rounding must not lose a sample of a whole number
    return _Clock(begin, sample_time, int(duration / sample_time + 1e-4))


def _truth(log: Log, clock: _Clock) -> Array:
    """(steps + 1, n, 3) m, m, rad."""
    poses = np.empty((clock.steps + 1, len(log.robots), 3))
    for k, robot in enumerate(log.robots):
        known = clock.since_begin(robot.truth[:, 0])
        poses[:, k, 0] = np.interp(clock.times, known, robot.truth[:, 1])
        poses[:, k, 1] = np.interp(clock.times, known, robot.truth[:, 2])
        poses[:, k, 2] = np.interp(clock.times, known, np.unwrap(robot.truth[:, 3]))
    return poses


def _odometry(log: Log, clock: _Clock, column: int) -> Array:
    """(steps, n) means over each sample of readings that are held until the next."""
    means = np.empty((clock.steps, len(log.robots)))
    for k, robot in enumerate(log.robots):
        known, values = clock.since_begin(robot.odometry[:, 0]), robot.odometry[:, column]
        integral = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(known))])
        means[:, k] = np.diff(np.interp(clock.times, known, integral)) / clock.sample_time
    return means


def _bearings(log: Log, clock: _Clock, used: Index, *, meetings: bool) -> _Bearings:
    robots = {robot.subject: k for k, robot in enumerate(log.robots)}
    targets_by_subject = dict(robots) if meetings else {}
    for place, subject in enumerate(log.landmark_subjects[used].tolist()):
        targets_by_subject[subject] = len(robots) + place
    observers = np.repeat(np.arange(len(robots)), [len(robot.times) for robot in log.robots])
    taken = clock.since_begin(np.concatenate([robot.times for robot in log.robots]))
    subjects = np.concatenate([robot.subjects for robot in log.robots])
    angles = np.concatenate([robot.bearings for robot in log.robots])
    targets = np.array([targets_by_subject.get(one, -1) for one in subjects.tolist()], np.int64)
    targets[np.isnan(angles)] = -1
    samples = np.rint(taken / clock.sample_time)
    order = np.flatnonzero((targets >= 0) & (samples >= 1) & (samples <= clock.steps))
    order = order[np.argsort(taken[order], kind="stable")]
    unknown, asked_for = int(np.sum(subjects == NOBODY)), int(np.sum(targets >= 0))
    return _Bearings(
        first=np.searchsorted(samples[order], np.arange(clock.steps + 2)).astype(np.int64),
        observers=observers[order],
        targets=targets[order],
        angles=angles[order],
        unknown=unknown,
        not_asked_for=len(taken) - unknown - asked_for,
        outside=asked_for - len(order),
    )
