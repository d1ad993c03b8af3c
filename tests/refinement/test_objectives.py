"""The table of objectives and what is derived from it."""

import pickle

import numpy as np
import pytest

from syncplan.refinement.nlp import FORMS, MeasuredTeam
from syncplan.reports.refinement_report import FiguresOfMerit
from syncplan.scenario.models import RefineOptions
from syncplan.scenario.objectives import FIGURES, OBJECTIVES, ROWS, Figures


def test_every_objective_has_a_form_and_every_form_an_objective() -> None:
    assert list(FORMS) == list(OBJECTIVES)


def test_documents_and_tables_hold_every_figure_once() -> None:
    assert list(FiguresOfMerit.model_fields) == [one.key for one in FIGURES]
    assert sorted(one.name for one in ROWS) == sorted(one.name for one in FIGURES)
    assert set(OBJECTIVES) < {one.name for one in ROWS}


def test_options_name_and_describe_every_objective() -> None:
    schema = RefineOptions.model_json_schema()["properties"]["objective"]
    assert schema["anyOf"][0]["enum"] == list(OBJECTIVES)
    for one in OBJECTIVES.values():
        assert f"{one.name}, {one.sentence}" in schema["description"]


@pytest.mark.parametrize("name", tuple(OBJECTIVES))
def test_a_cost_is_smaller_for_the_better_plan(name: str) -> None:
    """The better of two teams: errors half as large, information twice as large."""
    eigenvalues, rms = np.array([9.0, 4.0, 1.0]), np.array([1.0, 2.0])
    worse, better = (
        Figures(6, True, 1.0, 2.0, 3.0, {key: form.exact(team) for key, form in FORMS.items()})
        for team in (
            MeasuredTeam(True, eigenvalues, rms),
            MeasuredTeam(True, 2.0 * eigenvalues, 0.5 * rms),
        )
    )
    assert better.cost(name) < worse.cost(name)


def test_objectives_that_need_observability_cannot_rank_plans_without_it() -> None:
    teams = [MeasuredTeam(False, np.array([k, 0.0]), np.array([1.0 / k])) for k in (1.0, 2.0)]
    for name, objective in OBJECTIVES.items():
        same = len({FORMS[name].exact(team) for team in teams}) == 1
        assert same == objective.needs_observability, name


def test_figures_offer_objectives_as_attributes_also_from_another_process() -> None:
    objectives = {name: float(k) for k, name in enumerate(OBJECTIVES)}
    figures = Figures(6, True, 1.0, 2.0, 3.0, objectives, 7, 1.5, 30.0)
    copy = pickle.loads(pickle.dumps(figures))
    assert copy == figures
    assert copy.trace == objectives["trace"]
    with pytest.raises(AttributeError, match="no figure 'beauty'"):
        _ = copy.beauty
