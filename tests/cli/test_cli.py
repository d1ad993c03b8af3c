"""The command line as a user meets it: streams, exit codes, files left behind."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args

import pytest

from syncplan.cli import command_line
from syncplan.cli.plan_commands import VARIABLES
from syncplan.errors import InputError
from syncplan.estimation.lane_filter import LaneFilter
from syncplan.exporting.format_table import ALL, FORMATS
from syncplan.plotting.figure_table import FIGURES
from syncplan.scenario.loading import load_scenario
from syncplan.scenario.models import Variable
from syncplan.scenario.objectives import OBJECTIVES
from tests.tools.processes import PATIENCE_S, wait_until, worked
from tests.tools.scenarios import BAD_FILES, FILES, document

GRID = str(FILES / "paper-grid-same.yaml")
BRIDGE = str(FILES / "landmark-bridge.yaml")


def _process(*arguments: str, stdin: str | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "syncplan", *arguments],
        input=stdin,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )


def test_plan_writes_json_to_standard_output_and_nothing_else(run: Any) -> None:
    status, out, err = run("plan", GRID)
    assert status == 0
    plan = json.loads(out)
    assert err.splitlines() == [f"syncplan: {note}" for note in plan["notes"]]
    assert plan["observability"]["rank"] == 18
    assert [v["name"] for v in plan["vehicles"]] == [f"v{k}" for k in range(1, 7)]
    assert plan["vehicles"][0]["phase_rad"] == 0.3
    assert plan["scenario"]["formation"]["centers_m"][1] == [70.0, 0.0]


def test_the_plan_has_every_field_of_the_contract(run: Any) -> None:
    _, out, _ = run("plan", GRID)
    plan = json.loads(out)
    assert {
        "scenario",
        "period_s",
        "vehicles",
        "links",
        "landmark_links",
        "incidental_links",
        "dropped_links",
        "connectivity_period_s",
        "separation",
        "observability",
        "witness",
        "predicted_rms_m",
    } <= set(plan)
    assert {
        "a",
        "b",
        "rule",
        "phase_residual_rad",
        "min_distance_m",
        "contact_s",
        "windows_s",
        "directed",
        "phase_tolerance_rad",
        "rank",
        "certified",
        "reason",
    } <= set(plan["links"][0])
    assert {"from", "to", "windows_s", "contact_s"} == set(plan["links"][0]["directed"][0])
    assert {"vehicle", "landmark", "min_distance_m", "windows_s", "contact_s", "rank"} <= set(
        plan["landmark_links"][0]
    )
    assert {"rank", "state_dim", "observable", "certificate", "condition_number"} <= set(
        plan["observability"]
    )
    for link in plan["links"]:
        for start, end in link["windows_s"]:
            assert 0.0 <= start < plan["period_s"]
            assert end > start


def test_a_plan_file_and_its_scenario_validate_to_the_same_bytes(run: Any, tmp_path: Path) -> None:
    plan, one, two = (str(tmp_path / name) for name in ("plan.json", "one.json", "two.json"))
    assert run("plan", GRID, "-o", plan)[0] == 0
    short = ("--trials", "8", "--seed", "3", "--duration", "20")
    assert run("validate", plan, *short, "-o", one)[0] == 0
    assert run("validate", GRID, *short, "-o", two)[0] == 0
    assert Path(one).read_bytes() == Path(two).read_bytes()
    report = json.loads(Path(one).read_text())
    assert (report["trials"], report["seed"], report["duration_s"]) == (8, 3, 20.0)
    assert {"rms_m", "rms_second_half_m", "rms_x_m", "final_error_m", "coverage_3sigma"} <= set(
        report["vehicles"][0]
    )
    assert {"value", "band", "verdict"} <= set(report["anees"])


def test_the_number_of_threads_does_not_change_a_byte(run: Any) -> None:
    short = ("validate", GRID, "--trials", "40", "--duration", "10", "--series")
    one = run(*short, "--threads", "1")[1]
    assert one == run(*short, "--threads", "2")[1]
    assert one != run(*short, "--seed", "1")[1]


def test_a_dash_reads_standard_input() -> None:
    done = _process("plan", "-", stdin=json.dumps(document()))
    assert done.returncode == 0
    assert json.loads(done.stdout)["observability"]["state_dim"] == 6


def test_with_a_file_standard_output_stays_empty(run: Any, tmp_path: Path) -> None:
    target = tmp_path / "plan.json"
    status, out, err = run("plan", GRID, "-o", str(target))
    assert (status, out) == (0, "")
    assert "wrote" in err
    assert json.loads(target.read_text())["period_s"] > 31.0
    assert [path.name for path in tmp_path.iterdir()] == ["plan.json"]


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


@pytest.mark.parametrize("path", sorted(BAD_FILES.iterdir()), ids=lambda path: path.stem)
@pytest.mark.parametrize("command", ["plan", "validate"])
def test_bad_files_exit_with_2_and_a_line_for_each_fault(
    command: str, path: Path, refused: Any
) -> None:
    err = refused(command, str(path))
    with pytest.raises(InputError) as caught:
        load_scenario(path)
    lines = err.splitlines()
    assert len(lines) == len(caught.value.faults)
    for line, one in zip(lines, caught.value.faults, strict=True):
        assert line.startswith(f"syncplan: {path}: {one.key}")
        assert one.problem in line
        assert "more" not in line
    assert "Traceback" not in err


@pytest.mark.parametrize(("wrong", "counted"), [(1, None), (10, None), (11, 1), (16, 6), (30, 20)])
def test_of_many_faults_ten_are_listed_and_the_rest_is_counted(
    wrong: int, counted: int | None, refused: Any, written: Any
) -> None:
    path = written(landmarks_m=[["x", k] for k in range(wrong)])
    err = refused("plan", path)
    lines = [line.removeprefix(f"syncplan: {path}: ") for line in err.splitlines()]
    assert lines[:10] == [
        f"landmarks_m[{k}][0]: 'x': must be a valid number" for k in range(min(wrong, 10))
    ]
    assert lines[10:] == ([] if counted is None else [f"and {counted} more"])


def test_of_faults_of_options_each_is_named_by_its_option(refused: Any) -> None:
    err = refused("refine", GRID, "--starts", "0", "--time-limit-s", "-1")
    assert sorted(line.split(": ")[1] for line in err.splitlines()) == [
        "--starts",
        "--time-limit-s",
    ]


@pytest.mark.parametrize(
    ("arguments", "reported"),
    [
        (("plan",), "SCENARIO"),
        (("plan", "none.yaml"), "none.yaml"),
        (("plan", GRID, "-o", "/nowhere/plan.json"), "/nowhere/plan.json"),
        (("plan", GRID, "-o", "/"), "directory"),
        (("plan", GRID, "--bound", "sometimes"), "sometimes"),
        (("plan", GRID, "--max-vehicles", "3"), "--max-vehicles"),
        (("validate", GRID, "--trials", "0"), "trials"),
        (("validate", GRID, "--trials", "many"), "many"),
        (("validate", GRID, "--seed", "-1"), "seed"),
        (("validate", GRID, "--duration", "0"), "duration"),
        (("validate", GRID, "--duration", "nan"), "duration"),
        (("validate", GRID, "--duration", "1e8"), "samples for 6 vehicles"),
        (("validate", GRID, "--gate", "2"), "gate"),
        (("validate", GRID, "--threads", "0"), "threads"),
        (("validate", GRID, "--model", "euler", "--substeps", "0"), "substeps"),
        (("sweep", GRID), "--angular-rate"),
        (("sweep", GRID, "--range", "50", "--radius", "20"), "exactly one"),
        (("sweep", GRID, "--range", "fifty"), "fifty"),
        (("sweep", GRID, "--key", "sensor.range_sigma_m"), "--values"),
        (("sweep", GRID, "--key", "wind.sigma", "--values", "1"), "did you mean wind.sigma_mps"),
        (("sweep", GRID, "--key", "wind.sigma_mps", "--values", "-1"), "wind.sigma_mps"),
        (("sweep", GRID, "--range", "-1"), "sensor.range_m"),
        (("sweep", GRID, "--range", "nan"), "sensor.range_m"),
        (("sweep", GRID, "--spacing", "70"), "spacing"),
        (("nonsense",), "nonsense"),
        (("plan", GRID, "--nonsense"), "nonsense"),
    ],
)
def test_bad_arguments_exit_with_2_and_one_line(
    arguments: tuple[str, ...], reported: str, refused: Any
) -> None:
    err = refused(*arguments)
    assert reported in err
    assert err.count("\n") == 1


def test_placing_a_plan_says_that_it_is_one(run: Any, refused: Any, tmp_path: Path) -> None:
    plan = str(tmp_path / "plan.json")
    run("plan", GRID, "-o", plan)
    assert "is already a plan" in refused("place", plan)


def test_a_failed_write_keeps_what_was_there(refused: Any, tmp_path: Path) -> None:
    target = tmp_path / "plan.json"
    target.write_text("precious")
    refused("plan", str(BAD_FILES / "nan-rate.yaml"), "-o", str(target))
    assert target.read_text() == "precious"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this machine")
def test_a_full_disk_is_one_clear_line() -> None:
    done = _process("plan", GRID, "-o", "/dev/full")
    assert done.returncode == 2
    assert "No space left" in done.stderr
    assert "Traceback" not in done.stderr


def test_plans_with_vehicles_that_do_not_fit_are_refused(
    run: Any, refused: Any, tmp_path: Path
) -> None:
    plan = tmp_path / "plan.json"
    run("plan", GRID, "-o", str(plan))
    values = json.loads(plan.read_text())
    values["vehicles"][0]["phase_rad"] = "east"
    plan.write_text(json.dumps(values))
    assert "vehicles[0].phase_rad" in refused("validate", str(plan), "--trials", "1")
    del values["vehicles"][0]
    plan.write_text(json.dumps(values))
    assert "vehicles" in refused("validate", str(plan), "--trials", "1")


def test_an_interrupted_run_leaves_nothing_half_written(tmp_path: Path) -> None:
    target = tmp_path / "report.json"
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    long = ("validate", GRID, "--trials", "900000")
    with subprocess.Popen(
        [sys.executable, "-m", "syncplan", *long, "-o", str(target)],
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        # a parent that ignores interrupts would hand that down
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:
        # it has begun to compute: to start takes less
        wait_until(lambda: worked(process.pid) > 6.0)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert "interrupted" in err
    assert "Traceback" not in err
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
    assert [row["value"] for row in rows] == [0.2, 1.0, 1.0]
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
    monkeypatch.setattr("syncplan.planning.variations.validate", unready)
    short = ("--trials", "1", "--duration", "2")
    varied = (str(FILES / "biased-grid.yaml"), "--key", "formation.count", "--values")
    _, _, said = run("sweep", *varied, "6", *short)
    assert "compiling" not in said
    assert asked == [6]
    _, _, said = run("sweep", *varied, "6,7", *short)
    assert said.count("compiling") == 1


@pytest.mark.parametrize("contract", ["scenario", "plan", "sites", "validation", "replay", "sync"])
def test_schemas_are_json_schema(contract: str, printed: Any) -> None:
    schema = json.loads(printed("schema", contract))
    assert schema["type"] == "object"
    assert schema["properties"]


COMMANDS = [
    str(command.name)
    for each in command_line.app.registered_groups
    for command in getattr(each.typer_instance, "registered_commands", [])
]


def test_all_commands_are_known_here() -> None:
    assert {"plan", "validate", "landmarks", "export", "serve", "schema"} <= set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example(command: str, printed: Any) -> None:
    out = printed(command, "--help")
    (example,) = re.findall(r"Example: .*?(?=Example:|$)", " ".join(out.split()))[:1]
    assert f"syncplan {command}" in example


def _completed(words: str) -> list[str]:
    """What bash would offer after these words."""
    script = (
        "import sys; sys.argv = ['syncplan']; from syncplan.cli.command_line import main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={
            **os.environ,
            "_SYNCPLAN_COMPLETE": "complete_bash",
            "COMP_WORDS": words,
            "COMP_CWORD": str(words.count(" ")),
        },
        capture_output=True,
        text=True,
        check=True,
        timeout=PATIENCE_S,
    )
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.long
def test_a_shell_completes_what_can_be_chosen_by_name() -> None:
    assert _completed("syncplan pla") == ["plan", "place"]
    assert _completed("syncplan export --format ") == [*FORMATS, ALL]
    assert _completed("syncplan refine --objective ") == list(OBJECTIVES)
    assert _completed("syncplan refine --vary phases,") == ["phases,centers", "phases,radii"]
    assert _completed("syncplan plot --figure t") == [k for k in FIGURES if k.startswith("t")]
    assert _completed("syncplan plan sc") == []
    assert get_args(Variable) == VARIABLES


def test_bash_completes_file_names_where_there_is_nothing_to_choose(tmp_path: Path) -> None:
    script = tmp_path / "syncplan"
    script.write_text("import sys; from syncplan.cli.command_line import main; main(sys.argv[1:])")
    shown = f"{sys.executable} {script} --show-completion; true"
    done = subprocess.run(
        ["bash", "-c", f"bash -c '{shown}' > {tmp_path}/shown; . {tmp_path}/shown; complete -p"],
        env={**os.environ, "PYTHONPATH": str(Path(command_line.__file__).parents[2])},
        capture_output=True,
        text=True,
        check=True,
        timeout=PATIENCE_S,
    )
    assert done.stdout.strip() == "complete -o default -F _syncplan_completion syncplan"


def test_the_version_is_printed(printed: Any) -> None:
    assert printed("--version").startswith("syncplan ")


def test_help_loads_no_heavy_package() -> None:
    script = (
        "import sys\n"
        "from syncplan.cli import command_line\n"
        "try:\n    command_line.main(['--help'])\n"
        "except SystemExit:\n    pass\n"
        "heavy = {'numpy', 'scipy', 'numba', 'cvxpy', 'networkx'} & set(sys.modules)\n"
        "sys.exit(str(heavy) if heavy else 0)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def _piped(command: str, reader: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["bash", "-c", f"set -o pipefail; {sys.executable} -m syncplan {command} | {reader}"],
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )


@pytest.mark.parametrize(
    ("command", "reader"),
    [
        (f"plan {GRID}", "true"),
        (f"plan {GRID} --format table", "head -1"),
        (f"plot {GRID} --figure spectrum 2> /dev/null", "head -1"),
        ("--help", "head -1"),
        ("schema", "true"),
    ],
)
def test_a_reader_that_leaves_early_is_no_fault(command: str, reader: str) -> None:
    done = _piped(command, reader)
    assert done.returncode == 0
    # the plan's own findings, and no fault
    assert all(line.endswith("ends observability") for line in done.stderr.splitlines())


@pytest.mark.long
def test_a_reader_that_leaves_early_changes_no_verdict() -> None:
    assert _piped(f"plan {BRIDGE} --require-go", "true").returncode == 3
    assert _piped(f"plan {BRIDGE} --require-go --format table", "true").returncode == 3
    assert _piped(f"plan {BAD_FILES / 'nan-rate.yaml'} 2>&1", "true").returncode == 2


def test_a_link_is_followed_and_permissions_are_kept(run: Any, tmp_path: Path) -> None:
    target, link = tmp_path / "target.json", tmp_path / "link.json"
    target.write_text("old")
    target.chmod(0o600)
    link.symlink_to(target)
    assert run("plan", GRID, "-o", str(link))[0] == 0
    assert link.is_symlink()
    assert json.loads(target.read_text())["period_s"] > 31.0
    assert target.stat().st_mode & 0o777 == 0o600


def test_the_file_that_is_read_is_not_written_over(refused: Any, written: Any) -> None:
    scenario = written()
    assert "is the file that is read" in refused("plan", scenario, "-o", scenario)
    assert json.loads(Path(scenario).read_text()) == document()


@pytest.mark.parametrize("name", ["x" * 300, "a/" * 200 + "b"])
def test_impossible_output_names_are_one_clear_line(
    name: str, refused: Any, tmp_path: Path
) -> None:
    assert refused("plan", GRID, "-o", str(tmp_path / name)).count("\n") == 1


def test_a_dash_writes_to_standard_output(printed: Any) -> None:
    assert json.loads(printed("plan", GRID, "-o", "-"))["period_s"] > 31.0


def test_names_are_shown_as_they_are(printed: Any, written: Any) -> None:
    named = {"[red]x[/blue]": [0, 0], "[b]": [70, 0]}
    scenario = written(name="[i]", formation={"centers_m": named})
    assert "[red]x[/blue]-[b]" in printed("plan", scenario, "--format", "table")


def test_a_plan_with_opposite_senses_on_one_circle_is_refused(
    run: Any, refused: Any, tmp_path: Path
) -> None:
    plan = tmp_path / "plan.json"
    run("plan", GRID, "-o", str(plan))
    values = json.loads(plan.read_text())
    values["vehicles"][1] |= {"center_m": values["vehicles"][0]["center_m"], "direction": "cw"}
    plan.write_text(json.dumps(values))
    assert "opposite ways on one circle" in refused("validate", str(plan), "--trials", "1")


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


@pytest.mark.parametrize("stream", ["<&-", ">&-", "2>&-"])
def test_a_closed_stream_is_no_internal_fault(stream: str) -> None:
    source = "-" if stream == "<&-" else GRID
    command = f"{sys.executable} -m syncplan plan {source} {stream}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert done.returncode == (2 if stream == "<&-" else 0)
    assert "internal fault" not in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this machine")
def test_a_full_standard_output_is_one_clear_line() -> None:
    command = f"{sys.executable} -m syncplan plan {GRID} > /dev/full"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "No space left" in done.stderr


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


def test_rounding_errors_are_shown_as_zero(tmp_path: Path, printed: Any) -> None:
    scenario = tmp_path / "mirror.yaml"
    scenario.write_text(
        "orbit: {radius_m: 20, angular_rate_rad_s: 0.2, direction: alternate}\n"
        "formation: {centers_m: [[0, 0], [70, 0]]}\nsensor: {range_m: 50}\n"
    )
    shown = printed("plan", str(scenario), "--format", "table")
    assert " 50, 0 " in shown
    assert "e-1" not in shown
