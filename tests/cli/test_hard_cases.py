"""Scenarios on which verdicts once were wrong, each by its command line."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.tools.scenarios import FILES

HARD = Path(__file__).parents[1] / "data" / "hard"


@pytest.mark.parametrize(
    "command", [("plan",), ("validate", "--trials", "2")], ids=lambda command: command[0]
)
def test_wind_faster_than_the_vehicles_is_no_go(run: Any, command: tuple[str, ...]) -> None:
    name, *options = command
    file = str(HARD / "wind-faster-than-vehicles.json")
    status, _, err = run(name, file, *options, "--require-go")
    assert status == 3
    assert "NO-GO: 1 reason: over-limit (--require-go)" in err


def test_a_meeting_that_nobody_needs_warns_with_its_cost(printed: Any) -> None:
    file = str(HARD / "grazing-landmark.json")
    options = ("--dropout", "0.2", "--trials", "40", "--seed", "3", "--threads", "1")
    verdict = json.loads(printed("fly", file, *options, "--require-go"))["verdict"]
    assert verdict["go"]
    (found,) = (one for one in verdict["findings"] if one["code"] == "meetings-missed")
    assert found["level"] == "warning"
    assert "v2-L2 keeps 49.6 %; without v2-L2 the team is observable still" in found["message"]
    assert "predicted RMS 1.66 -> " in found["message"]


def test_a_start_known_worse_than_vehicles_are_apart_warns_and_names_fly(
    printed: Any, tmp_path: Path
) -> None:
    for position, heading, warned in ((5.0, 0.1, False), (30.0, 0.6, True)):
        file = tmp_path / f"{position:g}.json"
        values = json.loads((HARD / "grazing-landmark.json").read_text())
        values["initial_sigma"] = {"position_m": position, "heading_rad": heading}
        file.write_text(json.dumps(values))
        found = json.loads(printed("plan", str(file), "--require-go"))["verdict"]["findings"]
        starts = [one for one in found if one["code"] == "start-uncertain"]
        assert len(starts) == warned
        for one in starts:
            assert one["level"] == "warning"
            assert "fly" in one["cure"]["text"]


def test_calm_examples_carry_no_warning_of_wind_or_room(printed: Any) -> None:
    for name in ("paper-grid-same", "windy-grid", "triangle-lattice"):
        found = json.loads(printed("plan", str(FILES / f"{name}.yaml")))["verdict"]["findings"]
        assert [one["code"] for one in found if one["level"] == "warning"] == []
