"""Plan a formation and validate it, in five lines."""

from pathlib import Path

import syncplan

SCENARIO = Path(__file__).parent / "scenarios" / "paper-grid-same.yaml"


def main(trials: int = 200) -> syncplan.Validation:
    """Return the validation of the 3 x 2 grid, all vehicles turning the same way."""
    scenario = syncplan.load_scenario(SCENARIO)
    plan = syncplan.plan(scenario)
    return syncplan.validate(plan, trials=trials, seed=1)


if __name__ == "__main__":
    report = main()
    print("observable:", report.plan.observable)
    print("RMS error, second half, m: ", report.accuracy.late_position.round(2))
    print("predicted by the bound, m: ", report.predicted)
