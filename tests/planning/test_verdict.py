"""The verdict: what stops a flight is found, by its code, and nothing else is."""

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from syncplan.orbits.circles import position
from syncplan.planning.plan_files import loaded_from, stated
from syncplan.planning.planner import judge
from syncplan.planning.plans import Plan
from syncplan.planning.verdict_checks import CHECKS
from tests.tools.on_paper import plan
from tests.tools.scenarios import example, findings_of, planned

CROSSING = {"centers_m": [[0.0, 0.0], [25.0, 0.0]]}


def together(judged: Plan, **changes: Any) -> Plan:
    """The plan with all phases the same."""
    scenario = judged.scenario.model_copy(update=changes)
    phases = np.zeros(judged.team.count)
    return judge(scenario, replace(judged.orbits, phases=phases), bound="never")


def nearest(judged: Plan) -> float:
    """The least distance of the first two vehicles, sampled."""
    time = np.linspace(0.0, judged.orbits.period, 20_001)
    where = position(judged.orbits, time)
    return float(np.hypot(*(where[:, 0] - where[:, 1]).T).min())


def test_a_plan_that_nothing_speaks_against_is_a_go() -> None:
    verdict = plan(example("paper-grid-same")).verdict
    assert verdict.go
    assert {one.code for one in verdict.findings} == {"single-point-of-failure"}
    assert verdict.headline == "GO on paper: not flown"


def test_findings_come_in_the_order_of_their_checks() -> None:
    judged = together(planned(formation=CROSSING, landmarks_m=[[20.5, 0.0]]))
    codes = [one.code for one in judged.verdict.findings]
    assert codes == sorted(codes, key=list(CHECKS).index)


def test_every_lost_motion_stops_and_its_change_cures_it() -> None:
    scenario = example("paper-grid-alternate")
    judged = plan(scenario, bound="never")
    lost = findings_of(judged, "unobservable")
    assert len(lost) == 2
    assert judged.verdict.headline == "NO-GO: 2 reasons"
    for one in lost:
        assert one.level == "stop"
        assert "rank 16 of 18" in one.message
        assert one.cure is not None
        assert dict(one.cure.change) == {"orbit.desync_rad": 0.12}
        assert "by orbit.desync_rad 0.12" in one.cure.text
    orbit = scenario.orbit.model_copy(update={"desync_rad": 0.12})
    assert plan(scenario.model_copy(update={"orbit": orbit}), bound="never").verdict.go


def test_a_change_that_would_turn_the_team_as_a_whole_is_not_offered() -> None:
    # one sense and one phase: the line of sight never turns
    judged = together(planned(formation={"centers_m": [[0.0, 0.0], [30.0, 0.0]]}))
    stretches = [one for one in findings_of(judged, "unobservable") if "stretch" in one.message]
    assert stretches
    assert all(one.cure is not None and not one.cure.change for one in stretches)


@pytest.mark.parametrize(
    ("apart", "separation", "limit"),
    [
        (25.0, None, None),
        (25.0, 24.0, None),
        (25.0, 26.0, "min_separation_m 26"),
        (2.1, None, None),
        (1.9, None, "2 m, a tenth of the mean radius"),
        (1.9, 1.0, None),
        (0.0, 1.0, "min_separation_m 1"),
        # 0 is stated too: they may touch
        (1.9, 0.0, None),
        (0.0, 0.0, None),
    ],
)
def test_vehicles_nearer_than_stated_or_than_a_tenth_of_the_radius_stop(
    apart: float, separation: float | None, limit: str | None
) -> None:
    crossing = together(planned(formation=CROSSING), min_separation_m=separation)
    centers = np.array([[0.0, 0.0], [apart, 0.0]])
    judged = judge(crossing.scenario, replace(crossing.orbits, centers=centers), bound="never")
    reported = findings_of(judged, "vehicles-too-close")
    assert len(reported) == (limit is not None)
    for one in reported:
        assert one.level == "stop"
        assert one.subjects == ("v1", "v2")
        assert f"come to {nearest(judged):.4g} m" in one.message
        assert limit is not None
        assert limit in one.message


@pytest.mark.parametrize(
    ("written", "separation"),
    [({"version": "0.1.0"}, None), ({"version": "0.1.0", "verdict": {}}, 0.0), ({}, 0.0)],
)
def test_plans_from_before_verdicts_state_0_where_no_separation_was_given(
    written: dict[str, Any], separation: float | None
) -> None:
    judged = planned(min_separation_m=0.0)
    loaded = loaded_from({**stated(judged.scenario, judged.orbits), **written})
    assert loaded.scenario.min_separation_m == separation
    again = loaded_from(stated(loaded.scenario, judged.orbits))
    assert again.scenario.min_separation_m == separation


def test_a_separation_met_to_the_accuracy_of_a_solver_is_met() -> None:
    judged = together(planned(formation=CROSSING), min_separation_m=25.0 * (1.0 + 8e-9))
    assert findings_of(judged, "vehicles-too-close") == []
    assert judged.too_close == ()
    judged = together(judged, min_separation_m=25.0 * (1.0 + 1e-4))
    assert len(findings_of(judged, "vehicles-too-close")) == 1
    assert len(judged.too_close) == 1


def test_of_many_that_are_too_close_five_are_worded_and_the_rest_is_counted() -> None:
    judged = planned(
        formation={"shape": "line", "count": 8, "spacing_m": 70.0}, min_separation_m=90.0
    )
    each = findings_of(judged, "vehicles-too-close")
    assert len(each) == 6
    assert each[-1].message.startswith("2 more pairs")


@pytest.mark.parametrize(
    ("landmark", "clearance", "nearer"),
    [
        ([20.5, 0.0], None, 0.5),
        ([0.0, 0.0], None, None),
        ([23.0, 0.0], None, None),
        ([23.0, 0.0], 4.0, 3.0),
        ([20.5, 0.0], 0.4, None),
        ([20.5, 0.0], 0.0, None),
    ],
)
def test_a_landmark_is_an_obstacle(
    landmark: list[float], clearance: float | None, nearer: float | None
) -> None:
    judged = planned(landmarks_m=[landmark, [0.0, 90.0]], landmark_clearance_m=clearance)
    reported = findings_of(judged, "landmark-too-close")
    assert len(reported) == (nearer is not None)
    where = position(judged.orbits, np.linspace(0.0, judged.orbits.period, 20_001))[:, 0]
    least = float(np.hypot(*(where - landmark).T).min())
    for one in reported:
        assert one.subjects == ("v1", "L1")
        assert f"at {least:.4g} m" in one.message
        assert nearer == pytest.approx(least, abs=1e-3)


def test_landmarks_near_large_teams_are_found_by_the_spatial_index(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    landmarks = [[20.5, 0.0], [0.0, 90.0], [-19.0, 0.0], [52.0, 0.0], [0.0, 0.0]]
    judged = planned(landmarks_m=landmarks, landmark_clearance_m=3.0)
    reported = findings_of(judged, "landmark-too-close")
    assert [one.subjects for one in reported] == [("v1", "L1"), ("v1", "L3"), ("v2", "L4")]
    monkeypatch.setattr("syncplan.orbits.contacts.DENSE_LIMIT", 1)
    assert findings_of(replace(judged), "landmark-too-close") == reported


SQUARE = [[15.0, -5.0], [25.0, -5.0], [25.0, 5.0], [15.0, 5.0]]
INNER = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]]
ALL_ROUND = [[-90.0, -90.0], [200.0, -90.0], [200.0, 90.0], [-90.0, 90.0]]


@pytest.mark.parametrize(
    ("key", "polygon", "code"),
    [
        ("keep_out_m", [SQUARE], "in-keep-out"),
        ("keep_out_m", [ALL_ROUND], "in-keep-out"),
        ("keep_out_m", [INNER], None),
        ("area_m", INNER, "outside-area"),
        ("area_m", SQUARE, "outside-area"),
        ("area_m", ALL_ROUND, None),
    ],
)
def test_circles_keep_to_the_area_and_out_of_what_is_closed(
    key: str, polygon: Any, code: str | None
) -> None:
    judged = planned(**{key: polygon})
    codes = {one.code for one in judged.verdict.stops} - {"unobservable"}
    assert codes == ({code} if code else set())


def test_a_speed_that_refinement_may_still_mend_stops_till_then() -> None:
    limits = {"speed_mps": [1.0, 3.0]}
    refine = {"vary": ["phases", "radii"], "radius_m": [10.0, 15.0]}
    judged = planned(limits=limits, refine=refine)
    reported = findings_of(judged, "over-limit")
    assert {one.subjects for one in reported} == {(name,) for name in judged.scenario.vehicle_names}
    assert "4 m/s; limits.speed_mps allows 1 to 3" in reported[0].message


def test_links_that_are_lost_or_nearly_lost_are_warned_of() -> None:
    apart = {"centers_m": [[0.0, 0.0], [60.0, 0.0]]}
    sensor = {"range_m": 20.01, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1}
    judged = planned(formation=apart, sensor=sensor)
    (fragile,) = findings_of(judged, "link-fragile")
    assert fragile.level == "warning"
    late = judged.links[0].tolerance / judged.orbits.rate
    assert f"v1-v2 by {late:.3g} s" in fragile.message
    longer = planned(formation=apart, sensor={**sensor, "range_m": 30.0})
    assert findings_of(longer, "link-fragile") == []
    parted = together(judged)
    (lost,) = findings_of(parted, "link-lost")
    assert lost.level == "warning"
    assert lost.subjects == ("v1", "v2")


def test_a_verdict_is_found_once_and_afresh_for_a_changed_plan(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    judged = planned(landmarks_m=[[20.5, 0.0], [0.0, 90.0]])
    reported: list[str] = []
    for code, check in list(CHECKS.items()):

        def counted(one: Any, code: str = code, check: Any = check) -> Any:
            reported.append(code)
            return check(one)

        monkeypatch.setitem(CHECKS, code, counted)
    assert judged.verdict is judged.verdict
    assert reported == list(CHECKS)
    cleared = replace(
        judged, scenario=judged.scenario.model_copy(update={"landmark_clearance_m": 0.0})
    )
    assert len(cleared.verdict.stops) == len(judged.verdict.stops) - 1
    assert pickle.loads(pickle.dumps(judged)).verdict == judged.verdict
