"""Monte Carlo: many trials of the filter along one plan, the same bytes on any number of threads.

Trial k draws from SeedSequence(seed, spawn_key=(k,)), the k-th child of SeedSequence(seed), in
this order: initial pose (n, 3), speed readings (steps, n), turn-rate readings (steps, n),
sightings (s,) in their order. Trials are filtered in chunks of CHUNK_TRIALS, cut at
fixed trial numbers, so neither threads nor division into parts changes a byte; see
syncplan.estimation.trials.
"""

import threading
from collections import deque
from collections.abc import Callable, Generator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, fields, replace

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filter_setup import FilterSetup, Readings, build_setup
from syncplan.estimation.filter_statistics import empty_series, empty_statistics
from syncplan.estimation.trials import (
    CHUNK_TRIALS,
    Branch,
    MonteCarloResult,
    joined,
    merge,
    result_of,
)
from syncplan.orbits.circles import heading, position
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS, measured_by_kind, sigmas_by_kind
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team
from syncplan.runtime.cores import usable_cores

__all__ = ["run_trials"]


@dataclass(frozen=True, slots=True)
class _Run:
    """All that the trials of a run share."""

    team: Team
    setup: FilterSetup
    sightings: Array
    sigmas: Array
    options: FilterOptions
    end: int
    stop: threading.Event


class _StoppedError(Exception):
    """The run was interrupted; this chunk will not be read."""


def run_trials(
    team: Team,
    sightings: Sightings,
    steps: int,
    options: FilterOptions,
    *,
    believed: Team | None = None,
    first_trial: int = 0,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> MonteCarloResult:
    """Return the errors of the filter over `options.trials` trials of `steps` samples.

    `sightings` holds who sees whom at k = 1..steps. The filter takes the sigmas of `believed` for
    true, those of the team if None; what it reads has the team's. `first_trial`, a multiple of
    CHUNK_TRIALS, makes this a part of a longer run, which `merge` joins. `progress` is called with
    the number of trials done. Raises InputError naming the argument at fault.
    """
    _check_run(steps, first_trial, threads)
    known = team if believed is None else believed
    _check_sigmas(team)
    _check_sigmas(known)
    _check_sightings(sightings, team.count, len(team.landmarks))
    assumed = replace(team, sensors=known.sensors, noise=known.noise)
    setup = _setup(assumed, sightings, steps, options)
    run = _Run(
        team=team,
        setup=setup,
        sightings=_true_sightings(setup),
        sigmas=sigmas_by_kind(team.sensors, setup.kinds, setup.observers),
        options=options,
        end=first_trial + options.trials,
        stop=threading.Event(),
    )
    options.filter_model.lane_filter.compile(team.count)
    parts: list[MonteCarloResult] = []
    branches: tuple[Branch, ...] = ()
    with closing(_in_order(run, first_trial, threads or usable_cores())) as chunks:
        for part in chunks:
            parts.append(replace(part, branches=()))
            branches = joined([*branches, *part.branches])
            if progress is not None:
                progress(part.first_trial + part.trials - first_trial)
    return replace(merge(parts), branches=branches)


def _check_run(steps: int, first_trial: int, threads: int | None) -> None:
    if first_trial < 0 or first_trial % CHUNK_TRIALS:
        problem = f"{first_trial} is not a multiple of {CHUNK_TRIALS}"
        raise InputError(problem, key="first_trial")
    if steps < 1:
        raise InputError(f"{steps} given, at least 1 is needed", key="steps")
    if threads is not None and threads < 1:
        raise InputError(f"{threads} given, at least 1 is needed", key="threads")


def _check_sigmas(team: Team) -> None:
    for name, kind in SIGHTING_KINDS.items():
        sigmas = kind.sigmas(team.sensors)
        if not np.all(sigmas > 0.0):
            problem = f"{sigmas.min()} {kind.unit} given; a {name}'s sigma must be positive"
            raise InputError(problem, key=kind.sigma_name)
    for field in fields(team.noise):
        value = getattr(team.noise, field.name)
        if not (np.isfinite(value) and value >= 0.0):
            raise InputError(f"{value} given; it must not be negative", key=field.name)


def _check_sightings(sightings: Sightings, n: int, landmarks: int) -> None:
    """The kernels do not check these indices: each must be that of a body, or of a kind."""
    named = (
        ("observers", sightings.observers, n),
        ("targets", sightings.targets, n + landmarks),
        ("kinds", sightings.kinds, len(SIGHTING_KINDS)),
    )
    for key, index, limit in named:
        wrong = index[(index < 0) | (index >= limit)]
        if len(wrong):
            problem = f"index {wrong[0]} is outside 0..{limit - 1}: sightings of another scenario?"
            raise InputError(problem, key=f"sightings.{key}")


def _setup(team: Team, sightings: Sightings, steps: int, options: FilterOptions) -> FilterSetup:
    """The set-up of a run of `steps` samples along the team's circles."""
    orbits, sensors = team.orbits, team.sensors
    times = np.arange(steps + 1) * sensors.sample_time
    first = sightings.first_of_steps(steps)
    seen = slice(first[1], first[-1])
    observers = np.array(sightings.observers[seen], dtype=np.int64)
    kinds = np.array(sightings.kinds[seen], dtype=np.int64)
    return build_setup(
        truth=np.concatenate([position(orbits, times), heading(orbits, times)[..., None]], axis=2),
        landmarks=np.array(team.landmarks, dtype=np.float64).reshape(-1, 2),
        first=np.maximum(first - first[1], 0),
        observers=observers,
        targets=np.array(sightings.targets[seen], dtype=np.int64),
        kinds=kinds,
        variances=np.square(sigmas_by_kind(sensors, kinds, observers)),
        noise=team.noise,
        sample_time=sensors.sample_time,
        options=options,
    )


def _true_sightings(setup: FilterSetup) -> Array:
    """(s,) sightings without noise; angles are not wrapped."""
    steps = len(setup.truth) - 1
    step = np.repeat(np.arange(steps + 1), np.diff(setup.first))
    fixed = np.broadcast_to(setup.landmarks, (steps + 1, *setup.landmarks.shape))
    places = np.concatenate([setup.truth[:, :, :2], fixed], axis=1)
    away = places[step, setup.targets] - places[step, setup.observers]
    return measured_by_kind(setup.kinds, away.T, setup.truth[step, setup.observers, 2])


def _in_order(run: _Run, first_trial: int, threads: int) -> Generator[MonteCarloResult]:
    """Results of all chunks, in order, a few computed ahead.

    Whatever interrupts the caller also stops the threads, each after its present trials.
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
    n, steps = run.team.count, len(run.setup.truth) - 1
    lane_filter = run.options.filter_model.lane_filter
    stop, lanes = min(start + CHUNK_TRIALS, run.end), lane_filter.lanes_for(n)
    sums = empty_series(n, steps, wanted=run.options.with_series)
    statistics = []
    for first in range(start, stop, lanes):
        if run.stop.is_set():
            raise _StoppedError
        trials = range(first, min(first + lanes, stop))
        statistics.append(empty_statistics(n, len(trials), sums))
        lane_filter.run(run.setup, _readings(run, trials), statistics[-1])
    return result_of(statistics, steps=steps, seed=run.options.seed, first_trial=start)


def _readings(run: _Run, trials: range) -> Readings:
    """Noisy initial poses and readings, a lane for each trial."""
    steps, n, lanes = len(run.setup.truth) - 1, run.team.count, len(trials)
    sizes = (3 * n, steps * n, steps * n, len(run.sightings))
    draws = np.empty((lanes, sum(sizes)))
    for trial, row in zip(trials, draws, strict=True):
        sequence = np.random.SeedSequence(run.options.seed, spawn_key=(trial,))
        np.random.Generator(np.random.PCG64(sequence)).standard_normal(out=row)
    poses, speeds, turn_rates, sightings = np.split(draws.T, np.cumsum(sizes)[:-1])
    orbits, noise = run.team.orbits, run.team.noise
    pose_sigmas = np.tile([noise.position_sigma, noise.position_sigma, noise.heading_sigma], n)
    speeds = _scattered(np.tile(orbits.speeds, steps), noise.speed_sigma, speeds)
    turn_rates = _scattered(np.tile(orbits.turn_rates, steps), noise.turn_rate_sigma, turn_rates)
    return Readings(
        initial=_scattered(run.setup.truth[0].ravel(), pose_sigmas, poses).reshape(n, 3, lanes),
        speeds=speeds.reshape(steps, n, lanes),
        turn_rates=turn_rates.reshape(steps, n, lanes),
        sightings=_scattered(run.sightings, run.sigmas, sightings),
    )


def _scattered(truth: Array, sigma: Array | float, draws: Array) -> Array:
    """Truth (k,) plus sigma times draws (k, lanes), lanes contiguous."""
    scattered = np.empty(draws.shape)
    np.multiply(draws, np.asarray(sigma)[..., None], out=scattered)
    scattered += truth[:, None]
    return scattered
