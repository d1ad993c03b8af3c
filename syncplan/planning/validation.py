"""Validation: the filter run many times on a plan, beside what the bound predicts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.consistency import Consistency, anees, coverage, nis
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.trials import Accuracy, MonteCarloResult, accuracy, merge
from syncplan.orbits.sightings import Sightings, sample_sightings, steps_within
from syncplan.planning.planner import Plan, bound_is_affordable, plan
from syncplan.runtime.blas import single_threaded_blas
from syncplan.scenario.rules import excess
from syncplan.scenario.specification import Scenario

__all__ = [
    "MAX_TRIALS",
    "TrialRun",
    "Validation",
    "check_duration",
    "check_run",
    "conclude",
    "run_part",
    "trial_run",
    "validate",
]


MAX_TRIALS = 1_000_000

_LARGEST_SEED = 2**63 - 1


@dataclass(frozen=True, slots=True)
class Validation:
    """A Monte Carlo run on a plan.

    Attributes
    ----------
    plan : what was flown
    duration : s
    model, substeps, gate_probability : the filter
    result : per trial figures, and the series where asked for
    accuracy : RMS errors by vehicle
    predicted : (n,) m, the bound's RMS over the second half; None where not computed
    coverage : (n,) share of coordinates within three sigma
    anees, nis : consistency figures
    """

    plan: Plan
    duration: float
    model: Literal["arc", "euler"]
    substeps: int
    gate_probability: float | None
    result: MonteCarloResult
    accuracy: Accuracy
    predicted: Array | None
    coverage: Array
    anees: Consistency
    nis: Consistency


@dataclass(frozen=True, slots=True)
class TrialRun:
    """A validation as it is set up, before a trial has run; parts of it may run apart.

    Attributes
    ----------
    plan : what is flown
    duration, steps : s, and whole samples in it
    sightings : who sees whom at k = 1..steps
    trials, seed, model, substeps, gate_probability, with_series : as validate takes them
    """

    plan: Plan
    duration: float
    steps: int
    sightings: Sightings
    trials: int
    seed: int
    model: Literal["arc", "euler"]
    substeps: int
    gate_probability: float | None
    with_series: bool


def validate(
    subject: Plan | Scenario,
    *,
    trials: int = 200,
    seed: int = 0,
    duration: float | None = None,
    model: Literal["arc", "euler"] = "arc",
    substeps: int = 10,
    gate_probability: float | None = None,
    with_series: bool = False,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Validation:
    """Return what `trials` runs of the filter on a plan (or a scenario's plan) come to.

    `duration` in s defaults to the scenario's. The same seed gives the same bytes on any number
    of threads. `progress` is called with the number of trials done. Raises InputError naming the
    argument at fault.
    """
    run = trial_run(
        subject,
        trials=trials,
        seed=seed,
        duration=duration,
        model=model,
        substeps=substeps,
        gate_probability=gate_probability,
        with_series=with_series,
    )
    return conclude(run, [run_part(run, 0, trials, threads=threads, progress=progress)])


def trial_run(
    subject: Plan | Scenario,
    *,
    trials: int = 200,
    seed: int = 0,
    duration: float | None = None,
    model: Literal["arc", "euler"] = "arc",
    substeps: int = 10,
    gate_probability: float | None = None,
    with_series: bool = False,
) -> TrialRun:
    """Return a validation set up, its parts to be run by run_part and joined by conclude."""
    check_run(trials, seed)
    flown = subject if isinstance(subject, Plan) else plan(subject)
    length = flown.scenario.duration_s if duration is None else duration
    sample_time = flown.sensors.sample_time
    steps = check_duration(length, sample_time, flown.orbits.period, flown.orbits.count)
    sightings = sample_sightings(
        flown.windows, flown.orbits.period, flown.sensors.sample_time, 1, steps
    )
    return TrialRun(
        plan=flown,
        duration=length,
        steps=steps,
        sightings=sightings,
        trials=trials,
        seed=seed,
        model=model,
        substeps=substeps,
        gate_probability=gate_probability,
        with_series=with_series,
    )


@single_threaded_blas
def run_part(
    run: TrialRun,
    first_trial: int,
    trials: int,
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> MonteCarloResult:
    """Return the trials from `first_trial` on, a multiple of CHUNK_TRIALS, of a validation."""
    flown = run.plan
    return run_trials(
        flown.orbits,
        flown.landmarks,
        flown.sensors,
        flown.noise,
        run.sightings,
        run.steps,
        trials,
        run.seed,
        first_trial=first_trial,
        model=run.model,
        substeps=run.substeps,
        gate_probability=run.gate_probability,
        with_series=run.with_series,
        threads=threads,
        progress=progress,
    )


@single_threaded_blas
def conclude(run: TrialRun, parts: Sequence[MonteCarloResult]) -> Validation:
    """Return the validation that all parts of a run, in order, come to.

    However the run was cut, the bytes are the same. Raises InputError where parts are missing, and
    NoSolutionError where the filter diverged.
    """
    result = merge(parts)
    if (result.first_trial, result.trials) != (0, run.trials):
        problem = f"{result.trials} from {result.first_trial} on given, of {run.trials}"
        raise InputError(problem, key="parts")
    flown = run.plan
    lost = int(np.sum(~np.isfinite(result.mean_squares).all(axis=(1, 2))))
    if lost:
        raise NoSolutionError(
            f"the filter diverged in {lost} of {run.trials} trials: its errors are no longer "
            "finite; smaller sigmas or a shorter sample time may help"
        )
    return Validation(
        plan=flown,
        duration=run.duration,
        model=run.model,
        substeps=run.substeps,
        gate_probability=run.gate_probability,
        result=result,
        accuracy=accuracy(result),
        predicted=_predicted(flown, run.duration),
        coverage=coverage(result.covered.mean(axis=0), result.coverage_samples),
        anees=anees(result.nees, 3 * flown.orbits.count),
        nis=nis(float(result.nis_sums.sum()), int(result.accepted.sum()), run.gate_probability),
    )


def _predicted(flown: Plan, duration: float) -> Array | None:
    if duration == flown.scenario.duration_s and flown.prediction.rms is not None:
        return flown.prediction.rms
    if not bound_is_affordable(flown.orbits.count, duration, flown.sensors.sample_time):
        return None
    try:
        return posterior_bound(
            flown.orbits, flown.landmarks, flown.sensors, flown.windows, flown.noise, duration
        ).rms_second_half()
    except NoSolutionError:
        return None


def check_run(trials: int, seed: int) -> None:
    """Raise InputError unless the number of trials and the seed can be used."""
    if not 1 <= trials <= MAX_TRIALS:
        raise InputError(f"{trials} given; allowed are 1 to {MAX_TRIALS}", key="trials")
    if not 0 <= seed <= _LARGEST_SEED:
        raise InputError(f"{seed} given; allowed are 0 to {_LARGEST_SEED}", key="seed")


def check_duration(duration: float, sample_time: float, period: float, count: int) -> int:
    """Return the whole samples in a run of `duration` s, within the same limits as a scenario's.

    Raises InputError where there are none or too many.
    """
    if not (np.isfinite(duration) and duration >= sample_time):
        raise InputError(
            f"{duration:g} s given; at least one sample time, {sample_time:g} s, is needed",
            key="duration",
        )
    problem = excess(duration, sample_time, period, count)
    if problem:
        raise InputError(problem, key="duration")
    return steps_within(duration, sample_time)
