"""Validations and sweeps as documents, with what their figures mean in words."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from syncplan import __version__
from syncplan.arrays import Array
from syncplan.estimation.consistency import Consistency
from syncplan.estimation.outlying_trials import TrialErrors
from syncplan.estimation.trials import Accuracy, MonteCarloResult, series
from syncplan.planning.judged_team import Verdict
from syncplan.planning.validation import Validation
from syncplan.planning.variations import StressTest, ValidatedRow
from syncplan.reports.document_base import finite_or_none
from syncplan.reports.run_schemas import (
    ErrorFigures,
    FilterRecord,
    Series,
    Spread,
    StressedWorld,
    SweepReport,
    SweepRow,
    ValidationDocument,
    VehicleFigures,
    VehicleSeries,
)
from syncplan.reports.state_errors_report import series_of_states, state_errors_of
from syncplan.reports.truth_report import expected_in_truth, keys_in_truth, truth_note
from syncplan.reports.validation_notes import notes_on
from syncplan.reports.verdict_schemas import plan_verdict
from syncplan.scenario.dotted_keys import swept_key

_FACTORS = (3.0, 10.0)
"""Multiples of the bound that the shares of trials are over."""


def validation_document(validation: Validation) -> ValidationDocument:
    """Return the report of a Monte Carlo run."""
    plan = validation.plan
    result, overall = validation.result, _overall(validation)
    anees = spread_of(validation.anees)
    truth, expected = keys_in_truth(plan), expected_in_truth(plan, validation.expected)
    differs = truth_note(truth, expected, overall.rms_second_half_m, overall.predicted_rms_m)
    return ValidationDocument(
        version=__version__,
        name=plan.scenario.name,
        truth=truth,
        expected_rms_m=expected,
        verdict=plan_verdict(plan.verdict),
        trials=result.trials,
        seed=result.seed,
        duration_s=validation.duration,
        filter=FilterRecord(
            model=validation.model,
            kind=validation.filter,
            chosen_because=validation.chosen_because,
            judged_from_s=validation.judged_from,
            substeps=validation.options.motion_substeps,
            gate_probability=validation.gate_probability,
            gated=int(result.gated.sum()),
            used=int(result.accepted.sum()),
        ),
        observable=plan.observable,
        vehicles=_vehicles(validation),
        overall=overall,
        errors=state_errors_of(validation),
        anees=anees,
        nis=spread_of(validation.nis),
        series=_series(validation) if result.branches else None,
        notes=[*filter(None, [differs]), *notes_on(validation, overall, anees)],
    )


def stress_document(test: StressTest) -> ValidationDocument:
    """Return the report of a stress test: of the world as stated, with what others did."""
    report = validation_document(test.nominal)
    verdict = Verdict((*test.nominal.plan.verdict.findings, *test.findings))
    worlds = [
        StressedWorld(
            world=row.world,
            truth=keys_in_truth(row.validation.plan) or [],
            rms_second_half_m=float(row.validation.accuracy.overall().late_position),
            harm=row.harm,
            expected_rms_m=row.expected,
            anees=spread_of(row.validation.anees),
        )
        for row in test.rows
    ]
    return report.model_copy(update={"verdict": plan_verdict(verdict), "stress": worlds})


def sweep_document(
    name: str, rows: Sequence[ValidatedRow], reports: Sequence[ValidationDocument]
) -> SweepReport:
    """Return the report of a sweep of `name`: label, verdict and validation for each value."""
    return SweepReport.model_validate(
        {
            "swept": swept_key(name).key,
            "rows": [_row(row, report) for row, report in zip(rows, reports, strict=True)],
        }
    )


def _row(row: ValidatedRow, report: ValidationDocument) -> SweepRow:
    plan = row.validation.plan
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


def _vehicles(validation: Validation) -> list[VehicleFigures]:
    predicted, each = validation.predicted, validation.trial_errors
    medians = each.median()
    shares = [_shares(each, predicted, factor) for factor in _FACTORS]
    return [
        VehicleFigures(
            name=name,
            **_figures(
                validation.accuracy,
                k,
                None if predicted is None else float(predicted[k]),
                float(validation.coverage[k]),
            ),
            median_rms_second_half_m=float(medians[k]),
            share_over_3_predicted=None if shares[0] is None else float(shares[0][k]),
            share_over_10_predicted=None if shares[1] is None else float(shares[1][k]),
        )
        for k, name in enumerate(validation.plan.scenario.vehicle_names)
    ]


def _shares(each: TrialErrors, predicted: Array | None, factor: float) -> Array | None:
    return None if predicted is None else each.share_over(factor * predicted)


def _overall(validation: Validation) -> ErrorFigures:
    predicted, each = validation.predicted, validation.trial_errors
    bound = None if predicted is None else float(np.sqrt(np.mean(predicted**2)))
    shares = [
        None if predicted is None else each.overall_share_over(factor * predicted)
        for factor in _FACTORS
    ]
    return ErrorFigures(
        **_figures(validation.accuracy.overall(), (), bound, float(np.mean(validation.coverage))),
        median_rms_second_half_m=each.overall_median(),
        share_over_3_predicted=shares[0],
        share_over_10_predicted=shares[1],
    )


def _figures(
    accuracy: Accuracy, vehicle: int | tuple[()], predicted: float | None, covered: float
) -> dict[str, Any]:
    late = float(accuracy.late_position[vehicle])
    return {
        "rms_m": float(accuracy.position[vehicle]),
        "rms_second_half_m": late,
        "rms_x_m": float(accuracy.x[vehicle]),
        "rms_y_m": float(accuracy.y[vehicle]),
        "rms_heading_rad": float(accuracy.heading[vehicle]),
        "final_error_m": float(accuracy.final_position[vehicle]),
        "predicted_rms_m": predicted,
        "rms_over_predicted": late / predicted if predicted else None,
        "coverage_3sigma": covered,
    }


def _series(validation: Validation) -> Series:
    plan = validation.plan
    names, sample_time = plan.scenario.vehicle_names, plan.sensors.sample_time
    poses = series_of(validation.result, names, sample_time)
    return poses.model_copy(update={"errors": series_of_states(validation)})


def spread_of(figure: Consistency) -> Spread:
    """Return a consistency figure as a document holds it."""
    return Spread(
        value=finite_or_none(figure.value),
        band=None if math.isnan(figure.band[0]) else figure.band,
        verdict=figure.verdict,
        count=figure.count,
        basis=figure.basis,
    )


def series_of(result: MonteCarloResult, names: Sequence[str], sample_time: float) -> Series:
    """Return errors and sigmas over time as a document holds them; `sample_time` in s.

    Raises InputError for a run that kept no series.
    """
    kept = series(result)
    steps = np.arange(result.steps + 1)
    return Series(
        time_s=(steps * sample_time).tolist(),
        vehicles=[
            VehicleSeries(
                name=name,
                rms_m=kept.position_rms[:, k].tolist(),
                rms_x_m=kept.axis_rms[:, k, 0].tolist(),
                rms_y_m=kept.axis_rms[:, k, 1].tolist(),
                rms_heading_rad=kept.heading_rms[:, k].tolist(),
                mean_x_m=kept.mean_errors[:, k, 0].tolist(),
                mean_y_m=kept.mean_errors[:, k, 1].tolist(),
                mean_heading_rad=kept.mean_errors[:, k, 2].tolist(),
                sigma_m=kept.position_sigma[:, k].tolist(),
                sigma_x_m=kept.axis_sigma[:, k, 0].tolist(),
                sigma_y_m=kept.axis_sigma[:, k, 1].tolist(),
                sigma_heading_rad=kept.heading_sigma[:, k].tolist(),
            )
            for k, name in enumerate(names)
        ],
    )
