"""syncplan design: a brief at the command line."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from syncplan.cli.document_table import DOCUMENTS
from syncplan.designs import judgement, ladder
from syncplan.designs.purchases import offers_for
from syncplan.planning.plan_files import load_plan
from tests.tools.briefs import FIELD


@pytest.fixture
def brief_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(ladder, "EVALUATIONS", {"quick": 24})
    monkeypatch.setattr(judgement, "TRIALS", 4)
    monkeypatch.setattr(judgement, "refine", lambda made, **_: made)
    path = tmp_path / "brief.json"
    path.write_text(json.dumps(FIELD))
    return path


def _changed(brief_file: Path, **keys: Any) -> str:
    brief_file.write_text(json.dumps({**FIELD, **keys}))
    return str(brief_file)


def test_a_brief_that_is_met_gives_a_plan(run: Any, brief_file: Path, tmp_path: Path) -> None:
    design, plan = tmp_path / "design.json", tmp_path / "plan.json"
    given = ("design", str(brief_file), "-o", str(design), "--plan-out", str(plan))
    status, out, err = run(*given, "--processes", "1")
    assert (status, out) == (0, "")
    assert err == f"syncplan: wrote {plan}\nsyncplan: wrote {design}\n"
    found = json.loads(design.read_text())
    assert found["status"] == "met"
    assert found["plan"] == json.loads(plan.read_text())
    assert load_plan(plan).team.count == found["best"]["vehicles"]
    assert found["best"]["covered_share"] >= 0.6
    assert DOCUMENTS["design"].model.model_validate(found).model_dump()["seed"] == 0


def test_a_brief_that_is_not_met_exits_with_4_and_still_writes_the_best_plan(
    run: Any, brief_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "syncplan.designs.designer.offers_for", lambda *given: offers_for(*given)[:1]
    )
    plan = tmp_path / "plan.json"
    path = _changed(brief_file, need={"worst_rms_m": 0.02}, team={"min": 2, "max": 2})
    given = ("design", path, "--plan-out", str(plan), "--processes", "1")
    status, out, _ = run(*given, "--format", "table")
    assert status == 4
    assert "not found, need 0.02 m for the worst vehicle; what decides: error" in out
    assert "what would help" in out
    assert load_plan(plan).team.count == 2


def test_an_impossible_brief_exits_with_4_and_its_proof(run: Any, brief_file: Path) -> None:
    path = _changed(brief_file, landmarks={"max": 0})
    status, out, _ = run("design", path, "--format", "table")
    assert status == 4
    assert "impossible" in out
    assert "without landmarks the whole team can shift unseen" in out
    assert json.loads(run("design", path)[1])["proof"]["kind"] == "rank"


def test_a_bad_brief_is_refused_in_one_line(refused: Any, brief_file: Path) -> None:
    path = _changed(brief_file, purpose={})
    assert refused("design", path).startswith(
        f"syncplan: {path}: purpose.cover: is missing: give cover, visit_m or keep"
    )


def test_briefs_and_designs_are_no_scenarios(refused: Any, brief_file: Path) -> None:
    assert "is a brief where a scenario or a plan is wanted" in refused("plan", str(brief_file))


def test_purchases_are_stated_on_request(
    run: Any, brief_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "syncplan.designs.designer.offers_for", lambda *given: offers_for(*given)[:2]
    )
    status, out, _ = run("design", str(brief_file), "--processes", "1", "--purchases")
    document = json.loads(out)
    assert (status, document["status"], document["brief"]["purchases"]) == (0, "met", True)
    assert document["purchases"]
    assert all(offer["worst_rms_m"] > 0.0 for offer in document["purchases"])


@pytest.mark.long
@pytest.mark.parametrize(
    ("after_s", "number"), [(2.0, signal.SIGINT), (4.0, signal.SIGTERM), (7.0, signal.SIGTERM)]
)
def test_a_design_that_a_signal_ends_is_written_whole(
    after_s: float, number: signal.Signals, tmp_path: Path
) -> None:
    given, design, plan = (tmp_path / name for name in ("brief.json", "design.json", "plan.json"))
    given.write_text(json.dumps(FIELD | {"effort": "thorough"}))
    files = "-o", str(design), "--plan-out", str(plan)
    command = [sys.executable, "-m", "syncplan", "design", str(given), *files]
    # as `timeout` does, to all processes of the group
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True)
    time.sleep(after_s)
    os.killpg(process.pid, number)
    assert process.wait(30.0) == 4
    document = DOCUMENTS["design"].model.model_validate_json(design.read_text()).model_dump()
    assert (document["cut_short"], document["findings"][0]["code"]) == (True, "search-cut-short")
    if document["best"] is not None:
        assert load_plan(plan).team.count == document["best"]["vehicles"]
    assert {path.name for path in tmp_path.iterdir()} <= {given.name, design.name, plan.name}
