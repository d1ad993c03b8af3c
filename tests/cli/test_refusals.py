"""What a command can't do or write is said in one line, with status 2; no file is touched."""

import os
import shlex
from pathlib import Path
from typing import Any

import pytest

from syncplan.errors import InputError
from syncplan.runtime.files import check_writable, write_text
from tests.tools.scenarios import FILES, circling

GRID = FILES / "paper-grid-same.yaml"
FLY = f"fly {FILES / 'windy-grid.yaml'} --trials 2 --duration 40 --threads 1"

REFUSED = {
    "plan": "SCENARIO",
    f"plan {GRID} -o {'a/' * 200}b": "can't be written",
    f"plan {GRID} --bound sometimes": "sometimes",
    f"plan {GRID} --max-vehicles 3": "--max-vehicles",
    f"plan {GRID} --nonsense": "nonsense",
    "nonsense": "nonsense",
    f"validate {GRID} --trials 0": "trials",
    f"validate {GRID} --trials many": "many",
    f"validate {GRID} --seed -1": "seed",
    f"validate {GRID} --duration 0": "duration",
    f"validate {GRID} --duration 1e8": "samples for 6 vehicles",
    f"validate {GRID} --gate 2": "gate",
    f"validate {GRID} --threads 0": "threads: 0 given, at least 1 is needed",
    f"fly {GRID} --threads -3": "threads: -3 given, at least 1 is needed",
    f"what-if {GRID} --threads 0": "threads: 0 given, at least 1 is needed",
    f"validate {GRID} --model euler --substeps 0": "substeps",
    f"sweep {GRID}": "--angular-rate",
    f"sweep {GRID} --range 50 --radius 20": "exactly one",
    f"sweep {GRID} --range fifty": "fifty",
    f"sweep {GRID} --key sensor.range_sigma_m": "--values",
    f"sweep {GRID} --key wind.sigma --values 1": "--key: 'wind.sigma' can't be swept",
    f"sweep {GRID} --key wind.sigma_mps --values -1": "wind.sigma_mps",
    # refine
    f"refine {GRID} --objective best": "--objective: 'best': must be 'predicted_rms'",
    f"refine {GRID} --center-box-m 0": "--center-box-m: 0.0: must be greater than 0",
    f"refine {GRID} --vary radii --radius-m 25,15": "--radius-m: [25.0, 15.0]: the least is",
    f"refine {GRID} --vary radii": "--radius-m: is missing",
    f"refine {GRID} --radius-m 15,25": "--radius-m: does nothing unless vary names radii",
    f"refine {GRID} --vary phases,speed": "--vary: 'speed': must be 'phases'",
    f"refine {GRID} --time-limit-s 0": "--time-limit-s: 0.0: must be greater than 0",
    f"refine {GRID} --starts 0": "--starts: 0: must be at least 1",
    # fly
    f"{FLY} --hold v1@30:300": "--hold: v1@30:300: ends at 330 s, after the flight of 40 s",
    f"{FLY} --wind 1.5": "--wind: '1.5': give two numbers, such as 1.5,0",
    f"{FLY} --wind 1,north": "--wind",
    f"{FLY} --filter ideal": "'ideal' is not one of 'auto', 'ekf'",
    f"{FLY} --guidance luck": "guidance",
    # what-if
    f"what-if {GRID} --lose v9": "--lose: 'v9': is neither a vehicle (v1, v2, v3, v4, v5, v6) nor",
    f"what-if {GRID} --lose v1,,v2": "syncplan: --lose: '': is neither",
    # plot
    f"plot {GRID} -o plan.gif": "'plan.gif': its name must end in .html, .png, .svg or .pdf",
    f"plot {GRID} --figure pie": "--figure: 'pie': choose from formation, animation",
    f"plot {GRID} --figure refinement": "the plan was not refined",
    f"plot {GRID} --figure comparison": "there is no second plan (--compare)",
    f"plot {GRID} --height 100": "--height: 100 given; allowed is 160 to 8000",
    f"plot {GRID} --height 165": "165 px leave no room for the plot; at this width it",
    f"plot {GRID} --pixel-ratio 7": "--pixel-ratio: 7 given; allowed is 1 to 6",
    f"plot {GRID} --theme blue": "'blue' is not one of 'light', 'dark'",
    f"plot {GRID} --compare none.json": "none.json: no such file",
    # export
    f"export {GRID} --format qgc": "paper-grid-same.yaml: geo_origin: is missing",
    f"export {GRID} --format gpx": "--format",
    f"export {GRID} --format csv --sagitta-m 0": "--sagitta-m: 0 given; allowed is 0.001 to",
    f"export {GRID} --format csv --turns 1 --duration 3": "--turns: goes without",
    f"export {GRID} --format ardupilot --autopilot px4": "--autopilot: px4: ",
}
"""What is reported, by command."""

ENDINGS = {"plot": "html", "export": "zip"}


@pytest.mark.parametrize("command", REFUSED, ids=lambda one: one.replace(f"{FILES}/", "")[:80])
def test_what_is_wrong_is_said_in_one_line_and_nothing_is_written(
    command: str, refused: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    name, *arguments = shlex.split(command)
    kept = tmp_path / f"kept.{ENDINGS.get(name, 'json')}"
    kept.write_text("kept")
    if "-o" not in arguments:
        arguments += ["-o", kept.name]
    err = refused(name, *arguments)
    assert err.count("\n") == 1
    assert REFUSED[command] in err
    assert [*tmp_path.iterdir()] == [kept]
    assert kept.read_text() == "kept"


LANDMARKS = [[-40.0, 0.0], [-30.0, 20.0]]
STAR = {"links": [["v1", f"v{k}"] for k in range(2, 9)]}


@pytest.mark.parametrize(
    ("command", "changes", "reported"),
    [
        (
            "refine",
            {"min_separation_m": 40.0, "sensor": {"range_m": 30.0}},
            "link v1-v2: separation 40 m against range 30 m",
        ),
        ("refine --margin-m 60", {}, "link v1-v2: margin 60 m leaves nothing of range 50 m"),
        (
            "refine",
            {"area_m": [[0, 0], [30, 0], [30, 30], [0, 30]]},
            "v1: no place for a circle of 20 m inside area_m and clear of keep_out_m with its "
            "centre from (0, 0) to (30, 30) m",
        ),
        (
            "refine --vary radii --radius-m 30,40",
            {"limits": {"speed_mps": [3.0, 5.0]}},
            "radii of 30 to 40 m at 0.2 rad/s mean 6 to 8 m/s against limits.speed_mps 3 to 5",
        ),
        (
            "place",
            {"formation": STAR, "orbit": circling(radius_m=50.0), "sensor": {"range_m": 10.0}},
            "at most 6 fit round it",
        ),
    ],
)
def test_constraints_that_conflict_are_named_with_status_4(
    run: Any, written: Any, command: str, changes: dict[str, Any], reported: str
) -> None:
    name, *options = command.split()
    status, out, err = run(name, written(landmarks_m=LANDMARKS, **changes), *options)
    assert (status, out) == (4, "")
    assert reported in err
    assert err.count("\n") == 1


# --- outputs that can't be written are said before anything is read -------------------------------


NEEDED = {
    "landmarks": ("--candidates", "no.yaml", "--choose", "1"),
    "sweep": ("--range", "40,50"),
    "export": ("--format", "csv"),
}
"""Options that commands do not go without."""

# and replay, but what that reads are folders, as a rule
MAKING = ("plan", "refine", "place", "landmarks", "design")
USING = ("validate", "sweep", "fly", "what-if", "plot", "export")
OUTPUTS = [
    *((name, "-o") for name in (*MAKING, *USING)),
    ("landmarks", "--scenario-out"),
    ("design", "--plan-out"),
]


def _target(folder: Path, command: str) -> Path:
    return folder / f"x.{ENDINGS.get(command, 'json')}"


@pytest.mark.parametrize(("command", "option"), [*OUTPUTS, ("replay", "-o")])
def test_a_missing_folder_is_said_before_anything_is_read(
    refused: Any, tmp_path: Path, command: str, option: str
) -> None:
    target = _target(tmp_path / "nodir", command)
    # no such file: that the output is complained of says that it comes first
    err = refused(command, "none.yaml", *NEEDED.get(command, ()), option, str(target))
    problem = f"can't be written: there is no directory {target.parent}; make it first"
    assert err == f"syncplan: {target}: {problem}\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("command", "option"), OUTPUTS)
def test_the_file_that_is_read_is_not_written_over(
    refused: Any, tmp_path: Path, command: str, option: str
) -> None:
    target = _target(tmp_path, command)
    target.write_text("{}")
    err = refused(command, str(target), *NEEDED.get(command, ()), option, str(target))
    assert err == f"syncplan: {target}: is the file that is read; give another one to write\n"
    assert target.read_text() == "{}"


def test_a_file_to_replace_is_as_it_was_after_the_check(refused: Any, tmp_path: Path) -> None:
    target = tmp_path / "x.json"
    target.write_text("mine")
    assert "none.yaml" in refused("fly", "none.yaml", "-o", str(target))
    assert [one.name for one in tmp_path.iterdir()] == ["x.json"]
    assert target.read_text() == "mine"


def test_standard_output_and_devices_need_no_folder(refused: Any) -> None:
    for output in ("-", "/dev/null", "/dev/stdout"):
        assert refused("fly", "none.yaml", "-o", output).startswith("syncplan: none.yaml: ")


def test_what_can_not_be_written_to_is_refused_with_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shut, read_only = tmp_path / "shut", tmp_path / "kept.json"
    shut.mkdir()
    read_only.write_text("{}")
    barred = {shut, read_only}
    # everything is open to root, who may run this
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) not in barred)
    refused = {
        shut / "x.json": rf"nothing can be written to {shut}; give a file else",
        read_only: r"kept\.json: can't be written: it is read-only$",
        tmp_path: "is a directory; give the name of a file",
        read_only / "x.json": r"x\.json: can't be written: Not a directory",
        tmp_path / ("x" * 300): "can't be written: File name too long",
    }
    for path, words in refused.items():
        with pytest.raises(InputError, match=words):
            check_writable(path)


def test_writing_and_checking_refuse_alike(tmp_path: Path) -> None:
    target = tmp_path / "nodir" / "x.json"
    with pytest.raises(InputError) as checked:
        check_writable(target)
    with pytest.raises(InputError) as written:
        write_text(target, "{}")
    assert str(checked.value) == str(written.value)
