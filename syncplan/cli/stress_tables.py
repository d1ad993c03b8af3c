"""What worse worlds do to a plan's filter, as a table."""

from rich.markup import escape

from syncplan.cli.fitted_tables import FittedTable
from syncplan.reports.validation_report import ValidationDocument


def stress_table(report: ValidationDocument) -> FittedTable | None:
    """Return the table of worlds that are worse than stated, the most harmful first; or None."""
    if not report.stress:
        return None
    table = FittedTable(
        "RMS error in m over the second half in worse worlds",
        ("world", "2nd half", "harm", "expected", "ANEES"),
        goes=("expected", "ANEES"),
    )
    for one in report.stress:
        table.add_row(
            escape(one.world),
            f"{one.rms_second_half_m:.3g}",
            f"{one.harm:.2f}",
            "-" if one.expected_rms_m is None else f"{one.expected_rms_m:.3g}",
            "-" if one.anees.value is None else f"{one.anees.value:.2f}",
        )
    return table
