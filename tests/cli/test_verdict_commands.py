"""The verdict at the command line: what it says first, and whether it counts."""

import html
import json
import re
from pathlib import Path
from typing import Any

import pytest

from tests.tools.scenarios import FILES

HARD = Path(__file__).parents[1] / "data" / "hard"
GRAZING = HARD / "grazing-landmark.json"

GRID = str(FILES / "paper-grid-same.yaml")
ALTERNATE = str(FILES / "paper-grid-alternate.yaml")


@pytest.mark.parametrize(
    "command", [("plan",), ("validate", "--trials", "2")], ids=lambda command: command[0]
)
def test_the_first_line_is_the_verdict(run: Any, printed: Any, command: tuple[str, ...]) -> None:
    name, *options = command
    go = "GO in 31 simulated flights" if name == "plan" else "GO on paper: not flown"
    for source, line in ((GRID, go), (ALTERNATE, "NO-GO: 2 reasons")):
        assert printed(name, source, *options, "--format", "table").splitlines()[0] == line
    status, _, err = run(name, ALTERNATE, *options, "--require-go", "--format", "json")
    assert status == 3
    assert "NO-GO: 2 reasons: unobservable (--require-go)" in err
    assert run(name, GRID, *options, "--require-go")[0] == 0


def test_a_validation_that_stops_a_plan_exits_with_3(run: Any) -> None:
    weak = str(HARD / "weak-desync.yaml")
    assert run("plan", weak, "--paper", "--require-go")[0] == 0
    status, out, err = run("validate", weak, "--trials", "20", "--require-go")
    assert status == 3
    assert "NO-GO: 1 reason: error-above-prediction (--require-go)" in err
    assert not json.loads(out)["verdict"]["go"]


def test_plot_says_the_verdict_first_and_its_page_shows_it(run: Any, tmp_path: Path) -> None:
    plan, page, report = (tmp_path / name for name in ("plan.json", "page.html", "report.json"))
    assert run("plan", ALTERNATE, "-o", str(plan))[0] == 0
    status, _, err = run("plot", str(plan), "--figure", "spectrum", "-o", str(page))
    assert status == 0
    assert err.splitlines()[0] == "syncplan: NO-GO: 2 reasons: unobservable"
    head = page.read_text().partition("<nav")[0]
    assert "<strong>NO-GO: 2 reasons</strong>" in head
    for one in json.loads(plan.read_text())["verdict"]["findings"]:
        assert html.escape(one["message"]) in head
    assert run("validate", str(plan), "--trials", "2", "-o", str(report))[0] == 0
    assert run("plot", str(report))[2].splitlines()[0] == err.splitlines()[0]
    _, out, err = run("plot", GRID, "--figure", "spectrum")
    assert err == "syncplan: GO on paper: not flown\n"
    assert "<strong>GO on paper: not flown</strong>" in out
    assert "<strong>Note, single point of failure</strong>" in out
    assert "<strong>Stop" not in out
    _, out, err = run("plot", str(plan), "--compare", GRID, "--figure", "comparison")
    assert err.splitlines() == [
        "syncplan: before: NO-GO: 2 reasons: unobservable",
        "syncplan: after: GO on paper: not flown",
    ]
    assert "<strong>after: GO on paper: not flown</strong>" in out


def test_what_is_observable_and_collides_is_no_go(run: Any, written: Any) -> None:
    scenario = written(landmarks_m=[[20.5, 0.0], [70.0, 60.0], [0.0, 60.0]])
    status, out, err = run("plan", scenario, "--require-observable", "--require-go")
    assert status == 3
    assert "NO-GO: 1 reason: landmark-too-close (--require-go)" in err
    assert "--require-observable" not in err
    assert json.loads(out)["observability"]["observable"]


def test_findings_are_the_same_word_for_word_wherever_they_stand(
    run: Any, written: Any, tmp_path: Path
) -> None:
    plan, report, folder = tmp_path / "plan.json", tmp_path / "report.json", tmp_path / "files"
    star = {"links": [["v1", f"v{k}"] for k in range(2, 5)]}
    placed = written(formation=star, landmarks_m=[[60.0, 0.0], [0.0, 60.0]])
    # how the plan was found as well
    for source, code in ((ALTERNATE, "unobservable"), (placed, "centres-placed")):
        assert run("plan", source, "-o", str(plan))[0] == 0
        assert run("validate", str(plan), "--trials", "2", "-o", str(report))[0] == 0
        assert run("export", str(plan), "--format", "csv", "-o", str(folder), "--force")[0] == 0
        (sidecar,) = folder.glob("*.sync.json")
        first, *others = (json.loads(one.read_text())["verdict"] for one in (plan, report, sidecar))
        assert code in {one["code"] for one in first["findings"]}
        assert others == [first, first]
        sidecar.unlink()


def test_an_export_that_is_refused_writes_nothing(run: Any, tmp_path: Path) -> None:
    target = tmp_path / "files"
    status, out, err = run("export", ALTERNATE, "--format", "csv", "-o", str(target))
    assert (status, out, err.count("\n")) == (3, "", 1)
    assert err.startswith("syncplan: NO-GO: 2 reasons; unobservable: no sighting can detect")
    assert "--force" in err
    assert not target.exists()


def test_a_plan_file_is_judged_again_with_its_own_orbits(printed: Any, plan_file: Path) -> None:
    assert printed("plan", str(plan_file)) == plan_file.read_text()


def test_calm_examples_carry_no_warning_of_wind_or_room(printed: Any) -> None:
    for name in ("paper-grid-same", "windy-grid", "triangle-lattice"):
        found = json.loads(printed("plan", str(FILES / f"{name}.yaml")))["verdict"]["findings"]
        assert [one["code"] for one in found if one["level"] == "warning"] == []


def test_a_meeting_that_nobody_needs_warns_with_its_cost(printed: Any) -> None:
    options = ("--dropout", "0.2", "--trials", "8", "--seed", "3", "--threads", "1")
    verdict = json.loads(printed("fly", str(GRAZING), *options, "--require-go"))["verdict"]
    assert verdict["go"]
    (finding,) = (each for each in verdict["findings"] if each["code"] == "meetings-missed")
    assert finding["level"] == "warning"
    words = (
        r"v2-L2 keeps [45]\d(\.\d)? %; without v2-L2 the team is observable still, predicted RMS 1"
    )
    assert re.search(words, finding["message"])


def test_a_bearing_sigma_in_degrees_is_no_go(run: Any) -> None:
    status, out, err = run("plan", str(HARD / "degrees.yaml"), "--bound", "never", "--require-go")
    assert status == 3
    assert "NO-GO: 1 reason: angle-sigma-large (--require-go)" in err
    assert "sensor.bearing_sigma_rad is 2 in radians; were degrees meant?" in " ".join(out.split())


def test_a_run_that_is_too_short_is_no_go_and_states_the_run_needed(run: Any) -> None:
    status, out, err = run("plan", str(HARD / "short-run.yaml"), "--bound", "never", "--require-go")
    assert status == 3
    assert re.search(r"NO-GO: \d+ reasons: unobservable \(--require-go\)", err)
    assert "over the run of 10 s, shorter than the window of 31.42 s" in out
    assert "a longer run: 17.9 s (duration_s) would do" in out


UNSAFE = {
    "go-not-estimated": "lost-in-flight",
    "go-lag-and-gusts": "too-close-in-flight",
    "go-turn-limit": "lost-in-flight",
}
"""Plans that an independent check found unsafe in flight, and the code that stops each."""


@pytest.mark.parametrize("name", UNSAFE)
def test_a_plan_that_is_a_go_on_paper_and_unsafe_in_flight_is_stopped(run: Any, name: str) -> None:
    file = str(GRAZING.parent / f"{name}.json")
    assert run("plan", file, "--paper", "--require-go")[0] == 0
    status, out, err = run("plan", file, "--require-go", "--format", "json")
    assert status == 3
    stops = {
        one["code"] for one in json.loads(out)["verdict"]["findings"] if one["level"] == "stop"
    }
    assert UNSAFE[name] in stops
    assert UNSAFE[name] in err


def test_flights_of_a_plan_that_was_edited_since_do_not_count(run: Any, tmp_path: Path) -> None:
    file = tmp_path / "plan.json"
    assert run("plan", GRID, "--fly", "4", "-o", str(file))[0] == 0
    values = json.loads(file.read_text())
    assert values["verdict"]["basis"]["flights"] == 4
    assert run("plan", str(file), "--paper", "--require-flown")[0] == 0
    scenario = {
        **values["scenario"],
        "motion": {**values["scenario"]["motion"], "lag_s": 6.0},
        "wind": {"gust_sigma_mps": 0.9},
        "min_separation_m": 25.0,
    }
    file.write_text(json.dumps({**values, "scenario": scenario}))
    status, out, err = run("plan", str(file), "--paper", "--require-flown", "--format", "json")
    assert status == 3
    assert json.loads(out)["verdict"]["basis"]["kind"] == "paper"
    assert "GO on paper: not flown (--require-flown)" in err
    status, out, _ = run("plan", str(file), "--require-go", "--format", "json")
    assert (status, json.loads(out)["flight"]["trials"] != 4) == (3, True)


def test_options_that_contradict_each_other_are_refused(run: Any) -> None:
    status, _, err = run("plan", GRID, "--paper", "--fly", "40")
    assert status == 2
    assert "--fly: can't be combined with --paper; leave one of them out" in err
