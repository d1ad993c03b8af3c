"""Replay: the filter on a recording of real robots, with its errors if truth is recorded.

`recorded_readings` puts readings on one clock, `recorded_run` runs the filter on them, and
`replay_settings` holds its assumptions.

The filter also runs one step at a time, as it would have run on the robots: the same steps with the
same kernels, so its figures are the same to rounding.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.estimation.consistency import coverage, recorded_anees, recorded_nis
from syncplan.estimation.filter_options import FilterOptions, options_with
from syncplan.estimation.online_filter import Arrived, OnlineFilter
from syncplan.estimation.recorded_observability import seen_over_time
from syncplan.estimation.recorded_run import (
    FilteredRun,
    RecordedRun,
    Seen,
    filtered,
    lasting_of,
    run_of,
)
from syncplan.estimation.replay_results import ErrorsFromTruth, FittedError, KindCounts, Replay
from syncplan.estimation.replay_settings import (
    GROUND_ROBOTS,
    STARTS,
    ReplayOptions,
    ReplaySettings,
)
from syncplan.estimation.replay_tuning import Tuning, tuned
from syncplan.estimation.trials import MonteCarloResult, accuracy
from syncplan.options import lists_options, options_of
from syncplan.orbits.error_states import ERROR_STATES
from syncplan.orbits.noise import Noise
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS
from syncplan.recordings.log import Log
from syncplan.scenario.filters import FOR_RECORDINGS

OPTIONS = ReplayOptions().filter_options
"""Default options of the filter on a recording."""


@lists_options(ReplaySettings, FilterOptions)
def replay(
    log: Log,
    options: FilterOptions | None = None,
    *,
    noise: Noise | None = None,
    tune: bool = False,
    progress: Seen | None = None,
    **asked: Any,
) -> Replay:
    """Return the filter's estimates from a recording's odometry and sightings, and their errors.

    The fields of ReplaySettings, except `portion`, are arguments by their names. `landmarks` are
    the names of those whose sightings count (numbers, where the recording numbers them), all if
    None; `meetings` states whether sightings between robots count, `distances` whether recorded
    distances do. `bearing_sigma` and `range_sigma` are in rad and m, `sample_time` in s; the sigmas
    of `noise`, a syncplan.orbits.noise.Noise, are per sample, and GROUND_ROBOTS if None. Each
    robot's speed scale, turn-rate bias (rad/s), bearing bias (rad) and bearing walk (rad), an error
    whose correlation falls to 1/e over `bearing_walk_time` s, is estimated if its sigma is more
    than 0. Sightings are assumed to be made `delay` s before they are recorded.

    `start` is "truth"; "prior", drawn about the truth by the start's sigmas and the `seed`; or
    "given", at `start_poses` (n, 3) m, m, rad. Recordings without truth, whose errors are unknown,
    need the last. `options`, or changes of it by name, choose the filter. A sighting counts if it
    is within the gate of `gate_probability`, 0.999 if not given; 1 accepts all. `with_series` keeps
    errors and sigmas over time. The sightings of each `window` s are judged by rank and
    certificate, none if it is 0. `tune` fits sigmas and delay to the first third, beginning with
    those given, and runs on the rest, with those given if the fit is no better there. A recording
    is one trial: `trials` and `duration` have no effect. `progress` is called with the number of
    sightings so far. Raises InputError naming the argument or the robot at fault, and
    NoSolutionError if the filter diverges.
    """
    if noise is None:
        start = asked.get("start", "truth")
        position_sigma, heading_sigma = STARTS.get(start, STARTS["truth"]).sigmas
        noise = replace(GROUND_ROBOTS, position_sigma=position_sigma, heading_sigma=heading_sigma)
    given = {
        one.name: asked.pop(one.name) for one in options_of(ReplaySettings) if one.name in asked
    }
    if given.get("landmarks") is not None:
        given["landmarks"] = tuple(given["landmarks"])
    settings = ReplaySettings(**given, noise=noise)
    chosen = replay_options(options, asked)
    tuning = tuned(log, settings, chosen) if tune else None
    return replay_with(log, settings, chosen, tuning, progress)


def replay_with(
    log: Log,
    settings: ReplaySettings,
    options: FilterOptions,
    tuning: Tuning | None = None,
    progress: Seen | None = None,
) -> Replay:
    """Return the replay with settings, or with those that tuning chose; see `replay`."""
    settings = settings if tuning is None else tuning.used
    run = run_of(log, settings, options)
    # without truth, only estimates can be reported
    kept = replace(options, with_series=options.with_series or not run.has_truth)
    found = filtered(run, kept, progress)
    names, result, gate = list(SIGHTING_KINDS), found.result, options.gate_probability
    counts = {}
    for place, left_out in run.sightings.left_out.items():
        squares = (found.innovations**2 * found.weights)[run.sightings.kinds == place]
        used = int(np.sum(found.weights[run.sightings.kinds == place] > 0.0))
        counts[names[place]] = KindCounts(
            used=used,
            rejected=len(squares) - used,
            left_out=left_out,
            nis=recorded_nis(float(squares.sum()), used, gate),
            lasting=lasting_of(run, found, place),
        )
    return Replay(
        log=log,
        landmarks=tuple(log.landmark_names[place] for place in run.landmarks.tolist()),
        settings=settings,
        options=options,
        clock=run.clock,
        known=run.known,
        result=result,
        estimates=found.estimates,
        from_truth=_errors_of(result, len(log.robots)) if run.has_truth else None,
        nis=recorded_nis(float(result.nis_sums[0]), int(result.accepted[0]), gate),
        counts=counts,
        lasting_errors=_lasting_errors(log, run, found),
        seen=seen_over_time(run, found, settings.window) if settings.window else None,
        tuning=tuning,
    )


def _errors_of(result: MonteCarloResult, count: int) -> ErrorsFromTruth:
    return ErrorsFromTruth(
        accuracy=accuracy(result),
        coverage=coverage(result.covered[0], result.coverage_samples),
        anees=recorded_anees(float(result.nees[0]), 3 * count),
    )


def _lasting_errors(log: Log, run: RecordedRun, found: FilteredRun) -> tuple[FittedError, ...]:
    return tuple(
        FittedError(
            name=name,
            robot=robot.name,
            unit=ERROR_STATES[name].unit,
            value=float(found.errors[column - 3 * run.layout.count]),
            sigma=float(found.error_sigmas[column - 3 * run.layout.count]),
        )
        for name, columns in run.layout.columns.items()
        for robot, column in zip(log.robots, columns[:, 0].tolist(), strict=True)
    )


def replay_options(options: FilterOptions | None, changes: Mapping[str, Any]) -> FilterOptions:
    """Return the options of a replay with changes; a gate probability of 1 means no gate.

    Raises InputError naming the option at fault, such as a filter that only a simulation can run.
    """
    gate = changes.get("gate_probability")
    if gate is not None and not 0.0 < gate <= 1.0:
        problem = f"{gate:g} given; allowed is more than 0, up to 1, which accepts all"
        raise InputError(problem, key="gate_probability")
    if gate == 1.0:
        changes = {**changes, "gate_probability": None}
    chosen = options_with(options or OPTIONS, changes)
    if chosen.filter_model.needs_truth:
        others = " or ".join(FOR_RECORDINGS)
        problem = f"{chosen.filter!r} needs the truth, which only trials have; choose {others}"
        raise InputError(problem, key="filter")
    return chosen


# --- step by step ---------------------------------------------------------------------------------


class RecordedStep(NamedTuple):
    """Readings of a team in a step of a recording.

    Fields
    ------
    speeds, turn_rates : (n,) m/s, rad/s
    arrived : sightings at its end
    span : s
    sample : number of the clock's sample that it ends at; -1 for none
    """

    speeds: Array
    turn_rates: Array
    arrived: Arrived
    span: float
    sample: int


def online_filter_of(run: RecordedRun, options: FilterOptions) -> OnlineFilter:
    """Return a step-by-step filter at the start of a replay's run."""
    stream = np.random.SeedSequence(options.seed)
    return OnlineFilter(run.setup, run.readings.initial[..., 0], options.filter_model, stream)


def steps_of(run: RecordedRun) -> Iterator[RecordedStep]:
    """Yield the steps of a replay's run, in order of time."""
    setup, readings = run.setup, run.readings
    for k in range(len(setup.spans)):
        rows = slice(setup.first[k + 1], setup.first[k + 2])
        yield RecordedStep(
            readings.speeds[k, :, 0],
            readings.turn_rates[k, :, 0],
            Arrived(
                setup.observers[rows],
                setup.targets[rows],
                setup.kinds[rows],
                setup.variances[rows],
                readings.sightings[rows, 0],
            ),
            float(setup.spans[k]),
            int(setup.compared[k + 1]),
        )
