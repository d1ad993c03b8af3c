"""The page's form of a brief follows from the model of briefs."""

import pytest

from api.routes.brief_form import KINDS, brief_form
from syncplan.scenario.brief import Brief
from syncplan.scenario.specification import Scenario
from tests.tools.briefs import brief


def test_fields_have_a_label_of_their_own_and_a_key_of_the_brief() -> None:
    fields = [field for group in brief_form()["groups"] for field in group["fields"]]
    labels = [field["label"] for field in fields]
    assert len(set(labels)) == len(labels)
    assert all(labels)
    required = [field["key"] for field in fields if field["required"] and field["of"] is None]
    assert required == ["need.worst_rms_m", "team.max", "vehicle.speed_mps", "sensor.range_m"]


@pytest.mark.parametrize(("title", "kind"), [(t, kind) for t in KINDS for kind in KINDS[t]])
def test_kinds_are_keys_of_their_section(title: str, kind: str) -> None:
    section = title.lower()
    assert not kind or kind in type(getattr(brief(), section)).model_fields


def test_values_shared_with_a_scenario_are_keys_of_both() -> None:
    shared = brief_form()["shared"]
    assert {"sensor", "motion", "initial_sigma", "wind", "filter"} <= set(shared)
    assert set(shared) <= set(Brief.model_fields) & set(Scenario.model_fields)
