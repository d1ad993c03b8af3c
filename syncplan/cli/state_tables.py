"""Tables of the filter's states that are no poses."""

from rich.markup import escape

from syncplan.cli.fitted_tables import FittedTable
from syncplan.reports.plan_schemas import PlanDocument

__all__ = ["determined_line", "further_states_table"]

MOST_ROWS = 40


def determined_line(document: PlanDocument) -> str | None:
    """Return what is determined with errors as states; None where there are no such states."""
    found, states = document.observability.extended, document.observability.states
    if found is None or states is None:
        return None
    lacking = [one.state for one in states if not one.determined]
    rest = f"; without priors not determined: {', '.join(lacking)}" if lacking else ""
    return f"with errors as states: rank {found.rank} of {found.state_dim}{rest}"


def further_states_table(document: PlanDocument) -> FittedTable | None:
    """Return the table of what a plan predicts of further states; None where there are none."""
    states = document.predicted_errors
    if not states:
        return None
    table = FittedTable(
        "errors that the filter estimates, with the predicted RMS error",
        ("state", "unit", "sigma at start", "error"),
    )
    for one in states[:MOST_ROWS]:
        table.add_row(escape(one.state), one.unit, f"{one.sigma:.4g}", f"{one.predicted_rms:.3g}")
    table.count_hidden(len(states) - MOST_ROWS)
    return table
