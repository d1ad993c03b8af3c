"""Errors of further states in the report of a validation, and what it says of those left out."""

from typing import Any

import numpy as np
import pytest

from syncplan.planning.validation import Validation, validate
from syncplan.reports.run_figures import interval_words
from syncplan.reports.validation_report import ValidationDocument, validation_document
from tests.tools.on_paper import plan
from tests.tools.scenarios import small

KEYS: dict[str, Any] = {
    "landmarks_m": [[-30.0, 20.0], [100.0, 20.0], [35.0, -30.0]],
    "wind": {"sigma_mps": 0.5},
    "motion": {"speed_scale_sigma": 0.05, "turn_rate_bias_sigma_rad_s": 0.02},
    "initial_sigma": {"position_m": 0.5, "heading_rad": 0.03},
}


def validated(estimate: str | list[str], **changes: object) -> Validation:
    given = small(**KEYS, filter={"estimate": estimate})
    return validate(plan(given), trials=32, duration=40.0, **changes)  # type: ignore[arg-type]


def test_further_states_have_their_errors_beside_the_bound() -> None:
    found = validated("auto", with_series=True)
    document = validation_document(found)
    assert document.errors is not None
    names = [one.state for one in document.errors]
    assert names[:3] == ["wind x", "wind y", "speed scale of v1"]
    assert len(names) == 2 + 2 * found.plan.team.count
    assert {one.state: one.unit for one in document.errors}["turn rate bias of v1"] == "rad/s"
    for k, one in enumerate(document.errors):
        assert one.rms_second_half**2 == pytest.approx(found.result.late_state_squares[:, k].mean())
        assert one.predicted_rms == pytest.approx(found.predicted_errors[k].rms)
        assert one.ratio == pytest.approx(one.rms_second_half / found.predicted_errors[k].rms)
        assert 0.97 < one.coverage <= 1.0
    assert found.predicted is not None
    overall = document.overall.predicted_rms_m
    assert overall == pytest.approx(np.sqrt(np.mean(found.predicted**2)))
    assert document.series is not None
    assert document.series.errors is not None
    steps = found.result.steps
    for one, line in zip(document.errors, document.series.errors, strict=True):
        assert line.predicted is not None
        assert line.predicted[0] == pytest.approx(line.sigma[0])
        settled = np.array(line.predicted)[steps // 2 + 1 :]
        assert np.sqrt(np.mean(settled**2)) == pytest.approx(one.predicted_rms)
        assert (line.state, line.unit) == (one.state, one.unit)
        assert np.mean(np.square(line.rms[1:])) == pytest.approx(one.rms**2)
        assert len(line.sigma) == len(line.mean) == len(document.series.time_s)
    assert ValidationDocument.model_validate(document.as_json()) == document
    assert not any("estimate" in note for note in document.notes)
    assert any("still air" in note for note in document.notes)


def test_errors_that_are_left_out_are_named_with_what_they_cost() -> None:
    found = validated(["wind"])
    document = validation_document(found)
    assert document.errors is not None
    assert [one.state for one in document.errors] == ["wind x", "wind y"]
    note = next(note for note in document.notes if "does not estimate" in note)
    assert "speed scale" in note
    assert "turn rate bias" in note
    assert "wind" not in note
    assert "filter.estimate" in note
    assert interval_words(document.anees) in note
    assert document.anees.verdict == "optimistic"
    assert found.expected is not None
    assert found.predicted is not None
    assert np.all(found.expected > found.predicted)


def test_without_such_errors_nothing_is_said_of_them() -> None:
    document = validation_document(
        validate(plan(small()), trials=4, duration=10.0, with_series=True)
    )
    report = document.as_json()
    assert "errors" not in report
    assert "errors" not in report["series"]
    assert not any("still air" in note for note in document.notes)
    assert not any("estimate" in note for note in document.notes)
