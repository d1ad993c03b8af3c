"""How long a navigator takes for a step of a team of six: what was read, to estimate and command.

The paper's grid with readings and sightings of a flight of 100 s, by guidance `track`; median over
steps of wall time on one thread, for `ekf` and for `robust`, which the plan of a flight has by
default. Sightings that arrive up to four samples late are carried on from at each step.

    python benchmarks/navigator.py
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import syncplan
from benchmarks import Figure, print_figures
from syncplan.flight.flying import flight_run
from tests.flight.test_navigator import lanes_of, sensed

MOST_STEP = 50e-6
"""s, of a step with `ekf`."""

KINDS = {"ekf": ("ekf", 0), "robust": ("robust", 0), "ekf, sightings 4 samples late": ("ekf", 4)}
"""What is timed: filter, and by how many samples sightings are late."""


def main() -> dict[str, float]:
    """Return the median time of a step in s, by what is timed."""
    plan = syncplan.plan(
        syncplan.load_scenario(
            Path(__file__).parents[1] / "examples" / "scenarios" / "paper-grid-same.yaml"
        ),
        pilot=False,
    )
    found = {}
    for what, (name, late) in KINDS.items():
        run = flight_run(plan, filter=name, late=late, duration=100.0, trials=1)
        readings = list(sensed(lanes_of(run), late))
        navigator = syncplan.Navigator(plan, filter=name, late=late)
        times = []
        for read in readings:
            began = time.perf_counter()
            navigator.step(read)
            times.append(time.perf_counter() - began)
        found[what] = float(np.median(times))
    return found


def figures(found: dict[str, float]) -> list[Figure]:
    """Return the figures of the benchmark."""
    return [
        Figure(
            f"navigator, a step of 6 vehicles, {what}",
            seconds,
            "s",
            target=MOST_STEP if what == "ekf" else None,
        )
        for what, seconds in found.items()
    ]


if __name__ == "__main__":
    print_figures(figures(main()))
