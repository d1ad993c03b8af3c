"""Records what syncplan prints and writes, and compares two recordings byte for byte.

    python -m tests.tools.record_outputs record build/before [--syncplan PROGRAM] [FOLDER ...]
    python -m tests.tools.record_outputs compare build/before build/after [--digits N]

`record` runs the command line over every scenario of the folders given (examples/scenarios if none
is) and over a few formations without coordinates, and writes one folder per command: standard
output, standard error, exit status and all files. It also records what notebooks show, and data
frames. `compare` lists what differs and exits with 1 if
anything does. Version numbers are left out; a refinement that reaches its time limit may differ.
With `--digits`, numbers are compared in so many significant digits, and those below 1e-12 not at
all.
"""

import argparse
import difflib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
_MOST_LINES = 12
_PLACE = "worked_in"
_PASSING = re.compile(rb"syncplan: compiling [^\n]*\n")
_NUMBER = re.compile(rb"-?\d+\.\d+(?:e[+-]?\d+)?|-?\d+e[+-]?\d+")
_VERSION = re.compile(rb'("?version"?\s*[:=]?\s*)"?\d+\.\d+\.\d+"?')

OPENAPI = (
    "import json; from api.main import create_app; from api.settings import load_settings;"
    "print(json.dumps(create_app(load_settings(data_dir='/nowhere')).openapi(), indent=1))"
)

NOTEBOOKS = """
import sys
from pathlib import Path
import syncplan
from syncplan.recordings.recording_formats import load_log
grid, recording, brief, into = sys.argv[1], *map(Path, sys.argv[2:])
plan = syncplan.plan(grid)
made = {
    "scenario": plan.scenario,
    "plan": plan,
    "refined": syncplan.refine(plan, starts=1, time_limit_s=240, pilot=False),
    "validation": syncplan.validate(plan, trials=20, duration=60.0),
    "flight": syncplan.fly(plan, trials=4, lose=["v3@60"]),
    "sweep": syncplan.sweep(plan.scenario, "range", [50.0, 40.0], trials=2, duration=20.0),
    "what-if": syncplan.what_if(plan),
    "sites": syncplan.choose_landmarks(plan, {"A": (190.0, 35.0), "B": (-40.0, 0.0)}, 1),
    "design": syncplan.design(brief),
    "replay": syncplan.replay(load_log(recording)),
}
for name, one in made.items():
    (into / f"{name}.html").write_text(one._repr_html_())
    (into / f"{name}.csv").write_text(one.to_dataframe().to_csv())
    (into / f"{name}.txt").write_text(repr(one))
"""
"""Script that writes what notebooks show of each kind of result."""

CANDIDATES = {"candidates_m": [[-45.0, 0.0], [35.0, -45.0], [105.0, 115.0], [190.0, 35.0]]}

FORMATIONS = {
    "courtyard": {
        "name": "courtyard",
        "orbit": {"radius_m": 15.0, "angular_rate_rad_s": 0.25, "direction": "ccw"},
        "formation": {
            "links": [["a", "b"], ["b", "c"], ["c", "d"], ["d", "a"], ["c", "e"], ["e", "f"]]
        },
        "landmarks_m": {"gate": [10.0, 100.0], "mast": [10.0, 140.0]},
        "sensor": {"range_m": 40.0, "bearing_sigma_rad": 0.05},
        "area_m": [[0.0, 0.0], [240.0, 0.0], [240.0, 200.0], [0.0, 200.0]],
        "keep_out_m": [[[110.0, 80.0], [130.0, 80.0], [130.0, 120.0], [110.0, 120.0]]],
        "min_separation_m": 5.0,
        "refine": {"center_box_m": 20.0, "starts": 1, "objective": "logdet"},
    },
    "gaps": {
        "name": "gaps",
        "orbit": {"radius_m": [10.0, 12.0, 9.0, 14.0, 10.0, 11.0], "angular_rate_rad_s": 0.25},
        "formation": {"shape": "hex", "count": 6, "columns": 3, "gap_m": 12.0},
        "landmarks_m": [[0.0, -30.0], [60.0, -30.0]],
        "sensor": {"range_m": 30.0, "fov_deg": 200.0, "bearing_sigma_rad": 0.05},
        "min_separation_m": 4.0,
        "limits": {"speed_mps": [2.0, 4.0]},
        "refine": {"vary": ["phases", "centers", "radii"], "radius_m": [8.0, 15.0], "starts": 1},
        "geo_origin": {"lat_deg": 47.3977, "lon_deg": 8.5456, "alt_m": 488.0},
        "start_time": "2026-05-01T09:00:00Z",
    },
    "no-such-drawing": {
        "name": "no-such-drawing",
        "orbit": {"radius_m": 15.0, "angular_rate_rad_s": 0.25},
        "formation": {"links": [[f"h{k}", f"v{j}"] for k in range(3) for j in range(9)]},
        "sensor": {"range_m": 20.0, "bearing_sigma_rad": 0.05},
        "min_separation_m": 10.0,
    },
}


@dataclass(frozen=True, slots=True)
class Run:
    """A command whose outputs are recorded; `{out}` in an argument is its own folder."""

    name: str
    arguments: str
    program: str = "syncplan"


def runs(scenarios: list[Path], given: Path) -> Iterator[Run]:
    """Yield all that is recorded; `given` holds the files made for it."""
    yield Run("openapi", f"-c {shlex.quote(OPENAPI)}", program="python")
    for contract in (
        *("scenario", "plan", "sites", "brief", "design", "what-if", "validation", "flight"),
        *("replay", "sync"),
    ):
        yield Run(f"schema-{contract}", f"schema {contract}")
    commands = (
        "import plan refine place landmarks design validate sweep fly what-if replay plot report "
        "export serve worker schema"
    )
    for command in ("", *commands.split()):
        yield Run(f"help-{command or 'syncplan'}", f"{command} --help")
    for scenario in scenarios:
        yield from _of_scenario(f"{scenario.parent.name}-{scenario.stem}", scenario, given)
    for name in FORMATIONS:
        yield from _of_scenario(f"made-{name}", given / f"{name}.json", given)
    yield from _of_studies(scenarios)
    grid = next(path for path in scenarios if path.stem == "paper-grid-same")
    ring = next(path for path in scenarios if path.stem == "five-ring")
    for objective in ("worst_predicted_rms", "logdet", "min_eigenvalue", "trace"):
        options = f"--objective {objective} --starts 1 --time-limit-s 240"
        yield Run(f"refine-{objective}", f"refine {grid} {options}")
    for name, options in {
        "range": f"{grid} --range 50,55",
        "radius": f"{grid} --radius 18,20",
        "spacing": f"{ring} --spacing 70,72",
        "connected-table": f"{grid} --angular-rate 0.2,0.4 --connected --format table",
        "nothing": f"{grid}",
    }.items():
        yield Run(f"sweep-{name}", f"sweep {options} --trials 5 --seed 3")
    for name, options in {
        "euler": "--model euler --substeps 4",
        "gate": "--gate 0.99",
        "series": "--series",
        "wrong-model": "--model rk4",
    }.items():
        yield Run(f"validate-{name}", f"validate {grid} --trials 5 {options}")


def _of_studies(scenarios: list[Path]) -> Iterator[Run]:
    """Runs of what takes longer, over a few scenarios, each as JSON and as a table."""
    both = "-o {out}/report.json --format table"
    data = ROOT / "tests" / "data"
    for stem in ("paper-grid-same", "paper-grid-alternate", "windy-grid", "mixed-radii-camera"):
        file = next(path for path in scenarios if path.stem == stem)
        yield Run(f"{stem}/what-if", f"what-if {file} {both}")
        yield Run(f"{stem}/one-loss", f"what-if {file} --lose sensor:v1 {both}")
        yield Run(f"{stem}/fly", f"fly {file} --trials 6 --lose v2@50 --hold v1@80:10 {both}")
        yield Run(f"{stem}/fly-gate", f"fly {file} --trials 4 --gate 0.99 --series {both}")
        yield Run(f"{stem}/stress", f"validate {file} --trials 40 --stress {both}")
        yield Run(f"{stem}/flown", f"plan {file} --fly 8 {both}")
        yield Run(f"{stem}/report", f"report {file} -o {{out}}/report.html")
    for recording in sorted((data / "recordings").iterdir()):
        yield Run(f"replay/{recording.name}", f"replay {recording} --series {both}")
        yield Run(f"replay/{recording.name}-tuned", f"replay {recording} --tune {both}")
    for brief in ("impossible-edge.json", "keep-distances.yaml"):
        options = "--purchases -o {out}/design.json --plan-out {out}/plan.json --format table"
        yield Run(f"design/{brief}", f"design {data / 'briefs' / brief} {options}")
    places = " ".join(str(path) for path in sorted((ROOT / "examples" / "places").iterdir()))
    yield Run("import", f"import {places} -o {{out}}/scenario.yaml")
    grid = next(path for path in scenarios if path.stem == "paper-grid-same")
    files = f"{data / 'recordings' / 'truth-gap.tar.xz'} {data / 'briefs' / 'impossible-edge.json'}"
    script = shlex.quote(NOTEBOOKS)
    yield Run("notebooks", f"-c {script} {grid} {files} {{out}}", program="python")


def _of_scenario(name: str, file: Path, given: Path) -> Iterator[Run]:
    yield Run(f"{name}/plan", f"plan {file}")
    yield Run(f"{name}/plan-table", f"plan {file} --format table --steady")
    yield Run(f"{name}/place", f"place {file}")
    if file.parent.name in {"bad", "world"}:
        return
    yield Run(f"{name}/validate", f"validate {file} --trials 40 --seed 1")
    yield Run(f"{name}/validate-table", f"validate {file} --trials 40 --seed 1 --format table")
    yield Run(f"{name}/refine", f"refine {file} --starts 1 --time-limit-s 240")
    yield Run(
        f"{name}/refine-table",
        f"refine {file} --starts 1 --time-limit-s 240 --objective logdet --format table",
    )
    sites = f"landmarks {file} --candidates {given / 'sites.json'} --choose 2"
    yield Run(f"{name}/landmarks", sites)
    yield Run(f"{name}/landmarks-table", f"{sites} --format table")
    yield Run(f"{name}/sweep", f"sweep {file} --angular-rate 0.2,0.3 --trials 5")
    origin = _with_origin(name, file, given)
    for form, options in {
        "all": "--format all",
        "px4": "--format qgc --autopilot px4",
        "plane": "--format ardupilot --vehicle fixed_wing --snap-radius --altitude-step-m 5",
        "turns": "--format csv --turns 3 --sample-time-s 0.5",
    }.items():
        yield Run(f"{name}/export-{form}", f"export {origin} {options} -o {{out}}/files --force")
    yield Run(f"{name}/plot", f"plot {file} -o {{out}}/plan.html")


def _with_origin(name: str, path: Path, given: Path) -> Path:
    """A copy of a scenario with a geographic origin, in YAML or JSON as it was."""
    copy = given / f"origin-{name}{path.suffix}"
    text = path.read_text()
    if path.suffix == ".json":
        document = json.loads(text)
        document.setdefault("geo_origin", {"lat_deg": 47.4, "lon_deg": 8.5, "alt_m": 488.0})
        copy.write_text(json.dumps(document))
    else:
        copy.write_text(f"{text}\ngeo_origin: {{lat_deg: 47.4, lon_deg: 8.5, alt_m: 488}}\n")
    return copy


def record(into: Path, syncplan: Path, folders: list[Path], only: str, processes: int) -> None:
    """Run everything with the `syncplan` given and write what it did below `into`."""
    shutil.rmtree(into, ignore_errors=True)
    into.mkdir(parents=True)
    given = Path(tempfile.mkdtemp(prefix="syncplan-record-"))
    # messages name their files: `compare` knows where those were
    (into / _PLACE).write_text(str(given))
    (given / "sites.json").write_text(json.dumps(CANDIDATES))
    for name, document in FORMATIONS.items():
        (given / f"{name}.json").write_text(json.dumps(document))
    scenarios = []
    for folder in folders:
        for path in sorted(folder.rglob("*.yaml")):
            kept = given / folder.name / path.relative_to(folder)
            kept.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, kept)
            scenarios.append(kept)
    chosen = [run for run in runs(scenarios, given) if re.search(only, run.name)]

    def one(run: Run) -> str:
        _perform(run, into / run.name, given / "out" / run.name, syncplan)
        return run.name

    with ThreadPoolExecutor(processes) as pool:
        for number, name in enumerate(pool.map(one, chosen), 1):
            if sys.stderr.isatty():
                print(f"\r{number} of {len(chosen)} {name:60}", end="", file=sys.stderr)
    shutil.rmtree(given)
    print(f"{len(chosen)} commands recorded in {into}")


def _perform(run: Run, folder: Path, scratch: Path, syncplan: Path) -> None:
    folder.mkdir(parents=True)
    scratch.mkdir(parents=True)
    arguments = shlex.split(run.arguments.replace("{out}", str(scratch)))
    done = subprocess.run(
        [str(syncplan.parent / run.program), *arguments],
        capture_output=True,
        check=False,
        stdin=subprocess.DEVNULL,
        # in a checkout, python would import what is there
        cwd=tempfile.gettempdir(),
        env={**os.environ, "COLUMNS": "100", "OPENBLAS_NUM_THREADS": "1"},
    )
    for name, data in (("stdout", done.stdout), ("stderr", done.stderr)):
        (folder / name).write_bytes(data)
    (folder / "status").write_text(f"{done.returncode}\n")
    if any(scratch.iterdir()):
        shutil.move(scratch, folder / "files")


def compare(before: Path, after: Path, only: str = "", digits: int | None = None) -> int:
    """Print what differs between two recordings; return the number of files that do.

    Numbers count in `digits` significant digits, as they stand if None.
    """
    names = sorted(
        {
            str(path.relative_to(root))
            for root in (before, after)
            for path in root.rglob("*")
            if path.is_file()
            and path.name != _PLACE
            and re.search(only, str(path.relative_to(root)))
        }
    )
    different = 0
    for name in names:
        old, new = before / name, after / name
        if not old.exists() or not new.exists():
            print(f"{name}: only {'after' if new.exists() else 'before'}")
            different += 1
            continue
        a, b = _comparable(old, before, digits), _comparable(new, after, digits)
        if a != b:
            different += 1
            print(f"{name}: differs")
            _show(a, b)
    print(f"{different} of {len(names)} files differ")
    return different


def _comparable(path: Path, recording: Path, digits: int | None) -> bytes:
    """The bytes of a file without version numbers and the folder that was worked in."""
    worked_in = (recording / _PLACE).read_bytes()
    text = _VERSION.sub(rb"\1", path.read_bytes().replace(worked_in, b"FOLDER"))
    if digits is not None:
        text = _NUMBER.sub(lambda found: _rounded(float(found[0]), digits), text)
    return _PASSING.sub(b"", text)


def _rounded(value: float, digits: int) -> bytes:
    return b"0" if abs(value) < 1e-12 else f"{value:.{digits}g}".encode()


def _show(a: bytes, b: bytes) -> None:
    try:
        old, new = a.decode().splitlines(), b.decode().splitlines()
    except UnicodeDecodeError:
        return
    shown = [
        line[:200]
        for line in difflib.unified_diff(old, new, lineterm="", n=0)
        if not line.startswith(("---", "+++", "@@"))
    ]
    print("\n".join(f"    {line}" for line in shown[:_MOST_LINES]))


def main() -> int:
    """Record or compare, as the arguments say."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    actions = parser.add_subparsers(dest="action", required=True)
    recording = actions.add_parser("record", help="run the commands, write what they do")
    recording.add_argument("into", type=Path)
    recording.add_argument("folders", type=Path, nargs="*", help="folders of scenarios")
    recording.add_argument("--only", default="", help="regular expression for names of commands")
    recording.add_argument("--syncplan", type=Path, default=ROOT / ".venv/bin/syncplan")
    recording.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    comparing = actions.add_parser("compare", help="list what two recordings differ in")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    comparing.add_argument("--only", default="", help="regular expression for names of commands")
    comparing.add_argument("--digits", type=int, help="of numbers that count; all if not given")
    chosen = parser.parse_args()
    if chosen.action == "compare":
        return 1 if compare(chosen.before, chosen.after, chosen.only, chosen.digits) else 0
    folders = chosen.folders or [ROOT / "examples" / "scenarios"]
    record(chosen.into, chosen.syncplan.absolute(), folders, chosen.only, chosen.processes)
    return 0


if __name__ == "__main__":
    sys.exit(main())
