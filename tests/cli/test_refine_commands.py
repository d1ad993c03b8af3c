"""Refine, place and landmarks as a user meets them: streams, exit codes, files left behind."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from syncplan.cli import command_line
from syncplan.scenario.bounded_yaml import load_yaml
from syncplan.scenario.loading import load_scenario, with_landmarks
from syncplan.terms import TERMS
from tests.tools.processes import PATIENCE_S
from tests.tools.scenarios import FILES

GRID = str(FILES / "paper-grid-same.yaml")
ALTERNATE = str(FILES / "paper-grid-alternate.yaml")
QUICK = ("--starts", "1", "--objective", "logdet")
LANDMARKS = [[-40.0, 0.0], [-30.0, 20.0]]

COUNTING = f"""
import contextlib, sys
from syncplan.cli import command_line, console

@contextlib.contextmanager
def counting():
    yield lambda start, *others: start > 2 and print("on", file=sys.stderr, flush=True)

console.search_progress = counting
command_line.main(["refine", {GRID!r}, *sys.argv[1:]])
"""
"""A refinement that says on standard error that its fourth start is at work."""


def test_refine_returns_a_better_plan_with_its_record(run: Any) -> None:
    status, out, err = run("refine", ALTERNATE, *QUICK, "--center-box-m", "2")
    assert status == 0
    plan = json.loads(out)
    assert err.splitlines() == [f"syncplan: {note}" for note in plan["notes"]]
    record = plan["refinement"]
    assert record["improved"]
    assert (record["before"]["rank"], record["after"]["rank"]) == (16, 18)
    assert plan["observability"]["certificate"]["holds"]
    assert record["starts"][0]["status"] == "Solve_Succeeded"
    assert record["starts"][0]["iterations"] > 3
    assert any(label.startswith("box of") for label in record["active_constraints"])
    assert plan["scenario"]["formation"]["links"][0] == ["v1", "v2"]
    # centres stay in their box, and so does the first phase
    before = json.loads(run("plan", ALTERNATE)[1])["vehicles"]
    for one, other in zip(before, plan["vehicles"], strict=True):
        for axis in (0, 1):
            assert abs(one["center_m"][axis] - other["center_m"][axis]) <= 2.0 + 1e-9
    assert plan["vehicles"][0]["phase_rad"] == pytest.approx(before[0]["phase_rad"])


def test_the_table_of_a_refinement_shows_what_it_costs_and_explains_itself(
    run: Any, tmp_path: Path
) -> None:
    plans = {"after": tmp_path / "after.json", "before": tmp_path / "before.json"}
    asked = ("--paper", "--format", "table", "-o")
    status, out, _ = run("refine", ALTERNATE, *QUICK, *asked, str(plans["after"]))
    assert status == 0
    assert run("plan", ALTERNATE, "--paper", "-o", str(plans["before"]))[0] == 0
    shown: dict[str, list[str]] = {"meetings a period": [], "least phase tolerance, rad": []}
    shown |= {"closest approach, widest meeting, m": [], "least separation, m": []}
    for side in ("before", "after"):
        plan = json.loads(plans[side].read_text())
        links = plan["links"]
        values = (
            len(links) + len(plan["incidental_links"]),
            min(link["phase_tolerance_rad"] for link in links),
            max(link["min_distance_m"] for link in links),
            plan["separation"]["min_m"],
        )
        for label, value in zip(shown, values, strict=True):
            shown[label].append(f"{value:.4g}")
    rows = {line[:38].strip(): line[38:].split() for line in out.splitlines()}
    assert {label: rows[label] for label in shown} == shown
    assert shown["least phase tolerance, rad"][0] != shown["least phase tolerance, rad"][1]
    assert "limits reached (box: how far a centre may move): box of v1" in out
    explained = out.splitlines()
    for term in ("window bound", "unlisted"):
        assert any(line.startswith(f"{term}: {TERMS[term].meaning[:40]}") for line in explained)


@pytest.mark.long
def test_a_refined_plan_can_be_validated_and_refined_again(
    run: Any, printed: Any, tmp_path: Path
) -> None:
    better = tmp_path / "better.json"
    assert run("refine", GRID, *QUICK, "-o", str(better))[0] == 0
    assert json.loads(printed("validate", str(better), "--trials", "5"))["observable"]
    first = json.loads(better.read_text())["refinement"]["after"]
    again = run("refine", str(better), *QUICK)[1]
    assert json.loads(again)["refinement"]["before"]["logdet"] == pytest.approx(first["logdet"])


def test_plan_with_refine_gives_what_refine_gives(run: Any, written: Any) -> None:
    scenario = json.loads(run("plan", GRID)[1])["scenario"]
    search = {"starts": 1, "objective": "logdet"}
    path = written(**scenario, refine=search)
    assert run("plan", path, "--refine")[1] == run("refine", path)[1]


def test_what_can_not_be_bettered_comes_back_with_the_reason_and_is_not_written(
    run: Any, tmp_path: Path
) -> None:
    short = ("--time-limit-s", "0.001", "--starts", "1")
    status, out, err = run("refine", GRID, *short)
    assert status == 4
    plan = json.loads(out)
    assert not plan["refinement"]["improved"]
    assert plan["refinement"]["reason"] in err
    assert plan["vehicles"] == json.loads(run("plan", GRID)[1])["vehicles"]
    output = tmp_path / "kept.json"
    output.write_text("kept")
    status, out, err = run("refine", GRID, *short, "-o", str(output))
    assert (status, out) == (4, "")
    assert "was not written" in err
    assert output.read_text() == "kept"


@pytest.mark.long
def test_interrupting_a_refinement_writes_the_best_so_far(tmp_path: Path) -> None:
    output = tmp_path / "best.json"
    starts = ("--starts", "200", "--time-limit-s", "500", "--objective", "logdet")
    with subprocess.Popen(
        [sys.executable, "-c", COUNTING, *starts, "--processes", "2", "-o", str(output)],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stderr is not None
        # of two at a time: others have ended
        assert process.stderr.readline() == "on\n"
        assert process.poll() is None
        os.killpg(process.pid, signal.SIGINT)
        reported = process.communicate(timeout=PATIENCE_S)[1]
    assert process.returncode == 0, reported
    record = json.loads(output.read_text())["refinement"]
    assert record["cut_short"]
    assert record["improved"]
    assert "cut short" in reported
    assert list(tmp_path.iterdir()) == [output]


def test_place_gives_a_scenario_that_plan_takes(run: Any, written: Any, tmp_path: Path) -> None:
    links = [["v1", "v2"], ["v2", "v3"], ["v3", "v1"]]
    placed = tmp_path / "placed.json"
    scenario = written(formation={"links": links}, landmarks_m=LANDMARKS)
    assert run("place", scenario, "-o", str(placed))[0] == 0
    formation = json.loads(placed.read_text())["formation"]
    assert len(formation["centers_m"]) == 3
    assert formation["links"] == links
    first = json.loads(run("plan", str(placed))[1])
    assert len(first["links"]) == 3
    assert json.loads(run("plan", scenario)[1])["vehicles"] == first["vehicles"]


@pytest.mark.long
def test_children_take_modules_from_where_their_parent_does(tmp_path: Path) -> None:
    """A file named like a standard module in the working directory is none of theirs."""
    (tmp_path / "queue.py").write_text("raise RuntimeError('not this one')")
    arguments = ["refine", GRID, "--starts", "2", "--processes", "2", "--objective", "logdet"]
    program = f"import syncplan.cli.command_line; syncplan.cli.command_line.main({arguments!r})"
    done = subprocess.run(
        [sys.executable, "-P", "-c", program],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(command_line.__file__).parents[2])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["refinement"]["improved"]


@pytest.mark.long
def test_links_that_meet_outside_the_window_are_kept_too(run: Any, written: Any) -> None:
    scenario = written(
        formation={
            "centers_m": [[0, 0], [80, 0], [40, -69]],
            "links": [["v1", "v2"], ["v2", "v3"]],
        },
        landmarks_m=[[-40, 0], [-30, 40], [10, 40]],
        duration_s=60,
        window_s=2.0,
        refine={"starts": 1, "center_box_m": 40.0},
    )
    status, out, _ = run("refine", scenario)
    assert status in (0, 4)
    assert [(link["a"], link["b"]) for link in json.loads(out)["links"]][:2] == [
        ("v1", "v2"),
        ("v2", "v3"),
    ]


@pytest.mark.long
def test_an_option_overrides_what_the_scenario_says_of_what_no_longer_varies(
    run: Any, written: Any
) -> None:
    scenario = written(refine={"center_box_m": 3.0}, landmarks_m=LANDMARKS)
    before = json.loads(run("plan", scenario)[1])["vehicles"]
    status, out, _ = run("refine", scenario, *QUICK, "--vary", "phases")
    assert status in (0, 4)
    after = json.loads(out)["vehicles"]
    assert [one["center_m"] for one in after] == [one["center_m"] for one in before]


@pytest.mark.long
def test_refining_keeps_what_was_asked_of_the_plan(run: Any, written: Any) -> None:
    scenario = json.loads(run("plan", GRID)[1])["scenario"]
    path = written(**scenario, refine={"starts": 1, "objective": "logdet"})
    plan = json.loads(run("plan", path, "--refine", "--steady", "--bound", "never")[1])
    assert plan["refinement"]["improved"]
    assert plan["steady_rms_m"]["overall"] > 0.5
    assert plan["predicted_rms_m"]["overall"] is None


# --- landmarks ------------------------------------------------------------------------------------


SCENARIO = """# a survey of the harbour
name: "survey"   # quoted, as it was
sensor: {range_m: 50, bearing_sigma_rad: 0.1}
orbit:
  radius_m: 20.0 # metres
  angular_rate_rad_s: 2e-1
formation: {centers_m: [[0, 0], [70, 0]]}
landmarks_m: [[20, 45]]
duration_s: 20
"""
SITES = "near: [30, 35]\nfar: [300, 35]\nwest: [-40.5, 0]\n"


@pytest.fixture
def survey(tmp_path: Path) -> Path:
    """A scenario with comments, and candidates beside it."""
    (tmp_path / "sites.yaml").write_text(SITES)
    path = tmp_path / "survey.yaml"
    path.write_text(SCENARIO)
    return path


def chosen(run: Any, subject: Path, target: Path) -> dict[str, Any]:
    """The report of the choice of two sites, written beside the scenario with them."""
    report = target.with_suffix(".report")
    sites = str(subject.with_name("sites.yaml"))
    options = ("--candidates", sites, "--choose", "2", "-o", str(report))
    status, _, err = run("landmarks", str(subject), *options, "--scenario-out", str(target))
    assert status == 0, err
    assert f"wrote {target}" in err
    found: dict[str, Any] = json.loads(report.read_text())
    return found


def test_all_else_of_the_file_stays_as_it_was_written(
    run: Any, survey: Path, tmp_path: Path
) -> None:
    target = tmp_path / "chosen.yaml"
    report = chosen(run, survey, target)
    before, after = SCENARIO.splitlines(), target.read_text().splitlines()
    at = before.index("landmarks_m: [[20, 45]]")
    assert after[:at] == before[:at]
    assert after[at : at + 2] == ["landmarks_m:", "  L1: [20, 45]"]
    assert after[-1] == before[-1]
    assert {line.split(":")[0].strip() for line in after[at + 2 : at + 4]} == set(report["chosen"])


@pytest.mark.parametrize("ending", [".json", ".yaml"])
def test_a_file_of_either_kind_is_written_from_either_kind(
    run: Any, written: Any, tmp_path: Path, ending: str
) -> None:
    (tmp_path / "sites.yaml").write_text(SITES)
    target = tmp_path / f"chosen{ending}"
    subject = Path(written(landmarks_m={"mast": [20, 45]}, duration_s=20))
    report = chosen(run, subject, target)
    scenario = load_scenario(target)
    assert set(scenario.landmark_names) == {"mast", *report["chosen"]}
    landmarks = json.loads(scenario.model_dump_json())["landmarks_m"]
    assert landmarks == report["plan"]["scenario"]["landmarks_m"]
    assert scenario.orbit == load_scenario(subject).orbit
    plan = tmp_path / "plan.json"
    assert run("plan", str(subject), "-o", str(plan))[0] == 0
    chosen(run, plan, target)
    assert load_scenario(target).landmarks_m == scenario.landmarks_m


def test_centres_that_were_found_are_written_with_the_landmarks(
    run: Any, written: Any, tmp_path: Path
) -> None:
    (tmp_path / "sites.yaml").write_text("a: [5, 30]\nb: [30, 5]\nc: [60, 60]\n")
    target = tmp_path / "chosen.yaml"
    area = [[-30, -30], [90, -30], [90, 90], [-30, 90]]
    links = written(formation={"links": [["v1", "v2"]]}, area_m=area, duration_s=20)
    report = chosen(run, Path(links), target)
    stated = [[*one["center_m"]] for one in report["plan"]["vehicles"]]
    assert [[*place] for place in load_scenario(target).centers] == stated


def test_the_candidates_are_not_written_over(refused: Any, survey: Path) -> None:
    sites = str(survey.with_name("sites.yaml"))
    options = ("--candidates", sites, "--choose", "1", "--scenario-out", sites)
    assert "is the file that is read" in refused("landmarks", str(survey), *options)
    assert Path(sites).read_text() == SITES


def test_a_team_given_by_a_shape_is_written_however_short_its_text() -> None:
    shape = "{shape: grid, count: 5000, spacing_m: 70}"
    text = SCENARIO.replace("{centers_m: [[0, 0], [70, 0]]}", shape)
    edited = with_landmarks(text, "survey.yaml", {"L1": (20.0, 45.0)})
    assert load_yaml(edited)["formation"]["count"] == 5000
