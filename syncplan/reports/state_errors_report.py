"""Errors of the filter's states that are no poses, as documents hold them."""

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.trials import state_series
from syncplan.orbits.error_states import layout_of
from syncplan.planning.validation import Validation
from syncplan.reports.document_base import finite_or_none
from syncplan.reports.state_error_schemas import StateErrorFigures, StateErrorSeries


def state_errors_of(validation: Validation) -> list[StateErrorFigures] | None:
    """Return the errors of each further state; None where poses are all."""
    result = validation.result
    names = _names(validation)
    if not names:
        return None
    rms, late = _rms(result.state_squares), _rms(result.late_state_squares)
    covered = result.states_covered.mean(axis=0).tolist()
    predicted: list[float | None] = [one.rms for one in validation.predicted_errors]
    predicted = predicted or [None] * len(names)
    return [
        StateErrorFigures(
            state=label,
            unit=unit,
            rms=rms[k],
            rms_second_half=late[k],
            predicted_rms=bound,
            ratio=finite_or_none(late[k] / bound) if bound else None,
            coverage=covered[k],
        )
        for k, ((label, unit), bound) in enumerate(zip(names, predicted, strict=True))
    ]


def series_of_states(validation: Validation) -> list[StateErrorSeries] | None:
    """Return errors of further states over time; None where poses are all.

    Raises InputError for a run that kept no series.
    """
    names = _names(validation)
    if not names:
        return None
    kept, predicted = state_series(validation.result), validation.predicted_over_time
    return [
        StateErrorSeries(
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


def _rms(squares: Array) -> list[float]:
    found: list[float] = np.sqrt(squares.mean(axis=0)).tolist()
    return found
