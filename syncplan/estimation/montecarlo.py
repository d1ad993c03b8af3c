"""Monte Carlo: many trials of the filter along one plan, the same bytes on any number of threads.

Trial k draws from SeedSequence(seed, spawn_key=(k,)), the k-th child of SeedSequence(seed), in
this order: initial pose (n, 3), speed readings (steps, n), turn-rate readings (steps, n),
bearings (s,) as the sightings are ordered. Trials are filtered in chunks of CHUNK_TRIALS, cut at
fixed trial numbers, so neither threads nor parts change a byte (see syncplan.estimation.trials).
"""

import threading
from collections import deque
from collections.abc import Callable, Generator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, fields, replace
from typing import Literal

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.estimation import batched_filter
from syncplan.estimation.consistency import gate_threshold
from syncplan.estimation.trials import (
    CHUNK_TRIALS,
    Branch,
    MonteCarloResult,
    joined,
    merge,
    tallied,
)
from syncplan.orbits.circles import Orbits, heading, position
from syncplan.orbits.noise import Noise
from syncplan.orbits.sensors import Sensors
from syncplan.orbits.sightings import Sightings
from syncplan.runtime.cores import usable_cores

__all__ = ["run_trials"]


@dataclass(frozen=True, slots=True)
class _Run:
    """All that the trials of a run share."""

    course: batched_filter.Course
    speeds: Array
    turn_rates: Array
    bearings: Array
    bearing_sigmas: Array
    noise: Noise
    seed: int
    end: int
    with_series: bool
    stop: threading.Event


class _StoppedError(Exception):
    """The run was interrupted; nobody reads this chunk."""


def run_trials(
    orbits: Orbits,
    landmarks: Array,
    sensors: Sensors,
    noise: Noise,
    sightings: Sightings,
    steps: int,
    trials: int,
    seed: int,
    *,
    first_trial: int = 0,
    model: Literal["arc", "euler"] = "arc",
    substeps: int = 10,
    gate_probability: float | None = None,
    with_series: bool = False,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> MonteCarloResult:
    """Return the errors of the filter over `trials` trials of `steps` samples.

    `landmarks` is (m, 2) in m; `sightings` holds who sees whom at k = 1..steps. The filter
    integrates its readings along arcs, or by `substeps` Euler sub-steps. `first_trial`, a multiple
    of CHUNK_TRIALS, makes this a part of a longer run, to be joined by `merge`. `progress` is
    called with the number of trials done. Raises InputError naming the argument at fault.
    """
    _check(steps, trials, first_trial, model, substeps, gate_probability, threads)
    _check_sigmas(sensors.bearing_sigmas, noise)
    _check_sightings(sightings, orbits.count, len(landmarks))
    course = _course(orbits, landmarks, sensors, noise, sightings, steps)
    course = course._replace(
        drive=course.drive._replace(substeps=substeps if model == "euler" else 0),
        gate=gate_threshold(gate_probability),
    )
    run = _Run(
        course=course,
        speeds=orbits.speeds,
        turn_rates=orbits.turn_rates,
        bearings=_true_bearings(course),
        bearing_sigmas=sensors.bearing_sigmas[course.observers],
        noise=noise,
        seed=seed,
        end=first_trial + trials,
        with_series=with_series,
        stop=threading.Event(),
    )
    batched_filter.compile_kernels(orbits.count)
    parts: list[MonteCarloResult] = []
    branches: tuple[Branch, ...] = ()
    with closing(_in_order(run, first_trial, threads or usable_cores())) as chunks:
        for part in chunks:
            parts.append(replace(part, branches=()))
            branches = joined([*branches, *part.branches])
            if progress is not None:
                progress(part.first_trial + part.trials - first_trial)
    return replace(merge(parts), branches=branches)


def _check(
    steps: int,
    trials: int,
    first_trial: int,
    model: str,
    substeps: int,
    gate_probability: float | None,
    threads: int | None,
) -> None:
    if first_trial < 0 or first_trial % CHUNK_TRIALS:
        problem = f"{first_trial} is not a multiple of {CHUNK_TRIALS}"
        raise InputError(problem, key="first_trial")
    for key, value in (("steps", steps), ("trials", trials), ("substeps", substeps)):
        if value < 1:
            raise InputError(f"{value} given, at least 1 is needed", key=key)
    if threads is not None and threads < 1:
        raise InputError(f"{threads} given, at least 1 is needed", key="threads")
    if model not in ("arc", "euler"):
        raise InputError(f"{model!r} is unknown; choose arc or euler", key="model")
    if gate_probability is not None and not 0.0 < gate_probability < 1.0:
        problem = f"{gate_probability} is not between 0 and 1"
        raise InputError(problem, key="gate_probability")


def _check_sigmas(bearing_sigmas: Array, noise: Noise) -> None:
    if not np.all(bearing_sigmas > 0.0):
        problem = f"{bearing_sigmas.min()} rad given; a bearing's sigma must be positive"
        raise InputError(problem, key="bearing_sigmas")
    for field in fields(noise):
        value = getattr(noise, field.name)
        if not (np.isfinite(value) and value >= 0.0):
            raise InputError(f"{value} given; it must not be negative", key=field.name)


def _check_sightings(sightings: Sightings, n: int, landmarks: int) -> None:
    """The kernels trust these indices, so none may point past the bodies there are."""
    named = (("observers", sightings.observers, n), ("targets", sightings.targets, n + landmarks))
    for key, index, limit in named:
        wrong = index[(index < 0) | (index >= limit)]
        if len(wrong):
            problem = f"index {wrong[0]} is outside 0..{limit - 1}: sightings of another scenario?"
            raise InputError(problem, key=f"sightings.{key}")


def _course(
    orbits: Orbits,
    landmarks: Array,
    sensors: Sensors,
    noise: Noise,
    sightings: Sightings,
    steps: int,
) -> batched_filter.Course:
    """The course of `steps` samples, by arcs and without a gate."""
    times = np.arange(steps + 1) * sensors.sample_time
    first = sightings.first_of_steps(steps)
    seen = slice(first[1], first[-1])
    deviations = [noise.position_sigma, noise.position_sigma, noise.heading_sigma]
    return batched_filter.Course(
        truth=np.concatenate([position(orbits, times), heading(orbits, times)[..., None]], axis=2),
        landmarks=np.array(landmarks, dtype=np.float64).reshape(-1, 2),
        first=np.maximum(first - first[1], 0),
        observers=np.array(sightings.observers[seen], dtype=np.int64),
        targets=np.array(sightings.targets[seen], dtype=np.int64),
        initial_variances=np.tile(np.square(deviations), (orbits.count, 1)),
        bearing_variances=np.square(sensors.bearing_sigmas),
        drive=batched_filter.Drive(
            time=float(sensors.sample_time),
            substeps=0,
            speed_variance=float(noise.speed_sigma) ** 2,
            turn_rate_variance=float(noise.turn_rate_sigma) ** 2,
        ),
        gate=np.inf,
    )


def _true_bearings(course: batched_filter.Course) -> Array:
    """(s,) bearings without noise, in rad, not wrapped."""
    steps = len(course.truth) - 1
    step = np.repeat(np.arange(steps + 1), np.diff(course.first))
    fixed = np.broadcast_to(course.landmarks, (steps + 1, *course.landmarks.shape))
    places = np.concatenate([course.truth[:, :, :2], fixed], axis=1)
    away = places[step, course.targets] - places[step, course.observers]
    true = np.arctan2(away[:, 1], away[:, 0]) - course.truth[step, course.observers, 2]
    return np.asarray(true)


def _in_order(run: _Run, first_trial: int, threads: int) -> Generator[MonteCarloResult]:
    """Results of all chunks, in order, a few computed ahead.

    Whatever interrupts the caller also stops the threads, each after the trials it is at.
    """
    pending: deque[Future[MonteCarloResult]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        try:
            for start in range(first_trial, run.end, CHUNK_TRIALS):
                pending.append(pool.submit(_chunk, run, start))
                if len(pending) > 2 * threads:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:
            run.stop.set()


def _chunk(run: _Run, start: int) -> MonteCarloResult:
    """The result of the trials from `start` to the chunk's or the run's end."""
    n, steps = len(run.speeds), len(run.course.truth) - 1
    stop, lanes = min(start + CHUNK_TRIALS, run.end), batched_filter.lanes_for(n)
    sums = np.zeros((steps + 1 if run.with_series else 0, n, len(batched_filter.SERIES)))
    tallies = []
    for first in range(start, stop, lanes):
        if run.stop.is_set():
            raise _StoppedError
        trials = range(first, min(first + lanes, stop))
        tallies.append(batched_filter.empty_tally(n, len(trials), sums))
        batched_filter.filter_lanes(run.course, _readings(run, trials), tallies[-1])
    return tallied(tallies, steps=steps, seed=run.seed, first_trial=start)


def _readings(run: _Run, trials: range) -> batched_filter.Readings:
    """Noisy initial poses and readings, a lane for each trial."""
    steps, n, lanes = len(run.course.truth) - 1, len(run.speeds), len(trials)
    sizes = (3 * n, steps * n, steps * n, len(run.bearings))
    draws = np.empty((lanes, sum(sizes)))
    for trial, row in zip(trials, draws, strict=True):
        sequence = np.random.SeedSequence(run.seed, spawn_key=(trial,))
        np.random.Generator(np.random.PCG64(sequence)).standard_normal(out=row)
    poses, speeds, turn_rates, bearings = np.split(draws.T, np.cumsum(sizes)[:-1])
    noise = run.noise
    pose_sigmas = np.sqrt(run.course.initial_variances).ravel()
    speeds = _scattered(np.tile(run.speeds, steps), noise.speed_sigma, speeds)
    turn_rates = _scattered(np.tile(run.turn_rates, steps), noise.turn_rate_sigma, turn_rates)
    return batched_filter.Readings(
        initial=_scattered(run.course.truth[0].ravel(), pose_sigmas, poses).reshape(n, 3, lanes),
        speeds=speeds.reshape(steps, n, lanes),
        turn_rates=turn_rates.reshape(steps, n, lanes),
        bearings=_scattered(run.bearings, run.bearing_sigmas, bearings),
    )


def _scattered(truth: Array, sigma: Array | float, draws: Array) -> Array:
    """Truth (k,) plus sigma times draws (k, lanes), lanes contiguous."""
    scattered = np.empty(draws.shape)
    np.multiply(draws, np.asarray(sigma)[..., None], out=scattered)
    scattered += truth[:, None]
    return scattered
