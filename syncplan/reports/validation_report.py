"""Validations and sweeps as documents, with what their figures mean in words."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from syncplan import __version__
from syncplan.estimation.consistency import Consistency
from syncplan.estimation.trials import Accuracy, MonteCarloResult, series
from syncplan.planning.sweeps import ValidatedRow
from syncplan.planning.swept_keys import swept_key
from syncplan.planning.validation import Validation
from syncplan.reports.run_schemas import (
    ErrorFigures,
    FilterRecord,
    Series,
    Spread,
    SweepReport,
    SweepRow,
    ValidationDocument,
    VehicleFigures,
    VehicleSeries,
)
from syncplan.reports.verdict_schemas import plan_verdict

__all__ = ["series_of", "spread_of", "sweep_document", "validation_document"]


def validation_document(validation: Validation) -> ValidationDocument:
    """Return the report of a Monte Carlo run."""
    plan = validation.plan
    names = plan.scenario.vehicle_names
    result, predicted = validation.result, validation.predicted
    per_vehicle = validation.accuracy
    overall_bound = None if predicted is None else float(np.sqrt(np.mean(predicted**2)))
    return ValidationDocument(
        version=__version__,
        name=plan.scenario.name,
        verdict=plan_verdict(plan.verdict),
        trials=result.trials,
        seed=result.seed,
        duration_s=validation.duration,
        filter=FilterRecord(
            model=validation.model,
            substeps=validation.options.motion_substeps,
            gate_probability=validation.gate_probability,
            gated=int(result.gated.sum()),
            used=int(result.accepted.sum()),
        ),
        observable=plan.observable,
        vehicles=[
            VehicleFigures(
                name=name,
                **_figures(
                    per_vehicle,
                    k,
                    None if predicted is None else float(predicted[k]),
                    float(validation.coverage[k]),
                ),
            )
            for k, name in enumerate(names)
        ],
        overall=ErrorFigures(
            **_figures(
                per_vehicle.overall(), (), overall_bound, float(np.mean(validation.coverage))
            )
        ),
        anees=spread_of(validation.anees),
        nis=spread_of(validation.nis),
        series=series_of(result, names, plan.sensors.sample_time) if result.branches else None,
        notes=_filter_notes(validation),
    )


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


def spread_of(figure: Consistency) -> Spread:
    """Return a consistency figure as a document holds it."""
    if not figure.degrees:
        return Spread(value=None, band=None, verdict="unknown", count=0)
    return Spread(
        value=figure.value, band=figure.band, verdict=figure.verdict, count=figure.degrees
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


def _filter_notes(validation: Validation) -> list[str]:
    """What the consistency figures mean for the reader, in plain words."""
    plan, figure = validation.plan, validation.anees
    verdict = plan.observability
    notes = []
    if not verdict.observable:
        motions = "; ".join(item.description for item in plan.unobservable[:3])
        text = (
            f"the plan is NOT observable (rank {verdict.rank} of {verdict.state_dim}): no sighting "
            f"can detect {motions}"
        )
        if figure.verdict == "optimistic":
            text += (
                f". The filter does not know: it is inconsistent (ANEES {figure.value:.2f}, "
                "1 is consistent), its sigmas are too small there and must not be trusted"
            )
        notes.append(text)
    elif figure.verdict == "optimistic":
        notes.append(
            f"the filter is inconsistent (ANEES {figure.value:.2f} above "
            f"{figure.band[1]:.2f}): it makes larger errors than its sigmas say, because it "
            "linearises about its own estimate; smaller initial sigmas or more sightings help"
        )
    lost = int(np.isnan(validation.result.nees).sum())
    if lost:
        notes.append(f"{lost} trials ended with a covariance that is not positive definite")
    return notes
