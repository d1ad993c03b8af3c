"""Validation: Monte Carlo runs of the filter on a plan, compared with the predicted error."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import NoSolutionError
from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.consistency import (
    Consistency,
    anees,
    coverage,
    nis,
)
from syncplan.estimation.divided_runs import RunOfTrials
from syncplan.estimation.filter_options import (
    FilterOptions,
    options_with,
    steps_in_run,
)
from syncplan.estimation.filter_setup import judged_from
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.trial_readings import possible_sightings
from syncplan.estimation.trials import (
    Accuracy,
    MonteCarloResult,
    TrialErrors,
    accuracy,
    check_whole,
    merge,
    pack,
    trial_errors,
    unpack,
)
from syncplan.options import lists_options
from syncplan.orbits.contacts import Windows, find_windows
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team
from syncplan.planning import judged_team
from syncplan.planning.error_checks import (
    ERROR_ABOVE_PREDICTION,
    compared_errors,
    error_in_trials,
)
from syncplan.planning.filter_choice import choose_filter
from syncplan.planning.judged_team import bound_is_affordable
from syncplan.planning.plan_files import PlanSubject, in_world, planned
from syncplan.planning.plans import Plan
from syncplan.results.result import Result
from syncplan.runtime.machine import single_threaded_blas

# --- the validation -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, repr=False)
class Validation(Result):
    """Result of a Monte Carlo run on a plan.

    Attributes
    ----------
    plan : the plan that was run
    duration : s
    options : filter, gate and other options of the run
    chosen_because : why this filter runs
    result : figures of each trial, and the series if asked for
    accuracy : RMS errors by vehicle
    predicted : (n,) m, the bound's RMS over the second half; None if not computed
    predicted_errors : the same for the filter's bias states; empty if there are none or the bound
        is not computed
    predicted_over_time : (steps + 1, e) bound of each bias state, in its unit; None if there are
        none, no series was asked for, or it is not computed
    expected : (n,) m, RMS expected instead if the filter leaves out errors that the scenario
        states, or the world differs from the scenario; None otherwise, or if not computed
    coverage : (n,) share of coordinates within three sigma
    anees, nis : consistency figures, with intervals from the spread over trials
    """

    plan: Plan
    duration: float
    options: FilterOptions
    chosen_because: str
    result: MonteCarloResult
    accuracy: Accuracy
    predicted: Array | None
    predicted_errors: tuple[judged_team.PredictedState, ...]
    predicted_over_time: Array | None
    expected: Array | None
    coverage: Array
    anees: Consistency
    nis: Consistency

    def __repr__(self) -> str:
        """Return one line: the plan, the trials and the error."""
        found = self.accuracy.overall()
        return (
            f"<{type(self).__name__} of {self.plan!r}: {self.result.trials} trials over "
            f"{self.duration:.4g} s, RMS {float(found.position):.3g} m>"
        )

    @property
    def trial_errors(self) -> TrialErrors:
        """Errors of each trial: the median, and shares of trials over a limit."""
        return trial_errors(self.result)

    @property
    def observable(self) -> bool:
        """Whether the plan is observable."""
        return self.plan.observable

    @property
    def findings(self) -> tuple[judged_team.PlanFinding, ...]:
        """Finding that errors are above their predictions; empty if they are not."""
        plan, anees = self.plan, self.anees
        names, late = plan.scenario.vehicle_names, self.accuracy.late_position.tolist()
        errors = compared_errors(
            list(zip(names, late, self.trial_errors.intervals(), strict=True)),
            (anees.value, None if np.isnan(anees.band[0]) else anees.band),
            names,
            self.predicted,
        )
        remarks = error_in_trials(
            plan,
            errors,
            f"{self.result.trials} trials of {self.duration:g} s",
            self.filter,
            flown_well=plan.verdict.go and plan.verdict.flown,
        )
        return tuple(
            judged_team.PlanFinding.of(ERROR_ABOVE_PREDICTION, remark) for remark in remarks
        )

    @property
    def verdict(self) -> judged_team.PlanVerdict:
        """The plan's verdict, with the findings of the validation."""
        verdict = self.plan.verdict
        return judged_team.PlanVerdict.of((*verdict.findings, *self.findings), self.plan.flight)

    @property
    def filter(self) -> str:
        """Name of the filter, see syncplan.scenario.filters.FILTERS."""
        return self.options.filter

    @property
    def model(self) -> str:
        """Integration of the filter's readings: arc or euler."""
        return self.options.filter_model.motion

    @property
    def judged_from(self) -> float:
        """Time in s from which ANEES, NIS and coverage count."""
        team, time = self.plan.team, self.plan.sensors.sample_time
        samples = judged_from(self.result.steps, time, team.orbits.period, self.options)
        return samples * time

    @property
    def substeps(self) -> int:
        """Euler sub-steps per sample, as asked for."""
        return self.options.substeps

    @property
    def gate_probability(self) -> float | None:
        """Probability of the innovation gate; None without a gate."""
        return self.options.gate_probability


@dataclass(frozen=True, slots=True)
class TrialRun(RunOfTrials):
    """Set-up of a validation, whose trials can run in parts.

    Attributes
    ----------
    plan : the plan that runs
    true_team, windows : team of the simulated world, and its contact windows
    duration, steps : s, and number of whole samples in it
    sightings : possible sightings at k = 1..steps
    options : as in validate, with the filter chosen
    chosen_because : why this filter runs
    """

    plan: Plan
    true_team: Team
    windows: Windows
    duration: float
    steps: int
    sightings: Sightings
    options: FilterOptions
    chosen_because: str

    pack = staticmethod(pack)
    unpack = staticmethod(unpack)

    @property
    def effort(self) -> float:
        """Number of samples and sightings of a trial."""
        return float(self.steps + len(self.sightings.observers))

    @single_threaded_blas
    def part(
        self,
        first_trial: int,
        trials: int,
        *,
        threads: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> MonteCarloResult:
        """Return `trials` trials from `first_trial` on, a multiple of CHUNK_TRIALS."""
        return run_trials(
            self.true_team,
            self.sightings,
            self.steps,
            replace(self.options, trials=trials),
            believed=self.plan.team,
            first_trial=first_trial,
            threads=threads,
            progress=progress,
        )

    @single_threaded_blas
    def concluded(self, parts: Sequence[MonteCarloResult]) -> Validation:
        """Return the validation from all parts, in order."""
        result = merge(parts)
        check_whole(result, self.trials)
        prediction, over_time = _prediction(self)
        return Validation(
            plan=self.plan,
            duration=self.duration,
            options=self.options,
            chosen_because=self.chosen_because,
            result=result,
            accuracy=accuracy(result),
            predicted=prediction.rms,
            predicted_errors=prediction.states,
            predicted_over_time=over_time,
            expected=_expected(self, prediction),
            coverage=coverage(result.covered.mean(axis=0), result.coverage_samples),
            anees=anees(result.nees, 3 * self.plan.orbits.count),
            nis=nis(result.nis_sums, result.accepted, self.options.gate_probability),
        )


@lists_options(FilterOptions)
def validate(
    subject: PlanSubject,
    options: FilterOptions | None = None,
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
    **changes: Any,
) -> Validation:
    """Return the errors of the filter over many trials on the plan of `subject`.

    `options`, or changes of it by name, set the filter and the trials: trials=200, seed=0,
    duration=None (s, the scenario's), filter="auto" (that of the plan's flights or, on paper, by
    the start-up index; or any name in the table of filters, `paper` with `substeps`=10 per sample),
    gate_probability=None, with_series=False, truth=None (keys of the simulated world in addition to
    the scenario's truth). The same seed gives the same bytes on any number of threads. `progress`
    is called with the number of trials done. Raises InputError naming the argument at fault.
    """
    validation: Validation = trial_run(subject, options, **changes).whole(
        threads=threads, progress=progress
    )
    return validation


def trial_run(
    subject: PlanSubject,
    options: FilterOptions | None = None,
    **changes: Any,
) -> TrialRun:
    """Return the set-up of a validation."""
    chosen = options_with(options, changes)
    plan = planned(subject)
    choice, flown = choose_filter(plan, chosen), in_world(plan, chosen.truth)
    length = flown.scenario.duration_s if chosen.duration is None else chosen.duration
    sample_time, period = flown.sensors.sample_time, flown.orbits.period
    steps = steps_in_run(length, sample_time, period, flown.team.count)
    true = flown.true_team
    windows = flown.windows if true is flown.team else find_windows(true)
    sightings = possible_sightings(true, windows, steps)
    return TrialRun(
        flown, true, windows, length, steps, sightings, choice.applied(chosen), choice.reason
    )


def _expected(run: TrialRun, prediction: judged_team.Prediction) -> Array | None:
    """Expected errors of the filter in the world, if they differ from the prediction."""
    team, neglect = run.plan.team, prediction.neglect
    if run.true_team is team or prediction.rms is None:
        return None if neglect is None else neglect.expected
    return judged_team.expected_in_world(team, run.true_team, run.windows, run.duration)


def _prediction(run: TrialRun) -> tuple[judged_team.Prediction, Array | None]:
    """The plan's own prediction, or one for another duration; bound of bias states over time."""
    flown, duration, team = run.plan, run.duration, run.plan.team
    known = flown.prediction
    lasts = duration == flown.scenario.duration_s and known.rms is not None
    if lasts and not (known.states and run.options.with_series):
        return known, None
    nothing = replace(known, rms=None, states=(), neglect=None)
    if not (lasts or bound_is_affordable(team, duration)):
        return nothing, None
    try:
        bound = posterior_bound(team, flown.windows, duration)
    except NoSolutionError:
        return nothing, None
    of_errors = bound.errors if run.options.with_series else None
    over_time = None if of_errors is None else np.sqrt(of_errors)
    if lasts:
        return known, over_time
    prediction = replace(
        known,
        rms=bound.rms_second_half(),
        states=judged_team.predicted_states(team, bound, flown.scenario.vehicle_names),
        neglect=judged_team.neglect_of(team, flown.windows, duration),
    )
    return prediction, over_time
