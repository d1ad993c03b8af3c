"""How long whole commands take, from an empty process to the JSON on standard output.

`--help` (what a person waits for before anything happens), and `plan` of the paper's grid of six
vehicles, of a 10 x 10 grid and of a 40 x 25 grid. Files are in the system's cache and compiled to
byte code: one run before the timed ones sees to that. Plans are on paper, and that of six vehicles
is flown too. Then the six vehicles' plan again and again in one process, as a service computes it,
with all turning one way and alternating on paper, and flown. At last, a plan, a validation and a
flight of the six vehicles by a copy whose kernels nothing has compiled; with `--base PATH`, by
another checkout too.

    python benchmarks/startup.py --base ../before
"""

import argparse
import json
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures

ROOT = Path(__file__).resolve().parents[1]

COMMON = """\
landmarks_m: {landmarks}
sensor: {{range_m: 50, bearing_sigma_rad: 0.1, sample_time_s: 0.1}}
motion: {{speed_sigma_mps: 0.1, turn_rate_sigma_rad_s: 0.01}}
initial_sigma: {{position_m: 5, heading_rad: 0.1}}
duration_s: 200
"""

ORBIT = "orbit: {radius_m: 20, angular_rate_rad_s: 0.2, direction: ccw, first_phase_rad: 0.3}\n"

PAPER_GRID = (
    """\
name: paper-grid-same
formation:
  centers_m: [[0, 0], [70, 0], [140, 0], [140, 70], [70, 70], [0, 70]]
  links: [[v1, v2], [v2, v3], [v3, v4], [v4, v5], [v5, v6], [v6, v1], [v2, v5]]
"""
    + ORBIT
    + COMMON.format(landmarks="[[190, 0], [190, 70]]")
)


def grid(count: int, columns: int) -> str:
    """Return the scenario of a grid whose first column has two landmarks beside it."""
    return (
        f"name: grid-{count}\n"
        f"formation: {{shape: grid, count: {count}, columns: {columns}, spacing_m: 70}}\n"
        + ORBIT
        + COMMON.format(landmarks="[[-40, 0], [-40, 70]]")
    )


CASES = {
    "help": ("syncplan --help", None, 0, 5),
    "plan_6": ("syncplan plan --paper, 6 vehicles", PAPER_GRID, 6, 5),
    "flown_6": ("syncplan plan, 6 vehicles, flown", PAPER_GRID, 6, 5),
    "plan_100": ("syncplan plan --paper, 100 vehicles", grid(100, 10), 100, 5),
    "plan_1000": ("syncplan plan --paper, 1,000 vehicles", grid(1000, 40), 1000, 1),
}
"""Label, scenario, its vehicles and how often it is timed."""

REPEATED = {
    "again_6": ("syncplan.plan on paper again, 6 vehicles", "ccw", False),
    "again_6_alternate": ("the same, alternating", "alternate", False),
    "again_6_flown": ("syncplan.plan again, 6 vehicles, flown", "ccw", True),
}
"""Label, direction and pilot of the plans that are computed again in one process."""

FIRST_USE = {
    "plan": [],
    "validate": ["--trials", "200", "--seed", "1"],
    "fly": ["--trials", "12"],
}
"""Commands and their options."""

TARGETS_S = {
    "help": 0.3,
    "plan_6": 1.5,
    "flown_6": 2.5,
    "plan_100": 5.0,
    "plan_1000": None,
    "again_6": 0.033,
    "again_6_alternate": 0.033,
    "again_6_flown": 1.0,
}


_FIRST_USE = "plan, validate and fly, 6 vehicles, nothing compiled"


def run_command(arguments: list[str], folder: Path = ROOT) -> tuple[float, str]:
    """Return (s, standard output) of one process in a folder. Raises RuntimeError if it fails."""
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "syncplan", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    seconds = time.perf_counter() - begin
    if done.returncode != 0:
        raise RuntimeError(f"syncplan {' '.join(arguments)}: {done.returncode}, {done.stderr}")
    return seconds, done.stdout


def _again(direction: str, pilot: bool, repeats: int = 20) -> list[float]:
    """Seconds of each plan of the paper's grid after a first one."""
    import syncplan

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "grid.yaml"
        path.write_text(PAPER_GRID.replace("ccw", direction), encoding="utf-8")
        scenario = syncplan.load_scenario(path)
    syncplan.plan(scenario, pilot=pilot)
    runs = []
    for _ in range(repeats):
        begin = time.perf_counter()
        syncplan.plan(scenario, pilot=pilot)
        runs.append(time.perf_counter() - begin)
    return runs


def first_use(checkout: Path) -> float:
    """Return s of all commands of FIRST_USE by a checkout's library, with nothing compiled."""
    with tempfile.TemporaryDirectory() as name:
        folder, leave_out = Path(name), shutil.ignore_patterns("__pycache__")
        shutil.copytree(checkout / "syncplan", folder / "syncplan", ignore=leave_out)
        scenario = folder / "grid.yaml"
        scenario.write_text(PAPER_GRID, encoding="utf-8")
        runs = [[command, str(scenario), *options] for command, options in FIRST_USE.items()]
        return sum(run_command(arguments, folder)[0] for arguments in runs)


def main(base: Path | None = None) -> dict[str, float]:
    """Return the best and the median seconds of each command."""
    result: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        for case, (_, scenario, count, repeats) in CASES.items():
            arguments = ["--help"]
            if scenario is not None:
                path = Path(folder) / f"{case}.yaml"
                path.write_text(scenario, encoding="utf-8")
                paper = [] if case.startswith("flown") else ["--paper"]
                arguments = ["plan", str(path), *paper]
            if repeats > 1:
                run_command(arguments)
            runs = [run_command(arguments) for _ in range(repeats)]
            if scenario is not None and len(json.loads(runs[-1][1])["vehicles"]) != count:
                raise RuntimeError(f"{case}: the plan has other vehicles than its scenario")
            result[f"{case}_best_s"] = min(seconds for seconds, _ in runs)
            result[f"{case}_median_s"] = statistics.median(seconds for seconds, _ in runs)
    for case, (_, direction, pilot) in REPEATED.items():
        again = _again(direction, pilot)
        result[f"{case}_best_s"], result[f"{case}_median_s"] = min(again), statistics.median(again)
    result["first_use_s"] = first_use(ROOT)
    if base is not None:
        result["base_first_use_s"] = first_use(base)
    return result


def figures(result: dict[str, float]) -> list[Figure]:
    """Return what is shown of a result: the best of each command."""
    labels = {case: label for case, (label, *_) in CASES.items()}
    labels |= {case: label for case, (label, *_) in REPEATED.items()}
    first = {"first_use_s": _FIRST_USE, "base_first_use_s": f"{_FIRST_USE}, base"}
    return [
        *(
            Figure(label, result[f"{case}_best_s"], "s", TARGETS_S[case])
            for case, label in labels.items()
        ),
        *(Figure(label, result[key], "s", None) for key, label in first.items() if key in result),
    ]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--base", type=Path, help="another checkout to compare first use with")
    result = main(parser.parse_args().base)
    print_figures(figures(result))
    medians = ", ".join(f"{result[f'{case}_median_s']:.3f}" for case in TARGETS_S)
    print(f"medians: {medians} s")
