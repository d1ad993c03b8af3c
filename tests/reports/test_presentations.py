"""Results as files, data frames and notebook tables say what their documents say."""

import json
import sys
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pandas
import pytest

import syncplan
from syncplan.planning.plans import Plan
from syncplan.reports.plan_report import plan_document
from syncplan.reports.presentations import REPORTS
from syncplan.results.result import Result
from syncplan.results.stories import MOST_ROWS, Report
from tests.tools.scenarios import example, small


@pytest.fixture(scope="module")
def grid() -> Plan:
    return syncplan.plan(example("paper-grid-same"))


@pytest.fixture(scope="module")
def results(grid: Plan) -> dict[str, Result]:
    sites = {"A": (190.0, 35.0), "B": (-40.0, 0.0)}
    return {
        "scenario": grid.scenario,
        "plan": grid,
        "validation": syncplan.validate(grid, trials=2, duration=20.0),
        "sweep": syncplan.sweep(grid.scenario, "range", [50.0, 40.0], trials=1, duration=20.0),
        "sites": syncplan.choose_landmarks(grid, sites, 1, bound="never"),
    }


def _cells(shown: str) -> list[list[str]]:
    """Texts of the cells of each row, the head first."""
    page = ElementTree.fromstring(f"<div>{shown}</div>")
    return [["".join(cell.itertext()) for cell in row] for row in page.iter("tr")]


def test_plans_and_scenarios_are_saved_but_not_to_a_directory(grid: Plan, tmp_path: Path) -> None:
    grid.save(tmp_path / "plan.json")
    saved = json.loads((tmp_path / "plan.json").read_text())
    assert saved == json.loads(json.dumps(plan_document(grid).as_json()))
    grid.scenario.save(tmp_path / "scenario.json")
    assert syncplan.load_scenario(tmp_path / "scenario.json") == grid.scenario
    with pytest.raises(syncplan.InputError, match="is a directory"):
        grid.save(tmp_path)


def test_frames_hold_the_figures_of_the_documents(results: dict[str, Any]) -> None:
    frame = results["plan"].to_dataframe()
    assert isinstance(frame, pandas.DataFrame)
    assert frame["name"].tolist() == results["plan"].scenario.vehicle_names
    assert frame["predicted_rms_m"].tolist() == results["plan"].prediction.rms.tolist()
    assert frame["center_x_m"].tolist() == results["plan"].orbits.centers[:, 0].tolist()
    late = results["validation"].to_dataframe()["rms_second_half_m"]
    assert late.tolist() == results["validation"].accuracy.late_position.tolist()
    swept = results["sweep"].to_dataframe()
    assert swept["value"].tolist() == [50.0, 40.0]
    assert swept["rank"].tolist() == [
        row.validation.plan.observability.rank for row in results["sweep"]
    ]
    sites = results["sites"].to_dataframe()
    assert sites["name"].tolist() == ["A", "B"]
    assert sites["chosen"].tolist() == [k in results["sites"].chosen for k in range(2)]
    assert results["scenario"].to_dataframe()["range_m"].tolist() == [50.0] * 6


def test_a_notebook_shows_a_row_for_each_of_the_frame(results: dict[str, Any]) -> None:
    for one in results.values():
        rows, frame = _cells(one._repr_html_()), one.to_dataframe()
        assert len(rows) > len(frame)
        for name in frame.get("name", frame.get("label")):
            assert any(row[0] == name for row in rows)
    assert (
        '<p><span class="bold green">GO in 31 simulated flights</span></p>'
        in results["plan"]._repr_html_()
    )


def test_names_are_escaped_and_long_tables_end_with_a_count() -> None:
    count = MOST_ROWS + 3
    names = ["<b>", *(f"v{k}" for k in range(1, count))]
    centers = [[70.0 * k, 0.0] for k in range(count)]
    shown = small(formation={"centers_m": centers, "names": names})._repr_html_()
    assert '<th scope="row">&lt;b&gt;</th>' in shown
    assert "><b></th>" not in shown
    assert "3 more rows" in shown
    assert shown.count("<tr>") == 1 + MOST_ROWS


def test_a_scenario_without_centres_is_shown_by_its_names() -> None:
    scenario = small(formation={"names": ["a", "b"], "links": [["a", "b"]]})
    assert scenario.to_dataframe().to_dict("list") == {"name": ["a", "b"]}


def test_without_pandas_the_extra_is_named(grid: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(syncplan.InputError, match=r"pip install 'syncplan\[dataframe\]'"):
        grid.to_dataframe()


def test_every_kind_of_result_has_a_presentation() -> None:
    for module, _, maker in (place.partition(".") for place in REPORTS.values()):
        assert callable(getattr(import_module(f"syncplan.reports.{module}"), maker))
    for name in syncplan.__all__:
        getattr(syncplan, name)
    kinds: set[type] = set()
    left = [Result]
    while left:
        found = left.pop().__subclasses__()
        kinds.update(found)
        left += found
    # a dataclass with slots is made anew of one without, which stays in the list
    shown = set(REPORTS)
    assert shown <= {kind.__name__ for kind in kinds}
    for kind in kinds:
        assert issubclass(kind, Report) or any(base.__name__ in shown for base in kind.__mro__)
