"""Validations and sweeps as documents, with notes on the meaning of their figures."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, Field

from syncplan import __version__
from syncplan.arrays import Flags
from syncplan.documents import Document, DocumentPart, OrAbsent
from syncplan.errors import InputError
from syncplan.estimation.considered_errors import neglected_errors
from syncplan.estimation.trials import state_series
from syncplan.orbits.error_states import layout_of
from syncplan.phrases import in_words, percent
from syncplan.planning.judged_team import PlanVerdict
from syncplan.planning.plan_records import Interval
from syncplan.planning.share_test import share_of
from syncplan.planning.validation import Validation
from syncplan.planning.variations import StressTest, Sweep, ValidatedRow
from syncplan.reports import run_figures
from syncplan.results.quantities import each, plain, quantity
from syncplan.results.stories import Grid, Report, Row, Story, Table, flat
from syncplan.scenario.dotted_keys import swept_key


class StressedWorld(DocumentPart):
    """A world that is worse in one way than the scenario states."""

    world: str = quantity("world", examples=["wind.gust_sigma_mps doubled"])
    truth: list[run_figures.TrueKey] = Field(
        description="Keys of which it differs from the scenario"
    )
    rms_second_half_m: float = quantity("2nd half", "Over all vehicles", "m")
    harm: float = quantity("harm", "That over the one of the world as stated", form=".2f")
    expected_rms_m: float | None = quantity(
        "expected", "Expected error, by a linear recursion; null where not computed", "m", drop=1
    )
    anees: run_figures.Spread = quantity("ANEES", words=run_figures.anees_cells, drop=2)


class ValidationDocument(run_figures.TrueWorldReport):
    """A Monte Carlo run of the filter on a plan."""

    drawn_as: ClassVar[str] = "run"

    verdict: PlanVerdict | None = Field(
        default=None,
        description="Of the plan, with the findings of this run; null in older files",
    )
    trials: int
    seed: int
    duration_s: float
    filter: run_figures.FilterRecord
    observable: bool
    vehicles: list[run_figures.VehicleFigures]
    overall: run_figures.ErrorFigures
    errors: OrAbsent[list[run_figures.StateErrorFigures]] = Field(
        default=None,
        description="Of states of the filter that are no poses; absent where there are none",
    )
    anees: run_figures.Spread = quantity(
        "ANEES", "Of the poses alone", words=run_figures.anees_cells, order=5
    )
    nis: run_figures.Spread
    stress: OrAbsent[list[StressedWorld]] = Field(
        default=None,
        description="Worlds that are worse than the scenario states, the most harmful first; "
        "absent unless asked for",
    )
    series: OrAbsent[run_figures.Series] = None
    notes: list[str]

    @property
    def run(self) -> str:
        """Number and length of the trials, and seed, in words."""
        return f"{self.trials} trials of {self.duration_s:g} s, seed {self.seed}"

    def body(self) -> Story:
        """Yield errors and consistency."""
        overall = self.overall
        yield f"[bold]{plain(self.name or 'plan')}[/]: {self.run}, {self.filter.words}"
        title = "RMS error in m over the run and over its second half, and its median trial"
        without = ("rms_second_half_interval_m",)
        yield Table(title, self.vehicles, foot=overall, stated="m", without=without)
        ratio, interval = overall.rms_over_predicted, overall.rms_over_predicted_interval
        yield from overall.overall_line(ratio, interval)
        yield from self._states
        if self.stress:
            title = "RMS error in m over the second half in worse worlds"
            yield Table(title, self.stress, stated="m")
        far, lost = overall.share_over_3_predicted, overall.share_over_10_predicted
        if far is not None and lost is not None:
            yield (
                "trials with a vehicle off by over 3 times the bound "
                f"{percent(far, overall.share_over_3_predicted_interval)}, over 10 times "
                f"{percent(lost, overall.share_over_10_predicted_interval)}"
            )
        trusted = self.observable and (self.verdict is None or self.verdict.go)
        yield f"ANEES {self.anees.words(trusted=trusted)}"
        yield f"NIS   {self.nis.words(trusted=trusted)}"

    def frame_rows(self) -> Iterator[Row]:
        """Yield the vehicles as rows of a data frame."""
        return (flat(vehicle.model_dump()) for vehicle in self.vehicles)


class SweepRow(Document):
    """One value of a sweep: the verdict on its plan, and its validation."""

    label: str = quantity("value", examples=["0.4"], order=-5)
    value: float = Field(description="Value of the swept key", examples=[0.4])
    range_m: list[float] = Field(description="Range of each vehicle's sensor")
    rank: int = quantity(
        "rank",
        words=each(lambda row: "full" if row.rank == row.state_dim else "short"),
        drop=1,
        order=6,
    )
    state_dim: int
    connectivity_period_s: float | None
    mean_rms_x_m: float = quantity("p_e", unit="m", form=".2f", drop=3, order=-3)
    mean_rms_y_m: float = quantity("p_n", unit="m", form=".2f", drop=2, order=-4)
    validation: ValidationDocument


def _only_numeric_keys(schema: dict[str, Any]) -> None:
    from syncplan.scenario.dotted_keys import numeric_keys

    schema["enum"] = list(numeric_keys())


def _known(key: str) -> str:
    try:
        return swept_key(key).key
    except InputError as error:
        raise ValueError(error.problem) from None


SweptName = Annotated[str, AfterValidator(_known), Field(json_schema_extra=_only_numeric_keys)]


_OF_VEHICLES = [
    f"validation.overall.{name}"
    for name in (
        *("rms_x_m", "rms_y_m", "rms_m", "median_rms_second_half_m", "rms_over_predicted"),
        "coverage_3sigma",
    )
]
"""Figures that the table of a sweep leaves out."""


class SweepReport(Document, Report):
    """A sweep: a row for each value."""

    drawn_as: ClassVar[str] = "sweep"

    swept: SweptName
    rows: list[SweepRow] = Field(min_length=1)

    @property
    def name(self) -> str:
        """Name of the scenario that was varied."""
        return self.rows[0].validation.name

    def body(self) -> Story:
        """Yield errors in x (p_e) and y (p_n) of each vehicle, then means over vehicles."""
        heading = swept_key(self.swept).heading
        vehicles: dict[str, list[str]] = {}
        for k, row in enumerate(self.rows):
            for vehicle in row.validation.vehicles:
                cells = vehicles.setdefault(vehicle.name, ["-"] * len(self.rows))
                cells[k] = f"{vehicle.rms_y_m:.2f}/{vehicle.rms_x_m:.2f}"
        yield Grid(
            f"RMS error over the run, p_n/p_e in m, by {heading}",
            ("vehicle", *(row.label.partition(",")[0] for row in self.rows)),
            [(plain(name), *cells) for name, cells in vehicles.items()],
        )
        title = "means over the vehicles, m"
        yield Table(title, self.rows, first=heading, stated="m", without=_OF_VEHICLES)

    def frame_rows(self) -> Iterator[Row]:
        """Yield the values as rows of a data frame."""
        for row in self.rows:
            overall = flat(row.validation.overall.model_dump())
            yield {**flat(row.model_dump(exclude={"validation"})), **overall}


_FACTORS = (3, 10)
"""Multiples of the bound above which trials are counted."""


def validation_document(validation: Validation) -> ValidationDocument:
    """Return the report of a Monte Carlo run."""
    plan = validation.plan
    result, overall = validation.result, _overall(validation)
    anees = run_figures.spread_of(validation.anees)
    truth = run_figures.keys_in_truth(plan)
    expected = run_figures.expected_in_truth(plan, validation.expected)
    differs = run_figures.truth_note(
        truth, expected, overall.rms_second_half_m, overall.predicted_rms_m
    )
    return ValidationDocument(
        version=__version__,
        name=plan.scenario.name,
        truth=truth,
        expected_rms_m=expected,
        verdict=validation.verdict,
        trials=result.trials,
        seed=result.seed,
        duration_s=validation.duration,
        filter=run_figures.filter_record(
            validation.options, validation.chosen_because, validation.judged_from, result
        ),
        observable=plan.observable,
        vehicles=_vehicles(validation),
        overall=overall,
        errors=state_errors_of(validation),
        anees=anees,
        nis=run_figures.spread_of(validation.nis),
        series=_series(validation) if result.branches else None,
        notes=[*filter(None, [differs]), *notes_on(validation, overall, anees)],
    )


def stress_document(test: StressTest) -> ValidationDocument:
    """Return the report of a stress test: the world as stated, and the errors in worse ones."""
    report = validation_document(test.nominal)
    findings = (*test.nominal.verdict.findings, *test.findings)
    verdict = PlanVerdict.of(findings, test.nominal.plan.flight)
    worlds = [
        StressedWorld(
            world=row.world,
            truth=run_figures.keys_in_truth(row.validation.plan) or [],
            rms_second_half_m=float(row.validation.accuracy.overall().late_position),
            harm=row.harm,
            expected_rms_m=row.expected,
            anees=run_figures.spread_of(row.validation.anees),
        )
        for row in test.rows
    ]
    return report.model_copy(update={"verdict": verdict, "stress": worlds})


def sweep_document(swept: Sweep) -> SweepReport:
    """Return the report of a sweep: label, verdict and validation for each value."""
    return SweepReport.model_validate(
        {"swept": swept_key(swept.name).key, "rows": [_row(row) for row in swept]}
    )


def _row(row: ValidatedRow) -> SweepRow:
    plan, report = row.validation.plan, validation_document(row.validation)
    return SweepRow(
        label=row.label,
        value=row.value,
        range_m=[float(value) for value in plan.sensors.ranges],
        rank=plan.observability.rank,
        state_dim=plan.observability.state_dim,
        connectivity_period_s=plan.connectivity_period,
        mean_rms_x_m=float(np.mean([v.rms_x_m for v in report.vehicles])),
        mean_rms_y_m=float(np.mean([v.rms_y_m for v in report.vehicles])),
        validation=report,
    )


def _vehicles(validation: Validation) -> list[run_figures.VehicleFigures]:
    predicted, errors = validation.predicted, validation.trial_errors
    medians, intervals = errors.median(), errors.intervals()
    shares = _over_predictions(validation)
    return [
        run_figures.VehicleFigures(
            name=name,
            **_figures(
                run_figures.errors_of(validation.accuracy, k, float(validation.coverage[k])),
                intervals[k],
                None if predicted is None else float(predicted[k]),
                {factor: over[:, k] for factor, over in shares.items()},
            ),
            median_rms_second_half_m=float(medians[k]),
        )
        for k, name in enumerate(validation.plan.scenario.vehicle_names)
    ]


def _overall(validation: Validation) -> run_figures.ErrorFigures:
    predicted, errors = validation.predicted, validation.trial_errors
    covered = float(np.mean(validation.coverage))
    return run_figures.ErrorFigures(
        **_figures(
            run_figures.errors_of(validation.accuracy.overall(), (), covered),
            errors.overall_interval(),
            None if predicted is None else float(np.sqrt(np.mean(predicted**2))),
            {k: np.asarray(over.any(axis=1)) for k, over in _over_predictions(validation).items()},
        ),
        median_rms_second_half_m=errors.overall_median(),
    )


def _over_predictions(validation: Validation) -> dict[int, Flags]:
    """(trials, n) whether errors are over multiples of their predictions, by the multiple."""
    predicted, errors = validation.predicted, validation.trial_errors
    return {} if predicted is None else {k: errors.over(k * predicted) for k in _FACTORS}


def _figures(
    errors: dict[str, float],
    interval: Interval | None,
    predicted: float | None,
    over: Mapping[int, Flags],
) -> dict[str, Any]:
    """Errors with the interval of their RMS, ratio to the prediction and shares of trials over."""
    shares: dict[str, Any] = {}
    for factor, trials in over.items():
        name = f"share_over_{factor}_predicted"
        shares[name], shares[f"{name}_interval"] = share_of(trials)
    rms = errors["rms_second_half_m"]
    return {
        **errors,
        "rms_second_half_interval_m": interval,
        "predicted_rms_m": predicted,
        **run_figures.ratio_of("rms_over_predicted", rms, interval, predicted),
        **shares,
    }


def _series(validation: Validation) -> run_figures.Series:
    plan = validation.plan
    names, sample_time = plan.scenario.vehicle_names, plan.sensors.sample_time
    poses = run_figures.series_of(validation.result, names, sample_time)
    return poses.model_copy(update={"errors": series_of_states(validation)})


def state_errors_of(validation: Validation) -> list[run_figures.StateErrorFigures] | None:
    """Return the errors of each further state; None if all states are poses."""
    names = _names(validation)
    if not names:
        return None
    predicted: list[float | None] = [one.rms for one in validation.predicted_errors]
    predicted = predicted or [None] * len(names)
    return [
        run_figures.StateErrorFigures(**one, predicted_rms=bound)
        for one, bound in zip(
            run_figures.state_errors(validation.result, names, predicted), predicted, strict=True
        )
    ]


def series_of_states(validation: Validation) -> list[run_figures.StateErrorSeries] | None:
    """Return errors of further states over time; None if all states are poses.

    Raises InputError for a run that kept no series.
    """
    names = _names(validation)
    if not names:
        return None
    kept, predicted = state_series(validation.result), validation.predicted_over_time
    return [
        run_figures.StateErrorSeries(
            state=label,
            unit=unit,
            rms=kept.rms[:, k].tolist(),
            mean=kept.mean_errors[:, k].tolist(),
            sigma=kept.sigma[:, k].tolist(),
            predicted=None if predicted is None else predicted[:, k].tolist(),
        )
        for k, (label, unit) in enumerate(names)
    ]


def _names(validation: Validation) -> list[tuple[str, str]]:
    """Label and unit of each further state."""
    plan = validation.plan
    layout = layout_of(plan.team)
    return list(zip(layout.labels(plan.scenario.vehicle_names), layout.units, strict=True))


FEW_SHAPE_THE_RMS = 1.5
"""Ratio of the RMS to the median trial's error above which a few trials dominate the RMS."""

_STILL_AIR = (
    "the bound of the wind is that of circles flown in still air; in wind an error of a heading "
    "looks like more of it, so the wind is known less well"
)


def notes_on(
    validation: Validation, report: run_figures.ErrorFigures, figure: run_figures.Spread
) -> list[str]:
    """Return notes on the meaning of the figures; `figure` is the ANEES."""
    notes = run_figures.start_notes(validation.judged_from)
    neglected = neglected_errors(validation.plan.team)
    if neglected:
        notes.append(_neglect_note(validation, neglected, report, figure))
    if not validation.plan.observable:
        notes.append(_unobservable_note(validation, figure))
    elif figure.verdict == "optimistic" and not neglected:
        notes.append(
            f"the filter is optimistic (ANEES {run_figures.interval_words(figure)}): it makes "
            "larger errors than its sigmas say, because it linearises about its own estimate; "
            "smaller initial sigmas or more sightings help"
        )
    if any(one.label.startswith("wind") for one in validation.predicted_errors):
        notes.append(_STILL_AIR)
    outliers = _outliers_note(report)
    if outliers:
        notes.append(outliers)
    lost = int(np.isnan(validation.result.nees).sum())
    if lost:
        notes.append(f"{lost} trials ended with a covariance that is not positive definite")
    return notes


def _neglect_note(
    validation: Validation,
    neglected: Sequence[str],
    report: run_figures.ErrorFigures,
    figure: run_figures.Spread,
) -> str:
    anees = run_figures.interval_words(figure)
    text = f"the filter does not estimate {in_words(neglected)}: ANEES {anees}"
    if figure.verdict == "optimistic":
        text += ", so its sigmas are too small by what these errors cost"
    elif figure.verdict == "consistent":
        text += ", so what these errors cost is within its sigmas"
    if validation.expected is not None:
        expected = float(np.sqrt(np.mean(validation.expected**2)))
        text += f". Second-half RMS: {report.rms_second_half_m:.3g} m, {expected:.3g} m expected"
        if report.predicted_rms_m is not None:
            text += f"; the bound of what it does estimate is {report.predicted_rms_m:.3g} m"
    return f"{text}. filter.estimate makes them states"


def _unobservable_note(validation: Validation, figure: run_figures.Spread) -> str:
    plan = validation.plan
    verdict = plan.observability
    motions = "; ".join(item.description for item in plan.unobservable[:3])
    text = (
        f"the plan is NOT observable (rank {verdict.rank} of {verdict.state_dim}): no sighting "
        f"can detect {motions}. Along them the filter's sigmas are those of the start, grown by "
        "the noise of the motion: they hold where initial_sigma is true, small against the "
        "distances of sight, and the run is short"
    )
    if figure.verdict == "optimistic":
        anees = run_figures.interval_words(figure)
        text += f". Here they do not hold: the filter is optimistic (ANEES {anees})"
    return text


def _outliers_note(overall: run_figures.ErrorFigures) -> str | None:
    """Note on trials so far off that they dominate the RMS; None without such trials."""
    far, lost = overall.share_over_3_predicted, overall.share_over_10_predicted
    median = overall.median_rms_second_half_m
    if not far or lost is None or median is None:
        return None
    if overall.rms_second_half_m <= FEW_SHAPE_THE_RMS * median and not lost:
        return None
    return (
        f"in {100.0 * far:.3g} % of the trials some vehicle is off by more than 3 times the "
        f"bound, in {100.0 * lost:.3g} % by more than 10 times: they shape the RMS of "
        f"{overall.rms_second_half_m:.3g} m, the median trial has {median:.3g} m"
    )
