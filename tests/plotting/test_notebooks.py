"""What notebooks show of results, and the figures that results name."""

import sys
from types import ModuleType
from typing import Any

import pytest

import syncplan
from tests.tools.on_paper import plan
from tests.tools.scenarios import small


@pytest.fixture
def displayed(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What is displayed, in a notebook that is none."""
    seen: list[Any] = []
    display = ModuleType("IPython.display")
    vars(display).update(display=seen.append, HTML=str)
    monkeypatch.setitem(sys.modules, "IPython", ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    return seen


def test_a_plan_shows_its_map_and_other_results_their_main_figure(displayed: list[Any]) -> None:
    made = plan(small())
    made._ipython_display_()
    (html,) = displayed
    assert html.count('<svg xmlns="http://www.w3.org/2000/svg" class="map"') == 1
    assert html.index("<svg") < html.index("<table>")
    validation = syncplan.validate(made, trials=2, duration=20.0)
    validation._ipython_display_()
    _, figure, html = displayed
    assert figure == validation.figure() == validation.figure("accuracy")
    assert "<svg" not in html
    made.scenario._ipython_display_()
    assert len(displayed) == 4


def test_results_name_their_figures() -> None:
    made = plan(small())
    assert made.figures[:3] == ["formation", "animation", "timeline"]
    assert made.figure("spectrum").data
    assert made.figure("formation", theme="dark") != made.figure("formation")
    with pytest.raises(
        syncplan.InputError, match="the plan was not refined; choose from formation"
    ):
        made.figure("refinement")
    assert made.scenario.figures == []
    with pytest.raises(syncplan.InputError, match=r"^figure: "):
        made.scenario.figure()


def test_without_plotly_the_tables_are_shown_alone(
    displayed: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = syncplan.what_if(plan(small()), bound="never")
    monkeypatch.setitem(sys.modules, "plotly.graph_objects", None)
    found._ipython_display_()
    (html,) = displayed
    assert "each loss, the most harmful first" in html
