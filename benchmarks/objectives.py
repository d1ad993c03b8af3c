"""Which objective of refinement leaves the filter with the least error: why the default is it.

Each example is refined for each objective, as the command does when nothing else is asked for
(seed 0), and flown in a Monte Carlo of 200 trials over 400 s with the seed 1. The figures are the
RMS position errors of the second half: of the worst vehicle, and of all.

    python benchmarks/objectives.py
"""

import sys
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from syncplan.planning.planner import plan
from syncplan.planning.plans import Plan
from syncplan.planning.validation import validate
from syncplan.refinement.refiner import refine
from syncplan.scenario.loading import load_scenario
from syncplan.scenario.objectives import OBJECTIVES

EXAMPLES = (
    "paper-grid-same",
    "paper-grid-alternate",
    "crooked-line-alternate",
    "mixed-radii-camera",
    "five-ring",
)
GIVEN = "as given"
SCENARIOS = Path(__file__).resolve().parents[1] / "examples" / "scenarios"
TRIALS, DURATION_S, SEED = 200, 400.0, 1


@dataclass(frozen=True, slots=True)
class Flown:
    """RMS position errors of the second half of a Monte Carlo, in m.

    Attributes
    ----------
    worst : of the vehicle with the largest
    overall : of all vehicles
    note : what else is to be known of the plan; empty as a rule
    """

    worst: float
    overall: float
    note: str = ""

    @property
    def text(self) -> str:
        """Both figures, and the note."""
        return f"{self.worst:.2f} / {self.overall:.2f}{self.note}"


Errors = dict[str, dict[str, Flown]]


def flown(made: Plan) -> Flown:
    """Return the errors of the filter on a plan."""
    run = validate(made, trials=TRIALS, seed=SEED, duration=DURATION_S)
    note = ""
    if made.refinement is not None:
        note = "" if made.refinement.improved else " (the input)"
        note += " (cut short)" if made.refinement.cut_short else ""
    worst, overall = run.accuracy.late_position.max(), run.accuracy.overall().late_position
    return Flown(float(worst), float(overall), note)


def main() -> Errors:
    """Return the errors by example, then by objective; those of the input under GIVEN."""
    result: Errors = {}
    for name in EXAMPLES:
        given = plan(load_scenario(SCENARIOS / f"{name}.yaml"))
        result[name] = {GIVEN: flown(given)}
        for objective in OBJECTIVES:
            result[name][objective] = flown(refine(given, objective=objective))
    return result


def rows(result: Errors) -> list[list[str]]:
    """Return the table, its header first: a row for the input and for each objective."""
    table = [["worst / all, m", *result]]
    for objective in (GIVEN, *OBJECTIVES):
        table.append([objective, *(found[objective].text for found in result.values())])
    return table


if __name__ == "__main__":
    shown = rows(main())
    widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
    for row in shown:
        print("  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)))
