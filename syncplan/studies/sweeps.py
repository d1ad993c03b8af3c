"""Sweeps: one key of a scenario varied, each value planned and validated."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from syncplan.estimation.filter_options import SweepOptions
from syncplan.studies.study import DocumentKind, TrialStudy

if TYPE_CHECKING:
    from syncplan.planning.variations import PlannedRow


@dataclass(frozen=True, slots=True)
class PlannedSweep:
    """Subject of a sweep: the name of the key that is varied, and the plans of its values."""

    key: str
    rows: "Sequence[PlannedRow]"


class Sweeps(TrialStudy):
    """Validations of the plans of several values of a key."""

    name, verb, of = "sweep", "sweep", "scenario"
    sentence = "Vary one key of a scenario: plan and validate each value."
    options = SweepOptions
    left_out = ("substeps", "gate_probability", "with_series", "model")
    body = "The scenario, what is varied, and how to fly"
    document = DocumentKind(
        "syncplan.reports.validation_report", "SweepReport", published=False, title="Sweep"
    )
    keeps_trials = False

    def work(self, subject: PlannedSweep, options: Any) -> int:
        """Return the number of trials of all rows."""
        return len(subject.rows) * int(options.trials)

    def first_run(self, subject: PlannedSweep, options: Any) -> Any:
        """Return the set-up of the first row."""
        return _run_of(subject.rows[0], options)

    def runs(self, subject: PlannedSweep, options: Any) -> Iterator[Any]:
        """Yield the set-up of each row."""
        return (_run_of(row, options) for row in subject.rows)

    def joined(self, subject: PlannedSweep, options: Any, results: Sequence[Any]) -> Any:
        """Return the sweep of the validated rows."""
        from syncplan.planning.variations import swept

        return swept(subject.key, subject.rows, results)


def _run_of(row: "PlannedRow", options: Any) -> Any:
    from syncplan.planning.validation import trial_run
    from syncplan.planning.variations import options_of_row

    return trial_run(row.plan, options_of_row(row.plan, options))
