"""How long trials of a flight take, beside trials of a validation and the same loop in plain NumPy.

Processor time of trials of the paper's grid over 2,000 samples on one thread, the least of several
rounds in which flights and validations of the same states take turns: poses alone, and wind. The
bound along each trial's path is part of a flight. The plain loop flies one of these trials; its
path and bound have to be those of the compiled one. Then the wall time of 200 trials of 12 vehicles
over 400 s, by guidance `track` with the filter that flights choose, on two threads.

    python benchmarks/flights.py
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from syncplan.flight.flying import flight_run, fly
from syncplan.planning.planner import plan
from syncplan.planning.plans import Plan
from syncplan.planning.validation import validate
from tests.tools.flown_trials import flown
from tests.tools.plain_flights import fly_plainly
from tests.tools.scenarios import changed

TRIALS, DURATION_S, ROUNDS, SEED = 48, 200.0, 7, 1
MANY, LONG_S, THREADS = 200, 400.0, 2

WIND = {"sigma_mps": 1.0}
STATES: dict[str, dict[str, Any]] = {"poses alone": {}, "wind as states": {"wind": WIND}}
"""Keys of the scenario by what the filter estimates."""

AGREED = 1e-6
"""m, m^2."""

MOST_TIMES, MOST_MANY_S = 6.0, 15.0


def _plan(name: str, **keys: Any) -> Plan:
    return plan(changed(name, **keys), bound="never", pilot=False)


def _works(made: Plan) -> dict[str, Callable[[], object]]:
    options: Any = {"trials": TRIALS, "duration": DURATION_S, "seed": SEED, "filter": "ekf"}
    return {
        "flight": lambda: fly(made, threads=1, **options),
        "validation": lambda: validate(made, threads=1, **options),
    }


def _seconds(work: Callable[[], object]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


def _plain_seconds(made: Plan) -> float:
    """S that the plain loop takes. Raises RuntimeError where it is not the compiled one."""
    options: Any = {"duration": DURATION_S, "seed": SEED, "filter": "ekf"}
    run = flight_run(made, None, **options)
    began = time.process_time()
    plain = fly_plainly(run, 0)
    seconds = time.process_time() - began
    compiled = flown(made, range(1), **options)
    path = np.abs(compiled.path[..., 0] - plain.truth.path).max()
    bound = np.abs(compiled.figures.bound_squares[0] - plain.second_half(plain.bounds)).max()
    if not max(path, bound) < AGREED:
        raise RuntimeError(f"the plain loop flies another trial: {path:.2g} m, {bound:.2g} m^2 off")
    return seconds


def main(rounds: int = ROUNDS) -> dict[str, float]:
    """Return s: a trial of each work by states, of the plain loop, and of many trials."""
    found: dict[str, float] = {}
    for states, keys in STATES.items():
        works = _works(_plan("paper-grid-same", **keys))
        least = dict.fromkeys(works, np.inf)
        for number in range(rounds + 1):
            for label, work in works.items():
                seconds = _seconds(work)
                if number:  # the first compiles
                    least[label] = min(least[label], seconds / TRIALS)
        found |= {f"{label}, {states}": seconds for label, seconds in least.items()}
    found["plain"] = _plain_seconds(_plan("paper-grid-same", wind=WIND))
    lattice = _plan("triangle-lattice", wind=WIND)
    options: Any = {"duration": LONG_S, "threads": THREADS}
    fly(lattice, trials=THREADS, **options)
    began, used = time.perf_counter(), time.process_time()
    fly(lattice, trials=MANY, **options)
    found["many"] = time.perf_counter() - began
    found["many, of all threads"] = time.process_time() - used
    return found


def figures(result: dict[str, float]) -> list[Figure]:
    """Return the rows of the table."""
    rows = []
    for states in STATES:
        flight, validation = (result[f"{label}, {states}"] for label in ("flight", "validation"))
        name = f"Flight, a trial of 6 vehicles over 2,000 samples, {states}"
        rows.append(Figure(name, flight, "s"))
        times = flight / validation
        rows.append(Figure("  times as long as a validation's", times, "times", MOST_TIMES))
    rows.append(Figure("  plain NumPy", result["plain"], "s"))
    flight = result["flight, wind as states"]
    rows.append(Figure("  times as fast as plain NumPy", result["plain"] / flight, "x"))
    name = f"Flight, {MANY} trials of 12 vehicles over {LONG_S:g} s on {THREADS} cores"
    rows.append(Figure(name, result["many"], "s", MOST_MANY_S))
    rows.append(Figure("  processor time of both", result["many, of all threads"], "s"))
    return rows


if __name__ == "__main__":
    print_figures(figures(main()))
