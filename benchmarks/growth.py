"""How time and memory of a plan grow with the team: whole processes, from 6 to 10,000 vehicles.

Grids with two landmarks beside their first column, planned without a prediction, then with one. The
exponent is that of a line fitted to the logarithms of time from 300 vehicles on. Predictions of 200
vehicles are compared with the exact recursion. With `--base PATH` another checkout plans the same
in turn, up to 1,000 vehicles without a prediction.

    python benchmarks/growth.py
    python benchmarks/growth.py --base ../before
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from benchmarks.sides import metered
from benchmarks.startup import grid

ROOT = Path(__file__).resolve().parents[1]

COLUMNS = {6: 3, 30: 6, 100: 10, 300: 20, 1000: 40, 3000: 60, 5000: 100, 10_000: 100}
"""Vehicles of each grid, and its columns."""

PREDICTED = {6: 3, 30: 6, 100: 10, 200: 20, 1000: 40}
"""The same where errors are predicted."""

REPEATS = {6: 5, 30: 5, 100: 3, 300: 3, 1000: 3}
FITTED_FROM, BASE_UP_TO = 300, 1000

TARGETS_S = {"never 1000": 3.0, "never 5000": 20.0, "never 10000": 60.0}
TARGETS_S |= {"always 200": 6.0, "always 1000": 60.0}
MOST_MB, MOST_GROWTH, MOST_ERROR = 4000.0, 1.3, 0.5


def planned(root: Path, count: int, columns: int, bound: str) -> tuple[float, float, Any]:
    """Return s, MB and the plan's document of one process. Raises RuntimeError if it fails."""
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder) / "grid.yaml", Path(folder) / "plan.json"
        given.write_text(grid(count, columns), encoding="utf-8")
        options = ["--bound", bound, "--max-vehicles", str(count), "-o", str(made)]
        python = root / ".venv" / "bin" / "python"
        command = [str(python if python.exists() else sys.executable), "-m", "syncplan", "plan"]
        seconds, peak = metered([*command, str(given), *options], root)
        return seconds, peak, json.loads(made.read_text(encoding="utf-8"))


def main(base: Path | None = None) -> dict[str, float]:
    """Return s and MB by "BOUND COUNT", the exponent, and errors of predictions in %."""
    found: dict[str, float] = {}
    for bound, sizes in (("never", COLUMNS), ("always", PREDICTED)):
        for count, columns in sizes.items():
            name = f"{bound} {count}"
            for _ in range(REPEATS.get(count, 1)):
                seconds, memory, made = planned(ROOT, count, columns, bound)
                found[name] = min(seconds, found.get(name, np.inf))
                found[f"{name} MB"] = memory
                if base is None or count > BASE_UP_TO or (bound == "always" and count > 100):
                    continue
                seconds, found[f"{name} base MB"], _ = planned(base, count, columns, bound)
                found[f"{name} base"] = min(seconds, found.get(f"{name} base", np.inf))
            if bound == "always" and count == 200:
                found["error 200"] = _error_of(made, columns)
    large = [count for count in COLUMNS if count >= FITTED_FROM]
    times = [found[f"never {count}"] for count in large]
    found["growth"] = float(np.polyfit(np.log(large), np.log(times), 1)[0])
    return found


def _error_of(made: Any, columns: int) -> float:
    """Largest difference in % of a lumped prediction from the exact recursion, of any vehicle."""
    import syncplan
    from syncplan.estimation.bounds import posterior_bound

    vehicles = made["predicted_rms_m"]["vehicles"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "grid.yaml"
        path.write_text(grid(len(vehicles), columns), encoding="utf-8")
        plan = syncplan.plan(path, bound="never")
    exact = posterior_bound(plan.team, plan.windows, plan.scenario.duration_s).rms_second_half()
    return float(100.0 * np.max(np.abs(np.array(list(vehicles.values())) / exact - 1.0)))


def figures(result: dict[str, float]) -> list[Figure]:
    """Return the rows of the table."""
    rows = []
    for bound, sizes in (("never", COLUMNS), ("always", PREDICTED)):
        for count in sizes:
            name = f"{bound} {count}"
            how = "" if bound == "never" else ", errors predicted"
            what = f"plan of {count:,} vehicles{how}"
            rows.append(Figure(what, result[name], "s", TARGETS_S.get(name)))
            if f"{name} base" in result:
                rows.append(Figure("  of the base", result[f"{name} base"], "s"))
            limit = MOST_MB if count == max(COLUMNS) else None
            rows.append(Figure("  memory", result[f"{name} MB"], "MB", limit))
            if f"{name} base MB" in result:
                rows.append(Figure("  of the base", result[f"{name} base MB"], "MB"))
    growth = f"growth from {FITTED_FROM} to {max(COLUMNS):,} vehicles"
    rows.append(Figure(growth, result["growth"], "power", MOST_GROWTH))
    label = "error of the prediction of 200 vehicles by lumps"
    rows.append(Figure(label, result["error 200"], "%", MOST_ERROR))
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--base", type=Path, help="another checkout to compare with")
    print_figures(figures(main(parser.parse_args().base)))
