"""How long a trial takes with each filter, beside the extended Kalman filter.

Processor time on one thread of the same trials by every filter of the table, in turns, over drawn
scenarios of `tests/searches/lost.py`: certified teams of 2 to 8 vehicles from starts known
to 15 m and 0.3 rad. What a robust trial takes depends on how hard its start is to find, so the
median over scenarios is shown, and the 90th percentile.

    python benchmarks/filters.py
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from syncplan.arrays import Array
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.trial_readings import possible_sightings
from syncplan.orbits.sightings import steps_within
from syncplan.scenario.filters import FILTERS
from tests.searches.lost import draw_plan, started

DRAWS, SEED, TRIALS, ROUNDS = 20, 0, 48, 2
SIGMA_M = 15.0

PLAIN = "ekf"

MOST_TIMES = {"second-order": (1.25, None), "robust": (6.0, 10.0)}
"""How many times as long as PLAIN a filter may take, in the median and in nine of ten scenarios."""


def main(draws: int = DRAWS, rounds: int = ROUNDS) -> dict[str, Array]:
    """Return s a trial by filter, (draws,) each, the least of the rounds."""
    least = {name: np.full(draws, np.inf) for name in FILTERS}
    for number in range(draws):
        made = draw_plan(number)
        steps = steps_within(made.scenario.duration_s, made.sensors.sample_time)
        seen = possible_sightings(made.team, made.windows, steps)
        # the very first round compiles
        for k in range(rounds if number else rounds + 1):
            for name, times in least.items():
                options = FilterOptions(trials=TRIALS, seed=SEED, filter=name)
                began = time.process_time()
                run_trials(started(made, SIGMA_M), seen, steps, options, threads=1)
                taken = (time.process_time() - began) / TRIALS
                if number or k:
                    times[number] = min(times[number], taken)
    return least


def figures(result: dict[str, Array]) -> list[Figure]:
    """Return the rows of the table: a plain trial, and how many times as long others take."""
    of = f"a trial of {len(result[PLAIN])} drawn scenarios"
    rows = [Figure(f"{of}: {PLAIN}, median", float(np.median(result[PLAIN])), "s")]
    for name, seconds in result.items():
        if name == PLAIN:
            continue
        times, targets = seconds / result[PLAIN], MOST_TIMES.get(name, (None, None))
        for share, label, target in ((0.5, "median", targets[0]), (0.9, "nine in ten", targets[1])):
            what = f"{of}: times as long with {name}, {label}"
            rows.append(Figure(what, float(np.quantile(times, share)), "times", target))
    return rows


if __name__ == "__main__":
    print_figures(figures(main()))
