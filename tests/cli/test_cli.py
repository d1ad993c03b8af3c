"""The command line as a user meets it: streams, exit codes, files left behind."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, get_args

import pytest

import syncplan
from syncplan.cli import command_line
from syncplan.cli.document_table import DOCUMENTS
from syncplan.cli.plan_commands import VARIABLES
from syncplan.errors import InputError
from syncplan.estimation.lane_filter import LaneFilter
from syncplan.exporting.format_table import ALL, FORMATS
from syncplan.plotting.figure_table import FIGURES
from syncplan.reports.plan_report import plan_document
from syncplan.reports.validation_report import validation_document
from syncplan.runtime.files import as_text
from syncplan.scenario.models import Variable
from syncplan.scenario.objectives import OBJECTIVES
from tests.tools.processes import PATIENCE_S
from tests.tools.scenarios import BAD_FILES, FILES, circling

GRID = str(FILES / "paper-grid-same.yaml")
BRIDGE = str(FILES / "landmark-bridge.yaml")


SYNCPLAN = f"{sys.executable} -m syncplan"


def _in_bash(command: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """What a shell made of a command."""
    return subprocess.run(
        ["bash", "-c", f"set -o pipefail; {command}"],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
        **options,
    )


def test_plan_writes_json_to_standard_output_and_nothing_else(run: Any) -> None:
    status, out, err = run("plan", GRID)
    assert status == 0
    assert err.splitlines() == [f"syncplan: {note}" for note in json.loads(out)["notes"]]
    assert out == as_text(plan_document(syncplan.plan(GRID)).as_json())


def test_a_plan_file_and_its_scenario_validate_to_the_same_bytes(
    printed: Any, plan_file: Path
) -> None:
    short = ("--trials", "4", "--seed", "3", "--duration", "5")
    for subject in (str(plan_file), GRID):
        out = printed("validate", subject, *short)
        validated = syncplan.validate(subject, trials=4, seed=3, duration=5.0)
        assert out == as_text(validation_document(validated).as_json())


def test_the_number_of_threads_does_not_change_a_byte(run: Any) -> None:
    short = ("validate", GRID, "--trials", "40", "--duration", "10", "--series")
    one = run(*short, "--threads", "1")[1]
    assert one == run(*short, "--threads", "2")[1]
    assert one != run(*short, "--seed", "1")[1]


def test_with_a_file_standard_output_stays_empty_and_a_dash_is_standard_output(
    run: Any, printed: Any, tmp_path: Path
) -> None:
    target = tmp_path / "plan.json"
    status, out, err = run("plan", GRID, "-o", str(target))
    assert (status, out) == (0, "")
    assert "wrote" in err
    assert [*tmp_path.iterdir()] == [target]
    assert printed("plan", GRID, "-o", "-") == target.read_text()


def test_an_import_goes_to_a_file_or_to_standard_output(printed: Any, tmp_path: Path) -> None:
    source, target = "tests/data/places/points.csv", tmp_path / "field.yaml"
    printed("import", source, "-o", str(target))
    assert printed("import", source) == target.read_text()
    assert printed("import", source, "-o", "-") == target.read_text()


def test_a_table_can_be_asked_for(run: Any) -> None:
    _, out, _ = run("plan", BRIDGE, "--format", "table")
    assert "NOT observable" in out
    assert "turn of v2 about L2" in out
    _, out, _ = run("validate", GRID, "--trials", "4", "--duration", "5", "--format", "table")
    assert "ANEES" in out


def test_an_unobservable_plan_exits_with_3_only_when_asked(run: Any) -> None:
    assert run("plan", BRIDGE)[0] == 0
    status, out, err = run("plan", BRIDGE, "--require-observable")
    assert status == 3
    assert json.loads(out)["observability"]["rank"] == 5
    assert "not observable" in err


def test_validation_of_an_unobservable_plan_says_so_in_plain_words(run: Any) -> None:
    _, out, err = run("validate", BRIDGE, "--trials", "4", "--duration", "20")
    assert "NOT observable" in err
    assert any("turn of v2 about L2" in note for note in json.loads(out)["notes"])


@pytest.mark.parametrize("wrong", [1, 10, 11, 30])
def test_of_many_faults_ten_are_listed_and_the_rest_is_counted(
    wrong: int, refused: Any, written: Any
) -> None:
    path = written(landmarks_m=[["x", k] for k in range(wrong)])
    err = refused("plan", path)
    lines = [line.removeprefix(f"syncplan: {path}: ") for line in err.splitlines()]
    assert lines[:10] == [
        f"landmarks_m[{k}][0]: 'x': must be a valid number" for k in range(min(wrong, 10))
    ]
    assert lines[10:] == [f"and {wrong - 10} more"] * (wrong > 10)


def test_of_faults_of_options_each_is_named_by_its_option(refused: Any) -> None:
    err = refused("refine", GRID, "--starts", "0", "--time-limit-s", "-1")
    assert sorted(line.split(": ")[1] for line in err.splitlines()) == [
        "--starts",
        "--time-limit-s",
    ]


def test_placing_a_plan_says_that_it_is_one(refused: Any, plan_file: Path) -> None:
    assert "is already a plan" in refused("place", str(plan_file))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this machine")
def test_a_full_disk_is_one_clear_line(refused: Any) -> None:
    done = _in_bash(f"{SYNCPLAN} plan {GRID} > /dev/full")
    assert done.returncode == 2
    for err in (done.stderr, refused("plan", GRID, "-o", "/dev/full")):
        assert err.count("\n") == 1
        assert "No space left" in err


def test_an_interrupted_run_leaves_nothing_half_written(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = []

    @contextmanager
    def interrupting(*_: object) -> Iterator[Callable[[int], None]]:
        def progress(done: int) -> None:
            begun.append(done)
            os.kill(os.getpid(), signal.SIGINT)

        yield progress

    monkeypatch.setattr("syncplan.cli.console.progress_bar", interrupting)
    # a parent that ignores interrupts hands that down
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        target = ("--trials", "20000", "-o", str(tmp_path / "report.json"))
        status, out, err = run("validate", GRID, *target)
    finally:
        signal.signal(signal.SIGINT, before)
    assert (status, out, err) == (130, "", "syncplan: interrupted; nothing was written\n")
    assert 0 < begun[-1] < 20000
    assert list(tmp_path.iterdir()) == []


def test_an_internal_fault_exits_with_1_without_a_traceback(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("deep inside")

    monkeypatch.setattr("syncplan.reports.plan_report.plan_document", broken)
    status, _, err = run("plan", GRID)
    assert status == 1
    assert "internal fault" in err
    assert err.count("\n") == 1


def test_a_sweep_reports_each_value_and_the_connected_row(run: Any, printed: Any) -> None:
    out = printed(
        *("sweep", GRID, "--angular-rate", "0.2,1.0", "--connected"),
        *("--trials", "4", "--duration", "20"),
    )
    rows = json.loads(out)["rows"]
    assert [row["value"] for row in rows] == [0.2, 1.0, 0.2]
    assert rows[2]["range_m"][0] > rows[1]["range_m"][0]
    assert rows[2]["label"].startswith("connected")
    for name in ("--range", "--radius"):
        assert run("sweep", GRID, name, "50", "--trials", "2", "--duration", "5")[0] == 0


def test_a_sweep_announces_the_kernels_of_all_its_values(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def unready(*_: object, **__: object) -> None:
        raise InputError("not today")

    def compiled(_: LaneFilter, count: int) -> bool:
        asked.append(count)
        return count == 6

    monkeypatch.setattr(LaneFilter, "is_compiled", compiled)
    monkeypatch.setattr("syncplan.studies.study.TrialStudy.run", unready)
    short = ("--trials", "1", "--duration", "2")
    varied = (str(FILES / "biased-grid.yaml"), "--key", "formation.count", "--values")
    _, _, said = run("sweep", *varied, "6", *short)
    assert "compiling" not in said
    assert asked == [6]
    _, _, said = run("sweep", *varied, "6,7", *short)
    assert said.count("compiling") == 1


@pytest.mark.parametrize("contract", [name for name, kind in DOCUMENTS.items() if kind.published])
def test_schemas_are_json_schema(contract: str, printed: Any) -> None:
    schema = json.loads(printed("schema", contract))
    assert schema["type"] == "object"
    assert schema["properties"]


COMMANDS = [
    str(command.name)
    for each in command_line.application().registered_groups
    for command in getattr(each.typer_instance, "registered_commands", [])
]


def test_all_commands_are_known_here() -> None:
    listed = [name for names in command_line.GROUPS.values() for name in names]
    assert [*listed, "schema"] == COMMANDS


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example(command: str, printed: Any) -> None:
    out = printed(command, "--help")
    (example,) = re.findall(r"Example: .*?(?=Example:|$)", " ".join(out.split()))[:1]
    assert f"syncplan {command}" in example


def test_a_shell_completes_what_can_be_chosen_by_name(
    printed: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def completed(words: str) -> list[str]:
        """What bash would offer after these words."""
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", str(words.count(" ")))
        return str(printed()).split()

    monkeypatch.setenv("_SYNCPLAN_COMPLETE", "complete_bash")
    monkeypatch.setattr(sys, "argv", ["syncplan"])
    monkeypatch.setattr(sys.modules["__main__"], "__package__", None)
    assert completed("syncplan pla") == ["plan", "place"]
    assert completed("syncplan export --format ") == [*FORMATS, ALL]
    assert completed("syncplan refine --objective ") == list(OBJECTIVES)
    assert completed("syncplan refine --vary phases,") == ["phases,centers", "phases,radii"]
    assert completed("syncplan plot --figure t") == [k for k in FIGURES if k.startswith("t")]
    assert completed("syncplan plan sc") == []
    assert get_args(Variable) == VARIABLES


def test_bash_completes_file_names_where_there_is_nothing_to_choose(tmp_path: Path) -> None:
    script = tmp_path / "syncplan"
    script.write_text("import sys; from syncplan.cli.command_line import main; main(sys.argv[1:])")
    shown = f"{sys.executable} {script} --show-completion; true"
    done = _in_bash(
        f"bash -c '{shown}' > {tmp_path}/shown; . {tmp_path}/shown; complete -p",
        env={**os.environ, "PYTHONPATH": str(Path(command_line.__file__).parents[2])},
    )
    assert done.stdout.strip() == "complete -o default -F _syncplan_completion syncplan"


def test_the_version_is_printed(printed: Any) -> None:
    assert printed("--version").startswith("syncplan ")


HEAVY = ("scipy", "numba", "cvxpy", "networkx")
GUIDANCE = ("syncplan.guidance.flights", "syncplan.planning.pilot_flight")
SERVICE = ("dbos", "fastapi", "httpx2", "psycopg", "sqlalchemy", "starlette", "uvicorn")


@pytest.mark.parametrize(
    ("command", "loads", "others"),
    [
        ("-m syncplan --help", "typer", {"numpy", "pydantic", *HEAVY}),
        (f"-m syncplan plan {GRID} --paper", "numpy", {*GUIDANCE, "cvxpy", "networkx", *SERVICE}),
        (f"-m syncplan plan {GRID}", "numba", {"osqp", "cvxpy", "networkx", *SERVICE}),
        (f"-m syncplan plot {GRID}", "numpy", {"plotly", *SERVICE}),
        (
            f"-m syncplan validate {GRID} --trials 1",
            "numba",
            {"casadi", "syncplan.designs.designer", "syncplan.reports.design_report", *SERVICE},
        ),
        # what computes is loaded by the template of the server's processes
        ("-c 'import api.main, api.server'", "fastapi", {"casadi", "osqp", "plotly", *HEAVY}),
    ],
)
def test_commands_load_no_package_that_they_can_do_without(
    command: str, loads: str, others: set[str]
) -> None:
    done = _in_bash(f"{sys.executable} -X importtime {command}")
    assert done.returncode == 0
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert loads in loaded
    assert not loaded & others


@pytest.mark.parametrize(
    ("command", "reader"),
    [(f"plan {GRID}", "true"), (f"plan {GRID} --format table", "head -1"), ("--help", "head -1")],
)
def test_a_reader_that_leaves_early_is_no_fault(command: str, reader: str) -> None:
    done = _in_bash(f"{SYNCPLAN} {command} | {reader}")
    assert done.returncode == 0
    # the plan's own findings, and no fault
    assert all(line.endswith("ends observability") for line in done.stderr.splitlines())


@pytest.mark.long
def test_a_reader_that_leaves_early_changes_no_verdict() -> None:
    for command, status in (
        (f"plan {BRIDGE} --require-go", 3),
        (f"plan {BRIDGE} --require-go --format table", 3),
        (f"plan {BAD_FILES / 'nan-rate.yaml'} 2>&1", 2),
    ):
        assert _in_bash(f"{SYNCPLAN} {command} | true").returncode == status


def test_a_link_is_followed_and_permissions_are_kept(run: Any, tmp_path: Path) -> None:
    target, link = tmp_path / "target.json", tmp_path / "link.json"
    target.write_text("old")
    target.chmod(0o600)
    link.symlink_to(target)
    assert run("plan", GRID, "-o", str(link))[0] == 0
    assert link.is_symlink()
    assert json.loads(target.read_text())["period_s"] > 31.0
    assert target.stat().st_mode & 0o777 == 0o600


def test_names_are_shown_as_they_are(printed: Any, written: Any) -> None:
    named = {"[red]x[/blue]": [0, 0], "[b]": [70, 0]}
    scenario = written(name="[i]", formation={"centers_m": named})
    assert "[red]x[/blue]-[b]" in printed("plan", scenario, "--format", "table")


def test_a_plan_with_opposite_senses_on_one_circle_is_refused(
    refused: Any, plan_file: Path
) -> None:
    values = json.loads(plan_file.read_text())
    values["vehicles"][1] |= {"center_m": values["vehicles"][0]["center_m"], "direction": "cw"}
    plan_file.write_text(json.dumps(values))
    assert "opposite ways on one circle" in refused("validate", str(plan_file), "--trials", "1")


def test_sigmas_of_wild_size_leave_the_bound_out_and_say_so(run: Any, written: Any) -> None:
    wild = {"position_m": 1e6, "heading_rad": 1e-6}
    sensor = {"range_m": 50, "bearing_sigma_rad": 1e-6}
    scenario = written(
        initial_sigma=wild,
        sensor=sensor,
        landmarks_m=[[-40, 0], [-40, 20]],
        motion={"speed_sigma_mps": 0, "turn_rate_sigma_rad_s": 1000},
    )
    status, out, err = run("plan", scenario)
    assert status == 0
    plan = json.loads(out)
    if plan["predicted_rms_m"]["overall"] is None:
        assert "orders of magnitude" in err
    status, _, err = run("validate", scenario, "--trials", "2")
    assert status in (0, 4)
    assert "internal fault" not in err


@pytest.mark.parametrize(("command", "status"), [("- <&-", 2), (f"{GRID} >&- 2>&-", 0)])
def test_a_closed_stream_is_no_internal_fault(command: str, status: int) -> None:
    done = _in_bash(f"{SYNCPLAN} plan {command}")
    assert done.returncode == status
    assert "internal fault" not in done.stderr
    assert "Traceback" not in done.stderr


def test_large_teams_can_be_swept(run: Any, written: Any) -> None:
    formation = {"shape": "line", "count": 7, "spacing_m": 70}
    scenario = written(formation=formation)
    short = ("--trials", "1", "--duration", "1", "--max-vehicles")
    assert run("sweep", scenario, "--spacing", "70", *short, "7")[0] == 0
    assert run("sweep", scenario, "--spacing", "70", *short, "6")[0] == 2


def test_a_duration_of_endless_periods_is_refused(refused: Any, written: Any) -> None:
    slow = {"range_m": 50, "sample_time_s": 1000}
    scenario = written(sensor=slow, duration_s=2000, window_s=2000)
    err = refused("validate", scenario, "--trials", "1", "--duration", "1e7")
    assert "--duration: 1e+07 s holds more than 20000 periods" in err


def test_rounding_errors_are_shown_as_zero(printed: Any, written: Any) -> None:
    mirror = written(orbit=circling(direction="alternate"))
    shown = printed("plan", mirror, "--format", "table")
    assert " 50, 0 " in shown
    assert "e-1" not in shown


# --- the first line -------------------------------------------------------------------------------


SLOW = ("numba", "casadi", "scipy", "numpy", "rich", "syncplan.planning.planner")

CODE = f"""
import io, os, sys

class Terminal(io.StringIO):
    def isatty(self):
        return True

    def write(self, text):
        loaded = [name for name in {SLOW} if name in sys.modules]
        os.write(1, f"{{text}}{{loaded}}".encode())
        os._exit(0)

sys.stderr = Terminal()
from syncplan.cli.command_line import main
main(sys.argv[1:])
"""


@pytest.mark.parametrize(
    ("command", "run"), [("validate", "trials"), ("fly", "flights"), ("refine", "the search")]
)
def test_a_first_line_comes_before_what_takes_long(command: str, run: str) -> None:
    done = _in_bash(f"{sys.executable} -c {shlex.quote(CODE)} {command} {GRID}")
    assert done.stdout == f"syncplan: reading {GRID}, preparing {run} ...\n[]"


def test_a_pipe_gets_no_such_line(run: Any) -> None:
    _, _, err = run("validate", GRID, "--trials", "1", "--duration", "2")
    assert "preparing" not in err
