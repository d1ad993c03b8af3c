"""How long trials of the Monte Carlo take with further states, and beside an earlier checkout.

Processor time of trials of the paper's grid over 200 s on one thread, the least of several rounds
in which all kinds take turns: poses alone, wind as states, all constant errors, gusts, all of
these. `--filter robust` runs another filter, and `--series` keeps errors over time. With `--base
PATH`, another checkout runs its trials of poses alone in the same turns, and both
sides' results have to be the same to the byte.

    python benchmarks/trials.py
    python benchmarks/trials.py --filter robust --series
    python benchmarks/trials.py --base ../before
"""

import argparse
import hashlib
import sys
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from benchmarks.sides import Side, answer, served_side

ROOT = Path(__file__).resolve().parents[1]

# the library of the side that is measured: this checkout's, unless another is named
sys.path.insert(0, str(served_side() or ROOT))

from syncplan.estimation.filter_options import FilterOptions  # noqa: E402
from syncplan.estimation.montecarlo import run_trials  # noqa: E402
from syncplan.orbits.contacts import find_windows  # noqa: E402
from syncplan.orbits.sightings import Sightings, sample_sightings  # noqa: E402
from syncplan.orbits.team import Team  # noqa: E402

TRIALS, STEPS, ROUNDS, SEED = 48, 2000, 15, 1

POSES, BASE = "poses alone", "poses alone, base"

CONSTANT = ("wind", "speed_scale", "turn_rate_bias", "bearing_bias")

STATES: dict[str, tuple[str, ...]] = {
    POSES: (),
    "wind": ("wind",),
    "all constant errors": CONSTANT,
    "gusts": ("gusts",),
    "all constant errors and gusts": (*CONSTANT, "gusts"),
}
"""Further states of each kind of trial, as ERROR_STATES names them."""

MOST_TIMES = {"wind": 1.3, "all constant errors": 2.2, "all constant errors and gusts": 3.0}
"""How many times as long as poses alone they may take."""

LEAST_OF_BASE = 0.97
"""How many times as fast as the base's trials of poses alone may be, at least."""


# --- one side, in a process of its own ----------------------------------------------------------


def _team() -> Team:
    """The team of paper-grid-same."""
    from syncplan.planning.planner import plan
    from syncplan.scenario.loading import scenario_from

    grid = {
        "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "first_phase_rad": 0.3},
        "formation": {"shape": "grid", "count": 6, "columns": 3, "spacing_m": 70.0},
        "landmarks_m": [[190.0, 0.0], [190.0, 70.0]],
        "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
        "motion": {"speed_sigma_mps": 0.1, "turn_rate_sigma_rad_s": 0.01},
        "initial_sigma": {"position_m": 5.0, "heading_rad": 0.1},
    }
    return plan(scenario_from(grid)).team


def _with_errors(team: Team, names: tuple[str, ...]) -> Team:
    """The team with the errors named, which are states of its filter."""
    from syncplan.orbits.noise import ErrorSigmas

    sigmas = {"wind": 1.0, "speed_scale": 0.02, "turn_rate_bias": 0.005, "gusts": 0.2}
    own = {name: sigma for name, sigma in sigmas.items() if name in names}
    bearing_bias = np.full(team.count, 0.02 if "bearing_bias" in names else 0.0)
    sensors = replace(team.sensors, bearing_bias_sigmas=bearing_bias)
    return replace(team, sensors=sensors, errors=ErrorSigmas(own, estimated=names))


@cache
def _scene() -> tuple[Team, Sightings]:
    team = _team()
    return team, sample_sightings(find_windows(team), team.orbits.period, team.sensors, 1, STEPS)


def timed(request: str) -> tuple[float, str]:
    """Return s and a digest of the trials of a request: a filter, 0 or 1 for a series, a kind."""
    team, seen = _scene()
    name, series, kind = request.split(maxsplit=2)
    options = FilterOptions(trials=TRIALS, seed=SEED, filter=name, with_series=series == "1")
    if STATES[kind]:
        team = _with_errors(team, STATES[kind])
    began = time.process_time()
    found = run_trials(team, seen, STEPS, options, threads=1)
    seconds = time.process_time() - began
    digest = hashlib.sha256(found.final_errors.tobytes() + found.nees.tobytes())
    return seconds, digest.hexdigest()


# --- both sides ---------------------------------------------------------------------------------


def main(
    base: Path | None = None, rounds: int = ROUNDS, *, name: str = "ekf", series: bool = False
) -> dict[str, float]:
    """Return s a trial by kind with the filter of a name, the least of all rounds.

    Raises RuntimeError where trials of poses alone differ from the base's in a byte.
    """
    own = Side(__file__, ROOT)
    turns = {kind: (own, kind) for kind in STATES}
    if base is not None:
        turns[BASE] = Side(__file__, base), POSES
    least = dict.fromkeys(turns, np.inf)
    for number in range(rounds + 1):
        digests = {}
        for label, (side, kind) in turns.items():
            seconds, digests[label] = side.run(f"{name} {int(series)} {kind}")
            if number:  # the first compiles
                least[label] = min(least[label], seconds / TRIALS)
        if digests.get(BASE, digests[POSES]) != digests[POSES]:
            raise RuntimeError("trials of poses alone: not the bytes of the base")
    for side in {side for side, _ in turns.values()}:
        side.end()
    return least


def figures(result: dict[str, float]) -> list[Figure]:
    """Return the rows of the table: a trial of poses alone, and how many times as long others."""
    name = "Monte Carlo, a trial of 6 vehicles"
    rows = [Figure(f"{name}: {POSES}", result[POSES], "s")]
    if BASE in result:
        rows.append(Figure("  of the base", result[BASE], "s"))
        rows.append(Figure("  times as fast", result[BASE] / result[POSES], "x", LEAST_OF_BASE))
    for kind in STATES:
        if kind != POSES:
            times = result[kind] / result[POSES]
            label = f"{name}: times as long with {kind} as states"
            rows.append(Figure(label, times, "times", MOST_TIMES.get(kind)))
    return rows


if __name__ == "__main__":
    if served_side():
        answer(timed)
    else:
        parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
        parser.add_argument("--base", type=Path, metavar="PATH", help="another checkout")
        parser.add_argument("--filter", default="ekf", help="the filter of the trials")
        parser.add_argument("--series", action="store_true", help="keep errors over time")
        given = parser.parse_args()
        print_figures(figures(main(given.base, name=given.filter, series=given.series)))
