"""Tables of the filter's states that are no poses."""

from collections.abc import Sequence

from rich.markup import escape

from syncplan.cli.fitted_tables import FittedTable
from syncplan.reports.flight_report import FlightDocument, FlownStateError
from syncplan.reports.plan_report import PlanDocument, PredictedStateError
from syncplan.reports.run_figures import StateErrorFigures
from syncplan.reports.validation_report import ValidationDocument

MOST_ROWS = 40


def determined_line(document: PlanDocument) -> str | None:
    """Return what is determined with errors as states; None where there are no such states."""
    found, states = document.observability.extended, document.observability.states
    if found is None or states is None:
        return None
    lacking = [one.state for one in states if not one.determined]
    rest = f"; without priors not determined: {', '.join(lacking)}" if lacking else ""
    return f"with errors as states: rank {found.rank} of {found.state_dim}{rest}"


def expected_line(document: PlanDocument) -> str | None:
    """Return what to expect of a filter that leaves errors out; None where it leaves out none."""
    expected = document.expected_rms_m
    if expected is None or expected.overall is None:
        return None
    own = document.predicted_rms_m.overall
    beside = "" if own is None else f" where the filter predicts {own:.3g} m"
    return (
        f"expected RMS error {expected.overall:.3g} m over all vehicles{beside}: some errors are "
        "not estimated"
    )


def merits_line(document: PlanDocument) -> str | None:
    """Return what the figures of a refinement leave out; None where poses are all states."""
    if document.refinement is None or document.observability.extended is None:
        return None
    return (
        "rank, window bound, determinant, eigenvalue and trace are of the poses, as if all else "
        "were known; predicted errors are of all states"
    )


def further_states_table(document: PlanDocument) -> FittedTable | None:
    """Return the table of what a plan predicts of further states; None where there are none."""
    states = document.predicted_errors
    if not states:
        return None
    table = FittedTable(
        f"errors that the filter estimates, with the predicted RMS error{_supposed(states)}",
        ("state", "unit", "sigma at start", "error"),
    )
    for one in states[:MOST_ROWS]:
        table.add_row(escape(one.state), one.unit, f"{one.sigma:.4g}", f"{one.predicted_rms:.3g}")
    table.count_hidden(len(states) - MOST_ROWS)
    return table


def found_states_table(report: FlightDocument | ValidationDocument) -> FittedTable | None:
    """Return the table of what trials found of further states; None where there are none."""
    if not report.errors:
        return None
    table = FittedTable(
        "RMS error of what else the filter estimates, over the run and over its second half",
        ("state", "unit", "total", "2nd half", "bound", "ratio", "3 sigma"),
        goes=("3 sigma", "total", "ratio"),
    )
    for one in report.errors[:MOST_ROWS]:
        table.add_row(
            escape(one.state),
            one.unit,
            f"{one.rms:.3g}",
            f"{one.rms_second_half:.3g}",
            "-" if (bound := _bound(one)) is None else f"{bound:.3g}",
            "-" if one.ratio is None else f"{one.ratio:.2f}",
            f"{100.0 * one.coverage:.1f} %",
        )
    table.count_hidden(len(report.errors) - MOST_ROWS)
    return table


def _bound(one: FlownStateError | StateErrorFigures) -> float | None:
    return one.bound_rms if isinstance(one, FlownStateError) else one.predicted_rms


def _supposed(states: Sequence[PredictedStateError]) -> str:
    """What the bounds suppose, where wind is among the states: in wind it is known less well."""
    windy = any(one.state.startswith("wind ") for one in states)
    return "; predictions suppose still air" if windy else ""
