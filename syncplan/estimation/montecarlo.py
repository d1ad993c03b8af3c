"""Monte Carlo: many trials of the filter along one plan, the same bytes on any number of threads.

Each trial draws from a generator of its own: `trial_readings`. Trials are filtered in chunks of
CHUNK_TRIALS, cut at fixed trial numbers, so neither threads nor division into parts changes a byte;
see syncplan.estimation.trials.
"""

import threading
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from syncplan.errors import InputError
from syncplan.estimation.augmented_setup import (
    AugmentedSetup,
    augmented_setup_of,
    empty_augmented_statistics,
)
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filter_setup import FilterSetup, build_setup
from syncplan.estimation.filter_statistics import empty_series
from syncplan.estimation.trial_chunks import StoppedError, chunks_in_order
from syncplan.estimation.trial_readings import TrialReadings, needs_augmented
from syncplan.estimation.trials import (
    CHUNK_TRIALS,
    Branch,
    MonteCarloResult,
    joined,
    merge,
    result_of,
)
from syncplan.orbits.circles import heading, position
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS, sigmas_by_kind
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team
from syncplan.runtime.machine import threads_for

if TYPE_CHECKING:
    from syncplan.estimation.lane_filter import LaneFilter


@dataclass(frozen=True, slots=True)
class _Run:
    """All that the trials of a run share."""

    readings: TrialReadings
    augmented: AugmentedSetup | None
    options: FilterOptions
    end: int

    @property
    def lane_filter(self) -> "LaneFilter":
        """The compiled filter: that of poses alone where it will do."""
        model = self.options.filter_model
        return model.lane_filter if self.augmented is None else model.augmented_lane_filter


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

    `sightings` holds who sees whom at k = 1..steps, or in moving air who might: those of
    `trial_readings.possible_sightings`. The filter takes the sigmas of `believed` for
    true, those of the team if None; what it reads has the team's. `first_trial`, a multiple of
    CHUNK_TRIALS, makes this a part of a longer run, which `merge` joins. `progress` is called with
    the number of trials done. Raises InputError naming the argument at fault.
    """
    side_by_side = threads_for(threads)
    _check_run(steps, first_trial)
    known = team if believed is None else believed
    _check_sigmas(team)
    _check_sigmas(known)
    _check_sightings(sightings, team.count, len(team.landmarks))
    assumed = replace(team, sensors=known.sensors, noise=known.noise, errors=known.errors)
    setup, layout = _setup(assumed, sightings, steps, options), layout_of(assumed)
    wide = options.filter_model.needs_truth or needs_augmented(team) or len(layout.sigmas) > 0
    run = _Run(
        readings=TrialReadings.of(team, setup, layout, options.seed),
        augmented=augmented_setup_of(setup, layout) if wide else None,
        options=options,
        end=first_trial + options.trials,
    )
    run.lane_filter.compile(team.count)
    parts: list[MonteCarloResult] = []
    branches: tuple[Branch, ...] = ()
    computed = chunks_in_order(
        lambda chunk, stop: _chunk(run, chunk, stop),
        first_trial,
        run.end,
        side_by_side,
    )
    with closing(computed) as chunks:
        for part in chunks:
            parts.append(replace(part, branches=()))
            branches = joined([*branches, *part.branches])
            if progress is not None:
                progress(part.first_trial + part.trials - first_trial)
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
        period=orbits.period,
        reach=2.0 * float(np.mean(orbits.radii)),
        options=options,
    )


def _chunk(run: _Run, chunk: range, stopped: threading.Event) -> MonteCarloResult:
    """The result of the trials of a chunk."""
    readings, lane_filter = run.readings, run.lane_filter
    n, steps = readings.team.count, len(readings.setup.truth) - 1
    lanes = lane_filter.lanes_for(n)
    wanted = run.options.with_series
    e = len(readings.layout.sigmas)
    sums = empty_series(n, steps, wanted=wanted), np.zeros((steps + 1 if wanted else 0, e, 3))
    found = []
    for first in range(chunk.start, chunk.stop, lanes):
        if stopped.is_set():
            raise StoppedError
        trials = range(first, min(first + lanes, chunk.stop))
        counted = empty_augmented_statistics(n, e, len(trials), sums)
        streams = [readings.stream(trial) for trial in trials]
        found.append(counted)
        if run.augmented is not None:
            lane_filter.run(run.augmented, readings.disturbed(trials), counted, streams)
        else:
            lane_filter.run(readings.setup, readings.of_poses(trials), counted.poses, streams)
    return result_of(
        [one.poses for one in found],
        [one.errors for one in found],
        steps=steps,
        seed=run.options.seed,
        first_trial=chunk.start,
        judged_from=readings.setup.judged_from,
    )
