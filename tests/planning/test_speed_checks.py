"""Findings on the wind and on room for errors: levels change where closed forms say."""

from dataclasses import replace
from math import exp, hypot, log, sqrt
from typing import Any

import numpy as np
import pytest

import syncplan
from syncplan.planning.path_checks import wind_made_up_for
from syncplan.planning.planner import Plan, judge
from tests.tools.flown import WELL
from tests.tools.scenarios import changed, findings_of

HIGH = 6.0
QUANTILE = sqrt(-2.0 * log(0.05))


@pytest.fixture(scope="module")
def plan() -> Plan:
    return syncplan.plan(changed("paper-grid-same"), pilot=False)


def in_wind(plan: Plan, wind: dict[str, float], **keys: Any) -> Plan:
    """The grid with its circles at 4 m/s judged in a wind, with airspeeds from 1 m/s to HIGH."""
    limits = {"speed_mps": [1.0, HIGH]}
    scenario = changed("paper-grid-same", **{"limits": limits, "wind": wind, **keys})
    return judge(scenario, plan.orbits, bound="never", single_points=False)


@pytest.mark.parametrize("speed", [0.5, 3.0, 5.9])
def test_a_turn_at_full_airspeed_in_the_wind_made_up_for_takes_a_period(speed: float) -> None:
    wind = wind_made_up_for(speed, HIGH)
    course = np.linspace(0.0, 2.0 * np.pi, 4000, endpoint=False)
    across = wind * np.sin(course)
    over_ground = wind * np.cos(course) + np.sqrt(HIGH**2 - across**2)
    assert np.mean(1.0 / over_ground) == pytest.approx(1.0 / speed, rel=1e-9)
    assert HIGH - speed < wind < HIGH


def test_a_vehicle_with_no_airspeed_to_spare_makes_up_for_no_wind() -> None:
    assert wind_made_up_for(HIGH, HIGH) == 0.0
    assert wind_made_up_for(1e-9, HIGH) == pytest.approx(HIGH)


def test_wind_warns_where_it_takes_all_airspeed_and_stops_where_turns_take_longer(
    plan: Plan,
) -> None:
    most = wind_made_up_for(4.0, HIGH)
    levels = {0.99 * (HIGH - 4.0): None, 1.01 * (HIGH - 4.0): "warning"}
    levels |= {0.99 * most: "warning", 1.01 * most: "stop"}
    for strongest, level in levels.items():
        sigma = strongest / QUANTILE
        # gusts count as the wind does
        for wind in (
            {"sigma_mps": sigma},
            {"sigma_mps": 0.6 * sigma, "gust_sigma_mps": 0.8 * sigma},
        ):
            all_found = findings_of(in_wind(plan, wind), "over-limit")
            assert [one.level for one in all_found] == ([] if level is None else [level])
            held = {"warning": HIGH - 4.0, "stop": most, None: 0.0}[level]
            share = 1.0 - exp(-0.5 * (held / sigma) ** 2)
            for one in all_found:
                assert f"v1 needs {4.0 + strongest:.3g} m/s" in one.message
                assert f"in {100.0 * share:.3g} % of winds" in one.message
                assert set(one.subjects) == set(plan.scenario.vehicle_names)
    assert findings_of(in_wind(plan, {"sigma_mps": 6.0}, limits=None), "over-limit") == []


def test_wind_over_half_the_ground_speed_warns_with_limits_and_without(plan: Plan) -> None:
    for limits in (None, {"speed_mps": [0.1, 50.0]}):
        assert findings_of(in_wind(plan, {"sigma_mps": 1.99}, limits=limits), "strong-wind") == []
        (one,) = findings_of(in_wind(plan, {"sigma_mps": 2.01}, limits=limits), "strong-wind")
        assert one.level == "warning"
        assert one.cure is not None
        assert "fly" in one.cure.text


def test_a_start_warns_where_its_sigma_is_over_the_room_of_the_nearest(plan: Plan) -> None:
    assert plan.approach is not None
    room, turn = plan.approach.distance, 0.2
    swept = sqrt(2.0 * (1.0 - exp(-0.5 * turn**2))) * 20.0
    enough = sqrt(0.5 * room**2 - swept**2)
    for sigma, warned in ((0.99 * enough, False), (1.01 * enough, True)):
        start = {"position_m": sigma, "heading_rad": turn}
        judged = in_wind(plan, {}, initial_sigma=start)
        found = findings_of(judged, "start-uncertain")
        assert len(found) == warned
        for one in found:
            assert one.level == "warning"
            assert one.cure is not None
            assert "fly" in one.cure.text
        assert findings_of(replace(judged, flight=WELL), "start-uncertain") == []
    # what is to be kept apart is no room
    judged = in_wind(plan, {}, initial_sigma=start, min_separation_m=1.0)
    assert "29 m to min_separation_m 1" in findings_of(judged, "start-uncertain")[0].message


def off_by(plan: Plan, errors: list[float]) -> Plan:
    """The plan with other errors of a coordinate predicted, in m."""
    rms = sqrt(2.0) * np.array(errors)
    return replace(plan, prediction=replace(plan.prediction, rms=rms))


def test_predicted_errors_warn_where_two_sigma_use_up_the_separation(plan: Plan) -> None:
    assert plan.approach is not None
    k, least = (plan.approach.a, plan.approach.b), plan.approach.distance
    errors = [0.01] * 6
    for share, warned in ((0.99, False), (1.01, True)):
        errors[k[0]], errors[k[1]] = (share * one * 0.5 * least for one in (0.6, 0.8))
        assert hypot(errors[k[0]], errors[k[1]]) == pytest.approx(0.5 * share * least)
        judged = off_by(plan, errors)
        assert bool(findings_of(judged, "separation-uncertain")) == warned
        assert findings_of(replace(judged, flight=WELL), "separation-uncertain") == []


def test_predicted_errors_warn_where_they_may_end_meetings_that_are_needed(plan: Plan) -> None:
    (link,) = (one for one in plan.landmark_links if one.a == 2)
    room = float(plan.sensors.ranges[2]) - link.min_distance
    for share, warned in ((0.99, False), (1.01, True)):
        errors = [0.01] * 6
        errors[2] = 0.5 * share * room
        judged = off_by(plan, errors)
        mine = findings_of(judged, "meetings-uncertain")
        assert bool(mine) == warned
        assert findings_of(replace(judged, flight=WELL), "meetings-uncertain") == []
    assert "v3-L1 by 1.98 sigma" in mine[0].message
    # one end of a link that can be spared: phases a hundred times as far off as its own bear
    spare = next(one for one in plan.links if (one.a, one.b) == (1, 4))
    narrow = replace(spare, tolerance=1e-4)
    links = tuple(narrow if one is spare else one for one in plan.links)
    assert findings_of(replace(off_by(plan, [0.2] * 6), links=links), "meetings-uncertain") == []
