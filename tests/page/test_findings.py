"""One verdict: command line, service, page and sidecars give the same findings, word for word."""

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import httpx2
import pytest
from playwright.sync_api import expect

from tests.page.gestures import opened, saved
from tests.tools.browsing import Visit
from tests.tools.scenarios import document
from tests.tools.serving import Server

TROUBLED = document(
    name="troubled",
    formation={"centers_m": [[0.0, 0.0], [70.0, 0.0], [70.0, 10.0]]},
    landmarks_m={"mast": [20.5, 0.0], "gate": [60.0, 60.0]},
    keep_out_m=[[[85.0, -5.0], [95.0, -5.0], [95.0, 5.0], [85.0, 5.0]]],
    min_separation_m=65.0,
    initial_sigma={"position_m": 15.0, "heading_rad": 0.3},
)


def sidecar_of(archive: bytes) -> dict[str, Any]:
    """The verdict in the sidecar of an exported archive."""
    with zipfile.ZipFile(io.BytesIO(archive)) as files:
        name = next(name for name in files.namelist() if name.endswith(".sync.json"))
        verdict: dict[str, Any] = json.loads(files.read(name))["verdict"]
    return verdict


@pytest.fixture
def planned(run: Any, tmp_path: Path) -> dict[str, Any]:
    """The verdict of the command line."""
    scenario, plan = tmp_path / "troubled.json", tmp_path / "plan.json"
    scenario.write_text(json.dumps(TROUBLED))
    assert run("plan", str(scenario), "-o", str(plan))[0] == 0
    verdict: dict[str, Any] = json.loads(plan.read_text())["verdict"]
    return verdict


def test_findings_are_the_same_word_for_word_everywhere(
    visit: Visit, server: Server, run: Any, tmp_path: Path, planned: dict[str, Any]
) -> None:
    codes = {one["code"] for one in planned["findings"]}
    assert {"vehicles-too-close", "landmark-too-close", "in-keep-out"} <= codes
    plan, folder = tmp_path / "plan.json", tmp_path / "files"
    _, table, _ = run("plan", str(plan), "--format", "table")
    on_one_line = " ".join(table.split())
    for one in planned["findings"]:
        assert " ".join(one["message"].split()) in on_one_line
    # sidecars
    assert run("export", str(plan), "--format", "csv", "-o", str(folder), "--force")[0] == 0
    (sidecar,) = folder.glob("*.sync.json")
    assert json.loads(sidecar.read_text())["verdict"] == planned
    # the service
    made = httpx2.post(f"{server.url}/v1/plans", json=TROUBLED, timeout=60.0)
    assert made.status_code == 201, made.text
    assert made.json()["plan"]["verdict"] == planned
    # the page
    opened(visit.page, TROUBLED)
    visit.verdict("✗ NO-GO")
    visit.settle()
    shown = visit.page.locator("#verdict .finding")
    expect(shown).to_have_count(len(planned["findings"]))
    for one in planned["findings"]:
        found = visit.page.locator(f"#verdict .finding[data-code={one['code']}]")
        expect(found.filter(has_text=one["message"])).to_have_count(1)
    visit.page.get_by_label("Format", exact=True).select_option("csv")
    visit.page.get_by_label("Export although the verdict is NO-GO").check()
    with visit.page.expect_download() as waiting:
        visit.page.get_by_role("button", name="Export").click()
    assert sidecar_of(saved(waiting.value)) == planned
