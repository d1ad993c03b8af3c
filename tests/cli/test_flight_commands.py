"""syncplan fly: flights at the command line."""

import json
from pathlib import Path
from typing import Any

import pytest

from syncplan.flight.flying import fly
from tests.tools.scenarios import FILES

GRID = str(FILES / "windy-grid.yaml")
QUICK = ("--trials", "2", "--duration", "40", "--threads", "1")


def test_a_flight_is_reported_as_the_library_reports_it(run: Any, tmp_path: Path) -> None:
    target = tmp_path / "flight.json"
    events = ("--lose", "v3@20", "--lose", "sensor:v1@5", "--hold", "v2@10:5")
    wrong = ("--dropout", "0.1", "--outliers", "0.05", "--mistaken", "0.01", "--late", "3")
    status, _, err = run(
        "fly", GRID, *QUICK, "--seed", "4", "--wind", "1.5,0", *events, *wrong, "-o", str(target)
    )
    assert status == 0
    assert f"wrote {target}" in err
    document = json.loads(target.read_text(), parse_constant=_refuse)
    flight = fly(
        GRID,
        trials=2,
        duration=40.0,
        seed=4,
        wind=(1.5, 0.0),
        lose=("v3@20", "sensor:v1@5"),
        hold=("v2@10:5",),
        dropout=0.1,
        outliers=0.05,
        mistaken=0.01,
        late=3,
        threads=1,
    )
    own = tmp_path / "own.json"
    flight.save(own)
    assert own.read_bytes() == target.read_bytes()
    assert [one["event"] for one in document["events"]] == ["sensor:v1@5", "v2@10:5", "v3@20"]
    assert document["vehicles"][2]["errors"] is None
    assert document["filter"]["gate_probability"] == 0.9999


def _refuse(name: str) -> float:
    raise AssertionError(name)


def test_a_terminal_shows_vehicles_and_what_happened(run: Any) -> None:
    events = ("--lose", "v3@20", "--hold", "v2@10:5")
    status, out, _ = run("fly", GRID, *QUICK, *events, "--format", "table")
    assert status == 0
    for words in (
        "guidance track, filter robust",
        "filter lost in",
        "closest two vehicles",
        "wind known to",
        "v3 is lost at 20 s",
        "v2 is held from 10 s for 5 s",
    ):
        assert words in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--lose", "v9@20"), "lose: 'v9': is neither a vehicle"),
        (("--lose", "v3@-2"), "lose: v3@-2: -2 s is no time of the flight, which is from 0 to 40"),
        (("--lose", "v3@40"), "lose: v3@40: 40 s is no time of the flight"),
        (("--lose", "v3"), "lose: 'v3' has no time"),
        (("--hold", "v2@39"), "hold: 'v2@39' is no hold"),
        (("--hold", "v2@10:5", "--hold", "v2@12:5"), "hold: v2 is held twice at 12 s"),
        (("--wind", "1.5"), "--wind: '1.5': give two numbers, x,y in m/s, such as 1.5,0"),
        (("--wind", "1,north"), "--wind"),
        (("--dropout", "1"), "dropout: 1 given; a share is from 0 to below 1"),
        (("--late", "-1"), "late: -1 given"),
        (("--filter", "ideal"), "filter: ideal takes the truth; nobody can fly by it"),
        (("--guidance", "luck"), "guidance"),
    ],
)
def test_what_is_wrong_is_said_in_one_line_and_nothing_is_written(
    run: Any, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    target = tmp_path / "flight.json"
    status, out, err = run("fly", GRID, *QUICK, *arguments, "-o", str(target))
    assert (status, out) == (2, "")
    assert message in " ".join(err.split())
    assert not target.exists()
    assert len(err.strip().splitlines()) == 1 or "guidance" in message


def test_a_plan_file_is_flown_as_it_is(run: Any, tmp_path: Path) -> None:
    plan, target = tmp_path / "plan.json", tmp_path / "flight.json"
    assert run("plan", GRID, "-o", str(plan))[0] == 0
    status, out, _ = run("fly", str(plan), *QUICK)
    assert status == 0
    assert json.loads(out)["name"] == "windy-grid"
    status, _, err = run("fly", str(plan), *QUICK, "-o", str(plan))
    assert status == 2
    assert "plan.json" in err
    assert not target.exists()
