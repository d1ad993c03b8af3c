"""Monte Carlo: many trials of the filter along one plan, byte-identical on any number of threads.

Each trial draws from its own generator (`trial_readings`). Trials are filtered in chunks of
CHUNK_TRIALS, cut at fixed trial numbers, so neither threads nor division into parts changes a byte;
see syncplan.estimation.trials.

Chunks are computed side by side, over threads, and delivered in order.
"""

import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import fields, replace
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.estimation.filter_options import FilterOptions, lane_filter_of
from syncplan.estimation.filter_setup import FilterRun, FilterSetup, build_setup, empty_statistics
from syncplan.estimation.trial_readings import TrialReadings
from syncplan.estimation.trials import (
    CHUNK_TRIALS,
    Branch,
    MonteCarloResult,
    joined,
    merge,
    result_of,
)
from syncplan.orbits.circles import heading, position
from syncplan.orbits.error_states import StateLayout, layout_of
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS, sigmas_by_kind
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team
from syncplan.runtime.machine import threads_for

if TYPE_CHECKING:
    from syncplan.estimation.lane_filter import LaneFilter


# --- chunks ---------------------------------------------------------------------------------------


Result = TypeVar("Result")


class StoppedError(Exception):
    """The run was interrupted; the result of this chunk is not needed."""


def chunks_in_order(
    compute: Callable[[range, threading.Event], Result],
    trials: range,
    threads: int,
    progress: Callable[[int], None] | None,
) -> Generator[Result]:
    """Yield the results of all chunks of the trials, in order, a few computed ahead.

    `compute` takes the trials of a chunk and an event, and raises StoppedError once that is set.
    Whatever interrupts the caller also stops the threads, each after its present trials.
    `progress` is called with the number of trials done.
    """
    ahead = 2 * threads
    pending: deque[Future[Result]] = deque()
    stop = threading.Event()
    chunks = [trials[k : k + CHUNK_TRIALS] for k in range(0, len(trials), CHUNK_TRIALS)]
    with ThreadPoolExecutor(threads) as pool:
        try:
            for place, chunk in enumerate(chunks):
                while len(pending) <= ahead and place + len(pending) < len(chunks):
                    pending.append(pool.submit(compute, chunks[place + len(pending)], stop))
                yield pending.popleft().result()
                if progress is not None:
                    progress(chunk.stop - trials.start)
        finally:
            stop.set()


def lanes_side_by_side(trials: range, n: int, stopped: threading.Event) -> Iterator[range]:
    """Yield, in order, the groups of a chunk's trials of n vehicles that are filtered side by side.

    Raises StoppedError once the run is interrupted.
    """
    from syncplan.estimation.kernels import lanes_for

    lanes = lanes_for(n)
    for k in range(0, len(trials), lanes):
        if stopped.is_set():
            raise StoppedError
        yield trials[k : k + lanes]


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

    `sightings` are those possible at k = 1..steps, as `trial_readings.possible_sightings` returns
    them. The filter assumes the sigmas of `believed`, those of the team if None; its readings have
    the team's. `first_trial`, a multiple of CHUNK_TRIALS, makes this a part of a longer run, which
    `merge` joins. `progress` is called with the number of trials done. Raises InputError naming the
    argument at fault.
    """
    side_by_side = threads_for(threads)
    _check_run(steps, first_trial)
    known = team if believed is None else believed
    _check_sigmas(team)
    _check_sigmas(known)
    _check_sightings(sightings, team.count, len(team.landmarks))
    assumed = replace(team, sensors=known.sensors, noise=known.noise, errors=known.errors)
    layout = layout_of(assumed)
    setup, truth = setup_along(assumed, layout, sightings, steps, options), poses_over(team, steps)
    lane_filter = lane_filter_of(options.filter_model)
    lane_filter.compile(team.count)
    readings = TrialReadings.of(team, truth, setup, layout, options.seed)
    compute = partial(_chunk, readings, lane_filter, options)
    trials = range(first_trial, first_trial + options.trials)
    parts: list[MonteCarloResult] = []
    branches: tuple[Branch, ...] = ()
    with closing(chunks_in_order(compute, trials, side_by_side, progress)) as chunks:
        for part in chunks:
            parts.append(replace(part, branches=()))
            branches = joined([*branches, *part.branches])
    return replace(merge(parts), branches=branches)


def _check_run(steps: int, first_trial: int) -> None:
    if first_trial < 0 or first_trial % CHUNK_TRIALS:
        problem = f"{first_trial} is not a multiple of {CHUNK_TRIALS}"
        raise InputError(problem, key="first_trial")
    if steps < 1:
        raise InputError(f"{steps} given, at least 1 is needed", key="steps")


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
    """Check the indices of bodies and kinds, which the kernels do not check."""
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


def poses_over(team: Team, steps: int) -> Array:
    """Return (steps + 1, n, 3) m, m, rad: a team's poses on its circles at each sample."""
    times = np.arange(steps + 1) * team.sensors.sample_time
    places, headings = position(team.orbits, times), heading(team.orbits, times)
    return np.concatenate([places, headings[..., None]], axis=2)


def setup_along(
    team: Team, layout: StateLayout, sightings: Sightings, steps: int, options: FilterOptions
) -> FilterSetup:
    """Return the set-up of a run of `steps` samples along a team's circles."""
    orbits, sensors = team.orbits, team.sensors
    first = sightings.first_of_steps(steps)
    seen = slice(first[1], first[-1])
    observers = np.array(sightings.observers[seen], dtype=np.int64)
    kinds = np.array(sightings.kinds[seen], dtype=np.int64)
    return build_setup(
        layout=layout,
        landmarks=np.array(team.landmarks, dtype=np.float64).reshape(-1, 2),
        first=np.maximum(first - first[1], 0),
        observers=observers,
        targets=np.array(sightings.targets[seen], dtype=np.int64),
        kinds=kinds,
        variances=np.square(sigmas_by_kind(sensors, kinds, observers)),
        noise=team.noise,
        sample_time=sensors.sample_time,
        period=orbits.period,
        reach=2.0 * float(np.mean(orbits.radii)),
        options=options,
        samples=steps,
    )


def _chunk(
    readings: TrialReadings,
    lane_filter: "LaneFilter",
    options: FilterOptions,
    chunk: range,
    stopped: threading.Event,
) -> MonteCarloResult:
    """Return the result of a chunk of trials."""
    n, steps, found = readings.team.count, readings.setup.samples, []
    samples = steps if options.with_series else None
    for trials in lanes_side_by_side(chunk, n, stopped):
        counted = empty_statistics(len(trials), readings.layout.size, samples)
        streams = [readings.stream(trial) for trial in trials]
        lane_filter.run(FilterRun(readings.setup, *readings.drawn(trials), counted), streams)
        found.append(counted)
    return result_of(
        found,
        n,
        steps=steps,
        seed=options.seed,
        first_trial=chunk.start,
        judged_from=readings.setup.judged_from,
    )
