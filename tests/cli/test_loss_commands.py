"""syncplan what-if: losses at the command line."""

import json
from pathlib import Path
from typing import Any

from syncplan.cli.document_table import DOCUMENTS
from tests.tools.scenarios import FILES

GRID = str(FILES / "paper-grid-same.yaml")
QUICK = ("--bound", "never")


def test_every_single_loss_is_judged_and_the_most_harmful_come_first(run: Any) -> None:
    status, out, err = run("what-if", GRID, *QUICK)
    assert (status, err) == (0, "")
    document = json.loads(out)
    assert len(document["losses"]) == 14
    first, last = document["losses"][0], document["losses"][-1]
    assert (first["observable"], last["observable"]) == (False, True)
    assert first["verdict"]["go"] is False
    assert first["unobservable"]
    assert run("what-if", GRID, "--losses", "3")[0] == 2


def test_a_plan_file_keeps_its_orbits(
    run: Any, refused: Any, plan_file: Path, tmp_path: Path
) -> None:
    losses = tmp_path / "losses.json"
    document = json.loads(plan_file.read_text())
    for vehicle in document["vehicles"]:
        vehicle.pop("position_m"), vehicle.pop("heading_rad")
        vehicle["phase_rad"] = 0.0
    plan_file.write_text(json.dumps(document))
    assert run("what-if", str(plan_file), "-o", str(losses), *QUICK)[0] == 0
    found = json.loads(losses.read_text())
    assert found["baseline"]["observable"] is False
    assert found["critical"] == []
    assert "losses.json" in refused("what-if", str(losses))


def test_losses_of_two_are_judged_on_request(printed: Any, written: Any) -> None:
    document = json.loads(printed("what-if", written(), "--losses", "2", *QUICK))
    assert len(document["losses"]) == 4 + 3
    assert ["sensor:v1", "sensor:v2"] in [one["lost"] for one in document["losses"]]


def test_what_is_named_is_lost_together(printed: Any) -> None:
    document = json.loads(printed("what-if", GRID, "--lose", "v1, v5", *QUICK))
    assert [one["lost"] for one in document["losses"]] == document["critical"] == [["v1", "v5"]]
    out = printed("what-if", GRID, "--lose", "sensor:v3", "--format", "table", *QUICK)
    assert "1 critical of 1: the sensor of v3" in out
    assert "turn of everything" in out
    assert "was not asked for" in out


def test_losses_are_drawn_and_have_a_schema(run: Any, tmp_path: Path) -> None:
    losses, page = tmp_path / "losses.json", tmp_path / "losses.html"
    assert run("what-if", GRID, "-o", str(losses))[0] == 0
    assert run("plot", str(losses), "-o", str(page))[0] == 0
    assert "predicted error after each loss" in page.read_text()
    schema = json.loads(run("schema", "what-if")[1])
    assert set(schema["properties"]) == set(json.loads(losses.read_text()))
    assert DOCUMENTS["what-if"].model.model_validate_json(losses.read_text())
