"""Findings of a flight: where levels change."""

import json
from collections.abc import Callable
from dataclasses import replace
from math import log
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom

import syncplan
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.planning.flight_checks import LEAST_KEPT, MOST_MISSED, MOST_SATURATED
from syncplan.planning.judged_team import PlanFinding
from syncplan.planning.plan_records import FlownPlan, MeetingsFlown, flight_digest
from syncplan.planning.plans import Plan
from tests.tools.flown import WELL
from tests.tools.scenarios import example, findings_of

HARD = Path(__file__).parents[1] / "data" / "hard"


def with_(part: Any, **changes: Any) -> Any:
    """A part of a record with some keys replaced."""
    return part.model_copy(update=changes)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return syncplan.plan(example("paper-grid-same"), pilot=False)


def levels(plan: Plan, record: FlownPlan) -> dict[str, str]:
    """The level of each finding of a flight, by its code."""
    return {one.code: one.level for one in found_of(plan, record)}


def found_of(plan: Plan, record: FlownPlan) -> list[PlanFinding]:
    """The findings of a flight."""
    codes = ["lost-in-flight", "too-close-in-flight", "phase-not-kept", "meetings-missed"]
    codes.append("commands-saturated")
    found = replace(plan, flight=record).verdict.findings
    return [one for one in found if one.code in codes]


def flown_with(record: FlownPlan, **shares: float) -> FlownPlan:
    """The record with the shares of meetings that pairs kept, such as v1_v2=0.9."""
    own = {tuple(name.split("_")): share for name, share in shares.items()}
    pairs = [with_(one, kept_share=own.get(one.between, 1.0)) for one in record.meetings_kept]
    assert own.keys() <= {one.between for one in pairs}
    found: FlownPlan = with_(record, meetings_kept=pairs)
    return found


def test_a_flight_that_went_well_finds_nothing(plan: Plan) -> None:
    assert levels(plan, WELL) == {}
    assert replace(plan, flight=WELL).verdict.go == plan.verdict.go


LEVELS = {1: "note", 2: "warning", 5: "warning", 6: "stop", 50: "stop"}
"""Level of a finding by the number of failures in 50 flights."""


def test_levels_follow_from_the_likelihood_of_a_good_and_of_a_bad_share() -> None:
    for failures, level in LEVELS.items():
        bad, good = (binom.logpmf(failures, WELL.trials, share) for share in (0.12, 0.03))
        certain = abs(bad - good) >= log(19.0)
        assert level == ("warning" if not certain else "stop" if bad > good else "note")


def test_circles_nearer_to_an_edge_than_three_times_what_flights_were_off_are_a_finding() -> None:
    corners = [[-21.0, -21.0], [161.0, -21.0], [161.0, 91.0], [-21.0, 91.0]]
    scenario = example("paper-grid-same").model_copy(update={"area_m": corners})
    plan = syncplan.plan(scenario, pilot=False)

    def findings(*strays: float) -> list[PlanFinding]:
        vehicles = [
            with_(vehicle, tracking_rms_m=stray)
            for vehicle, stray in zip(WELL.vehicles, strays, strict=False)
        ]
        verdict = replace(plan, flight=with_(WELL, vehicles=vehicles)).verdict
        assert verdict.go == plan.verdict.go
        return [finding for finding in verdict.findings if finding.code == "edge-near"]

    assert findings(*[0.33] * 6) == []
    [finding] = findings(0.33, 0.34, 0.5, 0.1, 0.1, 0.1)
    assert finding.level == "warning"
    assert finding.subjects == ("v2", "v3")
    assert "the circle of v3 keeps 1 m from it, and flights were 0.5 m (RMS) off" in finding.message
    # the others were lost in every flight
    assert [finding.subjects for finding in findings(0.33, 0.34)] == [("v2",)]
    assert all(finding.code != "edge-near" for finding in plan.verdict.findings)


@pytest.mark.parametrize("name", ["filter_lost_share", "out_of_contact_share"])
def test_the_share_of_flights_that_are_lost_gives_the_level(plan: Plan, name: str) -> None:
    for failures, level in LEVELS.items():
        record = with_(WELL, **{name: failures / WELL.trials})
        assert levels(plan, record) == {"lost-in-flight": level}
        assert replace(plan, flight=record).verdict.go == (level != "stop")


def test_vehicles_that_come_too_near_are_a_finding_where_a_separation_is_asked_for(
    plan: Plan,
) -> None:
    assert levels(plan, with_(WELL, too_close_share=0.0)) == {}
    for failures, level in LEVELS.items():
        record = with_(WELL, too_close_share=failures / WELL.trials)
        assert levels(plan, record) == {"too-close-in-flight": level}


def test_too_few_flights_without_a_failure_warn(plan: Plan) -> None:
    for trials, codes in ((30, ["few-flights"]), (31, [])):
        findings = replace(plan, flight=with_(WELL, trials=trials)).verdict.findings
        assert [finding.code for finding in findings if finding.code == "few-flights"] == codes


def expected(code: str, level: str | None) -> dict[str, str]:
    """The findings that there are where one has a level."""
    return {} if level is None else {code: level}


PHASES = {0.49: None, 0.51: "warning", 0.99: "warning", 1.01: "stop"}
"""Levels by the share of the allowed phase error."""


@pytest.mark.parametrize("share", PHASES)
def test_a_phase_is_kept_within_half_of_the_tolerance_of_its_meetings(
    plan: Plan, share: float
) -> None:
    tolerance = 1.0
    links = tuple(replace(one, tolerance=tolerance * plan.orbits.rate) for one in plan.links)
    first, *others = WELL.vehicles
    vehicles = [with_(first, phase_rms_s=share * tolerance), *others]
    narrow = replace(plan, links=links)
    found = levels(narrow, with_(WELL, vehicles=vehicles))
    assert found == expected("phase-not-kept", PHASES[share])
    # those of vehicles that are gone are not asked for
    assert levels(narrow, with_(WELL, vehicles=others)) == {}


def test_a_phase_that_only_a_link_to_spare_cannot_bear_warns(plan: Plan) -> None:
    first, *others = plan.links
    assert (first.a, first.b) == (0, 1)
    narrow = replace(plan, links=(replace(first, tolerance=1.0 * plan.orbits.rate), *others))
    off = [with_(WELL.vehicles[0], phase_rms_s=1.5), *WELL.vehicles[1:]]
    (found,) = found_of(narrow, with_(WELL, vehicles=off))
    assert (found.code, found.level) == ("phase-not-kept", "warning")
    assert "without v1-v2 the team is observable still, predicted RMS" in found.message


@pytest.mark.parametrize("share", PHASES)
def test_no_phase_is_kept_that_is_half_as_spread_as_a_random_one(plan: Plan, share: float) -> None:
    anywhere = np.linspace(-0.5, 0.5, 10001) * plan.orbits.period
    half = 0.5 * float(np.sqrt(np.mean(anywhere**2)))
    assert half < min(one.tolerance for one in plan.links) / plan.orbits.rate
    first, *others = WELL.vehicles
    vehicles = [with_(first, phase_rms_s=share * half), *others]
    found = levels(plan, with_(WELL, vehicles=vehicles))
    assert found == expected("phase-not-kept", PHASES[share])


def name_of(plan: Plan, link: LinkVerdict) -> str:
    """The names of both ends, as flown_with has them."""
    names = [*plan.scenario.vehicle_names, *plan.scenario.landmark_names]
    return f"{names[link.a]}_{names[link.b]}"


def kept_all(plan: Plan) -> FlownPlan:
    """The record of a flight in which all that meet are there, none of them missed."""
    links = (*plan.links, *plan.landmark_links)
    pairs = [name_of(plan, one).split("_") for one in links]
    kept = [MeetingsFlown(between=(a, b), meetings=5, kept_share=1.0) for a, b in pairs]
    found: FlownPlan = with_(WELL, meetings_kept=kept)
    return found


def missing(record: FlownPlan, name: str, share: float) -> FlownPlan:
    """The record with that share of all meetings of one body."""
    own = {"_".join(one.between): share for one in record.meetings_kept if name in one.between}
    return flown_with(record, **own)


def test_meetings_that_nobody_needs_warn_and_their_cost_is_quoted(plan: Plan) -> None:
    pair = "v1_v2"
    kept = {1.01 - MOST_MISSED: None, 0.99 - MOST_MISSED: "warning", 0.0: "warning"}
    kept |= {LEAST_KEPT + 0.01: "warning", LEAST_KEPT - 0.01: "warning"}
    for share, level in kept.items():
        found = levels(plan, flown_with(WELL, **{pair: share}))
        assert found == expected("meetings-missed", level)
    (worst,) = found_of(plan, flown_with(WELL, **{pair: 0.13, "v2_v3": 0.9}))
    a, b = pair.split("_")
    assert f"50 flights of 200 s: {a}-{b} keeps 13 %, v2-v3 keeps 90 %" in worst.message
    assert f"; without {a}-{b} the team is observable still, predicted RMS" in worst.message
    assert worst.subjects[:2] == (a, b)


@pytest.mark.parametrize("body", ["v1", "L1"])
def test_meetings_that_the_team_needs_stop_where_most_are_missed(plan: Plan, body: str) -> None:
    record = kept_all(plan)
    kept = {0.99 - MOST_MISSED: "warning", LEAST_KEPT + 0.01: "warning"}
    kept |= {LEAST_KEPT - 0.01: "stop", 0.0: "stop"}
    for share, level in kept.items():
        found = levels(plan, missing(record, body, share))
        assert found == expected("meetings-missed", level)
    (found_of_it,) = found_of(plan, missing(record, body, 0.1))
    assert "the team is not observable" in found_of_it.message


def test_links_each_of_which_can_be_spared_are_judged_together(plan: Plan) -> None:
    record = kept_all(plan)
    own = ["_".join(one.between) for one in record.meetings_kept if "v1" in one.between]
    assert len(own) == 2
    for name in own:
        assert levels(plan, flown_with(record, **{name: 0.0})) == {"meetings-missed": "warning"}
    assert levels(plan, missing(record, "v1", 0.0)) == {"meetings-missed": "stop"}


def test_the_cost_of_a_missed_landmark_is_what_its_loss_costs() -> None:
    grazing = syncplan.plan(HARD / "grazing-landmark.json", pilot=False)
    studied = syncplan.what_if(grazing, ["L2"])
    before, after = (one.worst_predicted_rms_m for one in (studied.baseline, studied.losses[0]))
    (found,) = found_of(grazing, missing(kept_all(grazing), "L2", 0.0))
    assert found.level == "warning"
    assert f"predicted RMS {before:.3g} -> {after:.3g} m of the worst vehicle" in found.message
    assert "1.66 -> 1.82 m" in found.message


def test_meetings_by_the_way_and_those_of_older_files_are_not_judged(plan: Plan) -> None:
    assert (0, 2) not in {(one.a, one.b) for one in plan.links}
    by_the_way = MeetingsFlown(between=("v1", "v3"), meetings=5, kept_share=0.1)
    assert levels(plan, with_(WELL, meetings_kept=[by_the_way])) == {}
    assert levels(plan, with_(WELL, meetings_kept=[])) == {}


def test_meetings_that_a_slow_sensor_misses_on_the_circles_are_not_asked_for(plan: Plan) -> None:
    (link,) = (one for one in plan.links if (one.a, one.b) == (0, 1))
    contact = max(float(np.diff(one).sum()) for one in (link.forward, link.backward))
    every = np.full(6, round(2.0 * contact / plan.sensors.sample_time))
    slow = replace(plan, team=replace(plan.team, sensors=replace(plan.sensors, every=every)))
    only = with_(WELL, meetings_kept=WELL.meetings_kept[:1])
    for share, level in {0.49: None, 0.4: "warning", 0.24: "stop"}.items():
        found = levels(slow, flown_with(only, v1_v2=share))
        assert found == expected("meetings-missed", level)


def test_commands_at_their_limits_for_much_of_the_time_warn(plan: Plan) -> None:
    assert levels(plan, with_(WELL, saturated_share=MOST_SATURATED)) == {}
    (found,) = found_of(plan, with_(WELL, saturated_share=0.4))
    assert (found.code, found.level) == ("commands-saturated", "warning")
    assert "for 40 % of the time in 50 flights of 200 s" in found.message


def test_shares_and_flights_are_worded_as_they_are(plan: Plan) -> None:
    one = with_(WELL, trials=1, filter_lost_share=1.0, events=["v3 is lost at 60 s"])
    (found,) = found_of(plan, one)
    assert "lost in 100 % (2.5 % to 100 %) of 1 flight of 200 s (v3 is lost at 60 s): some" in (
        found.message
    )
    late = "sightings arrive 3 samples late"
    (found,) = found_of(plan, with_(one, trials=3, events=[*one.events, late]))
    assert f"3 flights of 200 s (v3 is lost at 60 s, {late}): some" in found.message


def test_no_cure_is_named_that_was_in_use(plan: Plan) -> None:
    def cure(**changes: Any) -> str:
        (found,) = found_of(plan, with_(WELL, **changes))
        assert found.cure is not None
        return found.cure.text

    assert "robust" in cure(filter_lost_share=0.1, filter="ekf")
    assert "robust" not in cure(filter_lost_share=0.1, filter="robust")
    assert "guidance mpc" in cure(too_close_share=0.1)
    assert "mpc" not in cure(too_close_share=0.1, guidance="mpc")
    pairs = flown_with(WELL, v1_v2=0.4).meetings_kept
    assert "steer by the estimates" in cure(meetings_kept=pairs, guidance="none")
    assert "steer by" not in cure(meetings_kept=pairs)


def signed(plan: Plan, **changes: Any) -> Plan:
    """The plan with flights that its file can show to be its own."""
    record = with_(WELL, **changes)
    digest = flight_digest(plan.scenario, plan.orbits, record)
    return replace(plan, flight=with_(record, digest=digest))


def test_a_plan_file_keeps_what_flying_has_found(plan: Plan, tmp_path: Path) -> None:
    flown = signed(plan, filter_lost_share=0.02)
    flown.save(tmp_path / "plan.json")
    read = syncplan.load_plan(tmp_path / "plan.json")
    assert read.flight == flown.flight
    values = json.loads((tmp_path / "plan.json").read_text())
    assert values["flight"]["vehicles"][0]["speed_mps"] == [3.0, 5.0]
    third = {"between": ["v3", "L1"], "meetings": 5, "kept_share": 1.0}
    assert values["flight"]["meetings_kept"][2] == third
    # a file from before it had the time at limits; it has none when written again either
    assert "saturated_share" not in values["flight"]
    signed(plan, saturated_share=0.25).save(tmp_path / "newer.json")
    newer = syncplan.load_plan(tmp_path / "newer.json").flight
    assert newer is not None
    assert newer.saturated_share == 0.25
    plan.save(tmp_path / "other.json")
    assert "flight" not in json.loads((tmp_path / "other.json").read_text())


EDITED: dict[str, Callable[[dict[str, Any]], Any]] = {
    "scenario": lambda values: values["scenario"].update(min_separation_m=12.0),
    "truth": lambda values: values["scenario"].update(truth={"motion": {"lag_s": 6.0}}),
    "orbit": lambda values: values["vehicles"][0].update(radius_m=20.001),
    "filter": lambda values: values["flight"].update(filter="ekf"),
    "figures": lambda values: values["flight"].update(out_of_contact_share=0.01),
    "digest": lambda values: values["flight"].update(digest="0" * 32),
    "earlier version": lambda values: values["flight"].pop("digest"),
}


@pytest.mark.parametrize("edit", EDITED)
def test_flights_of_a_file_do_not_count_for_what_they_did_not_fly(
    plan: Plan, tmp_path: Path, edit: str
) -> None:
    signed(plan).save(tmp_path / "plan.json")
    values = json.loads((tmp_path / "plan.json").read_text())
    assert syncplan.load_plan(tmp_path / "plan.json").verdict.flown
    EDITED[edit](values)
    for vehicle in values["vehicles"]:
        for key in ("speed_mps", "position_m", "heading_rad"):
            del vehicle[key]
    (tmp_path / "plan.json").write_text(json.dumps(values))
    read = syncplan.load_plan(tmp_path / "plan.json")
    assert read.flight is None
    assert read.verdict.headline == "GO on paper: not flown"
    (finding,) = findings_of(read, "flights-dropped")
    assert finding.level == "note"
    assert ("earlier version" in finding.message) == (edit == "earlier version")


def test_flights_count_whatever_else_is_edited(plan: Plan, tmp_path: Path) -> None:
    signed(plan).save(tmp_path / "plan.json")
    values = json.loads((tmp_path / "plan.json").read_text())
    origin = {"lat_deg": 48.0, "lon_deg": 11.0, "alt_m": 500.0}
    values["scenario"].update(name="renamed", geo_origin=origin, landmark_clearance_m=1.0)
    (tmp_path / "plan.json").write_text(json.dumps(values))
    assert syncplan.load_plan(tmp_path / "plan.json").verdict.flown


@pytest.mark.parametrize(
    "changes",
    [{"events": ["v3 is lost at 60 s"]}, {"guidance": "none"}, {"duration_s": 3.0}],
    ids=lambda changes: next(iter(changes)),
)
def test_a_verdict_does_not_rest_on_flights_of_something_else(
    plan: Plan, tmp_path: Path, changes: dict[str, Any]
) -> None:
    disturbed = signed(plan, **changes)
    assert disturbed.verdict.headline == "GO on paper: not flown"
    disturbed.save(tmp_path / "plan.json")
    read = syncplan.load_plan(tmp_path / "plan.json")
    assert read.flight is None
    (finding,) = findings_of(read, "flights-dropped")
    assert "disturbed, in open loop or of another duration" in finding.message


def test_flights_that_cannot_be_read_leave_the_rest_of_a_file(plan: Plan, tmp_path: Path) -> None:
    signed(plan).save(tmp_path / "plan.json")
    values = json.loads((tmp_path / "plan.json").read_text())
    values["flight"]["trials"] = "many"
    (tmp_path / "plan.json").write_text(json.dumps(values))
    read = syncplan.load_plan(tmp_path / "plan.json")
    assert "their record cannot be read" in findings_of(read, "flights-dropped")[0].message
    assert read.synchronisation is not None


def test_the_sidecar_of_an_export_has_phase_errors_that_were_flown(plan: Plan) -> None:
    for one, expected in ((plan, None), (replace(plan, flight=WELL), [0.2, 0.9])):
        files = syncplan.export(one, "csv").files
        (sidecar,) = (file for file in files if file.name.endswith("sync.json"))
        vehicle = json.loads(sidecar.content)["vehicles"][0]
        assert vehicle["phase_error_s"] == expected
