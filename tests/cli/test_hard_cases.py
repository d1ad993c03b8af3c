"""Scenarios on which verdicts once were wrong, each by its command line."""

import json
import re
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
    options = ("--dropout", "0.2", "--trials", "8", "--seed", "3", "--threads", "1")
    verdict = json.loads(printed("fly", file, *options, "--require-go"))["verdict"]
    assert verdict["go"]
    (found,) = (one for one in verdict["findings"] if one["code"] == "meetings-missed")
    assert found["level"] == "warning"
    words = (
        r"v2-L2 keeps [45]\d(\.\d)? %; without v2-L2 the team is observable still, predicted RMS 1"
    )
    assert re.search(words, found["message"])


def test_calm_examples_carry_no_warning_of_wind_or_room(printed: Any) -> None:
    for name in ("paper-grid-same", "windy-grid", "triangle-lattice"):
        found = json.loads(printed("plan", str(FILES / f"{name}.yaml")))["verdict"]["findings"]
        assert [one["code"] for one in found if one["level"] == "warning"] == []
