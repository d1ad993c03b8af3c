"""Landmarks chosen at the command line: what is written is what the next command takes."""

import json
from pathlib import Path
from typing import Any

import pytest

from syncplan.scenario.bounded_yaml import load_yaml
from syncplan.scenario.loading import load_scenario, with_landmarks

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
SHAPE = "{shape: grid, count: 5000, spacing_m: 70}"
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


@pytest.mark.long
def test_the_next_command_takes_the_scenario_and_finds_the_plan_of_the_choice(
    run: Any, printed: Any, survey: Path, tmp_path: Path
) -> None:
    target = tmp_path / "chosen.yaml"
    report = chosen(run, survey, target)
    plan = json.loads(printed("plan", str(target)))
    assert set(plan["scenario"]["landmarks_m"]) == {"L1", *report["chosen"]}
    for key in ("vehicles", "landmark_links", "observability", "verdict", "predicted_rms_m"):
        assert plan[key] == report["plan"][key]


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
    text = SCENARIO.replace("{centers_m: [[0, 0], [70, 0]]}", SHAPE)
    edited = with_landmarks(text, "survey.yaml", {"L1": (20.0, 45.0)})
    assert load_yaml(edited)["formation"]["count"] == 5000
