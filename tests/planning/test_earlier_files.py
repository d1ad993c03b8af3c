"""Files from before verdicts rested on flights: plans and reports that the last such version wrote.

The survey of two vehicles in `tests/data/before-flights` was planned and flown 12 times, refined,
validated, flown, swept, and judged after losses. Its verdicts have codes that are gone.
"""

import json
from pathlib import Path
from typing import Any

import pytest

import syncplan
from syncplan.planning.loss_study import WhatIfDocument
from syncplan.planning.plan_files import loaded_from, plan_of
from syncplan.plotting.figures import specs_of
from syncplan.reports.flight_report import FlightDocument
from syncplan.reports.plan_report import PlanDocument, plan_document
from syncplan.reports.validation_report import SweepReport, ValidationDocument
from tests.tools.scenarios import findings_of

FOLDER = Path(__file__).parents[1] / "data" / "before-flights"

MODELS: dict[str, Any] = {
    "plan": PlanDocument,
    "refined": PlanDocument,
    "validation": ValidationDocument,
    "flight": FlightDocument,
    "losses": WhatIfDocument,
    "sweep": SweepReport,
}

GONE = {"over-limit", "strong-wind", "start-uncertain", "start-up"}
"""Codes of warnings in these files that no verdict has now."""


def values_of(name: str) -> Any:
    """The values of a file."""
    return json.loads((FOLDER / f"{name}.json").read_text())


def without_new_keys(values: Any, earlier: Any) -> Any:
    """Values without keys that are null and that earlier versions did not write."""
    if isinstance(values, dict):
        return {
            key: without_new_keys(value, earlier.get(key))
            for key, value in values.items()
            if key in earlier or value is not None
        }
    if isinstance(values, list):
        return [without_new_keys(*pair) for pair in zip(values, earlier, strict=True)]
    return values


@pytest.mark.parametrize("name", MODELS)
def test_a_document_reads_as_it_was_written_and_is_drawn(name: str) -> None:
    values = values_of(name)
    document = MODELS[name].model_validate(values)
    assert without_new_keys(document.as_json(), values) == values
    if not isinstance(document, PlanDocument):
        assert specs_of(document, [])


def test_a_plan_has_the_verdict_that_it_had_until_it_is_judged_again() -> None:
    document = PlanDocument.model_validate(values_of("plan"))
    assert document.verdict is not None
    assert document.verdict.headline == "NO-GO: 1 reason"
    assert GONE & {finding.code for finding in document.verdict.findings}
    assert document.start_up is not None
    assert document.start_up.pilot is not None


def test_a_refinement_of_an_earlier_version_knows_nothing_of_tolerances() -> None:
    plan = syncplan.load_plan(FOLDER / "refined.json")
    after = plan_document(plan).as_json()["refinement"]["after"]
    assert after["least_distance_m"] == pytest.approx(23.3296945428528)
    known = [after[key] for key in ("meetings", "least_tolerance_rad", "widest_meeting_m")]
    assert known == [None] * 3


@pytest.mark.parametrize("name", ["plan", "refined"])
def test_a_plan_is_judged_again_on_paper_and_a_note_says_why(name: str) -> None:
    plan = syncplan.load_plan(FOLDER / f"{name}.json")
    assert specs_of(plan, [])
    assert plan.verdict.headline == "GO on paper: not flown"
    assert not GONE & {finding.code for finding in plan.verdict.findings}
    notes = findings_of(plan, "flights-dropped")
    assert [note.level for note in notes] == (["note"] if name == "plan" else [])
    assert (plan.refinement is not None) == (name == "refined")


def test_a_plan_that_is_read_to_be_flown_is_flown() -> None:
    plan = plan_of(loaded_from(values_of("plan")), pilot=True)
    assert plan.verdict.flown
    assert findings_of(plan, "not-flown") == []
    assert len(findings_of(plan, "flights-dropped")) == 1
