"""Findings of a flight: what went wrong in some trials warns, in many it stops the flight."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

import syncplan
from syncplan.planning.flight_checks import MOST_SHARE
from syncplan.planning.flight_record import FlightRecord, FlownVehicleRecord
from syncplan.planning.judged_plan import Plan

GRID = "examples/scenarios/paper-grid-same.yaml"

WELL = FlightRecord(
    trials=50,
    seed=0,
    duration=200.0,
    guidance="track",
    filter="robust",
    events=(),
    lost_share=0.0,
    out_of_contact_share=0.0,
    separations=(25.0, 14.0),
    too_close_share=None,
    vehicles=tuple(FlownVehicleRecord(f"v{k}", 0.2, 0.9, 1.2, (3.0, 5.0)) for k in range(1, 7)),
)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return syncplan.plan(syncplan.load_scenario(GRID), pilot=False)


def levels(plan: Plan, record: FlightRecord) -> dict[str, str]:
    """The level of each finding of a flight, by its code."""
    codes = ("lost-in-flight", "too-close-in-flight", "phase-not-kept")
    found = replace(plan, flight=record).verdict.findings
    return {one.code: one.level for one in found if one.code in codes}


def test_a_flight_that_went_well_finds_nothing(plan: Plan) -> None:
    assert levels(plan, WELL) == {}
    assert replace(plan, flight=WELL).verdict.go == plan.verdict.go


@pytest.mark.parametrize("name", ["lost_share", "out_of_contact_share"])
def test_trials_that_are_lost_warn_and_many_of_them_stop(plan: Plan, name: str) -> None:
    few = replace(WELL, **{name: MOST_SHARE})  # type: ignore[arg-type]
    many = replace(WELL, **{name: MOST_SHARE + 0.01})  # type: ignore[arg-type]
    assert levels(plan, few) == {"lost-in-flight": "warning"}
    assert levels(plan, many) == {"lost-in-flight": "stop"}
    assert not replace(plan, flight=many).verdict.go


def test_vehicles_that_come_too_near_warn_where_a_separation_is_asked_for(plan: Plan) -> None:
    assert levels(plan, replace(WELL, too_close_share=0.0)) == {}
    assert levels(plan, replace(WELL, too_close_share=0.02)) == {"too-close-in-flight": "warning"}
    assert levels(plan, replace(WELL, too_close_share=0.2)) == {"too-close-in-flight": "stop"}


def test_a_phase_is_kept_within_half_of_the_tolerance_of_its_meetings(plan: Plan) -> None:
    least = min(one.tolerance for one in plan.links if one.a == 0 or one.b == 0)
    tolerance = least / plan.orbits.rate
    first, *others = WELL.vehicles
    kept = {0.49: None, 0.51: "warning", 0.99: "warning", 1.01: "stop"}
    for share, level in kept.items():
        expected = {} if level is None else {"phase-not-kept": level}
        vehicles = (replace(first, phase_rms=share * tolerance), *others)
        assert levels(plan, replace(WELL, vehicles=vehicles)) == expected
    # those of vehicles that are gone are not asked for
    assert levels(plan, replace(WELL, vehicles=tuple(others))) == {}


def test_a_plan_file_keeps_what_flying_has_found(plan: Plan, tmp_path: Path) -> None:
    flown = replace(plan, flight=replace(WELL, lost_share=0.02, events=("v3 is lost at 60 s",)))
    flown.save(tmp_path / "plan.json")
    read = syncplan.load_plan(tmp_path / "plan.json")
    assert read.flight == flown.flight
    values = json.loads((tmp_path / "plan.json").read_text())
    assert values["flight"]["vehicles"][0]["speed_mps"] == [3.0, 5.0]
    plan.save(tmp_path / "other.json")
    assert "flight" not in json.loads((tmp_path / "other.json").read_text())


def test_the_sidecar_of_an_export_has_phase_errors_that_were_flown(plan: Plan) -> None:
    for one, expected in ((plan, None), (replace(plan, flight=WELL), [0.2, 0.9])):
        files = syncplan.export(one, "csv").files
        (sidecar,) = (file for file in files if file.name.endswith("sync.json"))
        vehicle = json.loads(sidecar.content)["vehicles"][0]
        assert vehicle["phase_error_s"] == expected
