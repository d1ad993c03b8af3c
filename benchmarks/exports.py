"""How long a plan of six vehicles takes to go out in every format.

The paper's grid on Earth, 200 s of it, 0.1 s between poses. First in one process that has planned
already, each format alone and all at once, the fastest of several; then a whole `syncplan export`,
from an empty process to the files of every format in a folder.

    python benchmarks/exports.py
"""

import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from benchmarks.startup import PAPER_GRID, run_command

ROOT = Path(__file__).resolve().parents[1]

ON_EARTH = (
    PAPER_GRID + "geo_origin: {lat_deg: 47.3977, lon_deg: 8.5456, alt_m: 488}\n"
    'start_time: "2026-05-01T09:00:00Z"\n'
)

TARGET_S = 3.0
WHOLE = "command"


def _alone(path: Path, repeats: int) -> dict[str, float]:
    """Fastest seconds of each format in this process, the first run of each left out."""
    import syncplan
    from syncplan.exporting.formats import ALL, FORMATS, export

    plan = syncplan.plan(syncplan.load_scenario(path))
    result = {}
    for name in (*FORMATS, ALL):
        export(plan, name)
        runs = []
        for _ in range(repeats):
            begin = time.perf_counter()
            export(plan, name)
            runs.append(time.perf_counter() - begin)
        result[name] = min(runs)
    return result


def _command(path: Path, folder: Path) -> float:
    """Seconds of one process that writes every format."""
    arguments = ["export", str(path), "--format", "all", "-o", str(folder)]
    return run_command(arguments)[0]


def main(repeats: int = 5) -> dict[str, float]:
    """Return the fastest seconds of each format, of all, and of the whole command."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "grid.yaml"
        path.write_text(ON_EARTH, encoding="utf-8")
        result = _alone(path, repeats)
        _command(path, Path(folder) / "first")
        result[WHOLE] = min(_command(path, Path(folder) / str(k)) for k in range(repeats))
    return result


def figures(result: dict[str, float]) -> list[Figure]:
    """Return what is shown of a result."""
    return [
        *(
            Figure(f"export, 6 vehicles: {name}", seconds, "s")
            for name, seconds in result.items()
            if name not in ("all", WHOLE)
        ),
        Figure("export, 6 vehicles: all formats", result["all"], "s", TARGET_S),
        Figure("syncplan export --format all, 6 vehicles", result[WHOLE], "s", TARGET_S),
    ]


if __name__ == "__main__":
    print_figures(figures(main()))
