"""The size of the paper's hardware run (Table 3): four ground robots on half-metre circles.

Sensors see 45 cm. Every robot is localised to centimetres, although three of four see no landmark.
The initial sigma, 0.2 m, is as large as the distances at which robots meet, far outside what an
extended Kalman filter takes for linear, so the robust filter runs: it looks for its start over a
period, and reaches the bound.
"""

from pathlib import Path

import syncplan

SCENARIO = Path(__file__).parent / "scenarios" / "four-ground-robots.yaml"


def main(trials: int = 200) -> syncplan.Validation:
    """Return the validation of four robots in a line."""
    return syncplan.validate(syncplan.load_scenario(SCENARIO), trials=trials, seed=1)


if __name__ == "__main__":
    report = main()
    print("robot   RMS m   2nd half   bound")
    for k, name in enumerate(report.plan.scenario.vehicle_names):
        bound = 0.0 if report.predicted is None else report.predicted[k]
        late = report.accuracy.late_position[k]
        print(f"{name:6} {report.accuracy.position[k]:6.3f} {late:10.3f} {bound:7.3f}")
    print(f"ANEES {report.anees.value:.2f}: {report.anees.verdict}")
