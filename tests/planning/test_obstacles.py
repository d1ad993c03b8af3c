"""Plans among obstacles: links that lose sight, phases past a wall, hidden landmarks."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from syncplan.landmarks.site_information import candidate_information
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.sightings import Loss, remainder_of
from syncplan.planning.planner import judge
from syncplan.planning.plans import Plan
from tests.tools.phase_teams import meet_when_shifted
from tests.tools.scenarios import circling, findings_of, planned

WALL = [[33.0, -60.0], [37.0, -60.0], [37.0, 60.0], [33.0, 60.0]]
LANDMARKS = [[0.0, 40.0], [70.0, 40.0]]


def made(**changes: Any) -> Plan:
    return planned(**{"landmarks_m": LANDMARKS, **changes})


def test_a_link_behind_a_wall_is_dropped_and_the_wall_is_named() -> None:
    away = [[500.0, 0.0], [510.0, 0.0], [505.0, 9.0]]
    judged = made(obstacles_m=[away, WALL])
    assert not judged.links
    (lost,) = judged.dropped_links
    assert lost.reason == "sight is blocked by obstacles_m[1] at all phases"
    (reported,) = findings_of(judged, "link-lost")
    assert reported.subjects == ("v1", "v2")
    assert reported.cure is not None
    assert "nothing between them" in reported.cure.text


def test_a_link_that_given_phases_keep_behind_a_wall_says_so() -> None:
    # past the wall's end there is sight, but not where these phases meet
    judged = made(obstacles_m=[[[33.0, -60.0], [37.0, -60.0], [37.0, 10.0], [33.0, 10.0]]])
    (link,) = judged.links
    assert link.contact > 0.0
    at_the_bottom = replace(judged.orbits, phases=np.array([-0.3, np.pi - 0.3]))
    (lost,) = judge(judged.scenario, at_the_bottom, bound="never").dropped_links
    assert lost.reason.startswith("comes within range, but sight is always blocked by obstacles_m")


def test_a_wall_beside_the_line_of_centres_leaves_the_plan_as_it_was() -> None:
    beside = [[33.0, 60.0], [37.0, 60.0], [37.0, 90.0], [33.0, 90.0]]
    without, judged = made(), made(obstacles_m=[beside])
    assert judged.orbits.phases.tobytes() == without.orbits.phases.tobytes()
    assert judged.windows.starts.tobytes() == without.windows.starts.tobytes()
    assert judged.links[0].tolerance == without.links[0].tolerance


def test_a_landmark_within_an_obstacle_is_warned_of_and_one_on_its_outline_is_not() -> None:
    judged = made(landmarks_m=[[0.0, 40.0], [35.0, 20.0], [33.0, 10.0]], obstacles_m=[WALL])
    (reported,) = findings_of(judged, "landmark-hidden")
    assert reported.level == "warning"
    assert reported.subjects == ("L2",)
    assert "L2 lies within obstacles_m[0]" in reported.message
    seen = {link.b - judged.team.count for link in judged.landmark_links}
    assert seen == {0, 2}
    assert findings_of(made(), "landmark-hidden") == []


def test_a_vehicle_that_flies_within_an_obstacle_is_warned_of() -> None:
    hall = [[-30.0, -30.0], [100.0, -30.0], [100.0, 50.0], [-30.0, 50.0]]
    judged = made(obstacles_m=[WALL, hall])
    (reported,) = findings_of(judged, "vehicle-hidden")
    assert reported.level == "warning"
    assert reported.subjects == ("v1", "v2")
    assert "v1, v2 lies within obstacles_m[1]" in reported.message
    # a path that only passes through is sometimes seen, and one round an obstacle always
    inner = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]]
    crossed = [[0.0, -30.0], [100.0, -30.0], [100.0, 50.0], [0.0, 50.0]]
    (reported,) = findings_of(made(obstacles_m=[inner, crossed]), "vehicle-hidden")
    assert reported.subjects == ("v2",)


def test_a_cure_says_that_an_obstacle_is_nearby() -> None:
    landmarks = [[0.0, 40.0], [60.0, 0.0]]
    behind = made(obstacles_m=[WALL], landmarks_m=landmarks).unobservable[0]
    assert "v1 passes L2 at 40 m, within range, with an obstacle nearby" in behind.cure
    free = made(landmarks_m=[[0.0, 40.0]], obstacles_m=[[[500, 0], [501, 0], [500, 9]]])
    assert "obstacle" not in free.unobservable[0].cure


def test_sites_for_landmarks_are_judged_with_sight_blocked() -> None:
    judged = made(obstacles_m=[WALL])
    sites = np.array([[33.0, 0.0], [37.0, 0.0], [35.0, 0.0], [35.0, 64.0]])
    information = candidate_information(judged, sites)
    pairs = set(zip(information.vehicles.tolist(), information.sites.tolist(), strict=True))
    # one on either side of the wall, one within, one beyond its end
    assert {pair for pair in pairs if pair[1] < 3} == {(0, 0), (1, 1)}
    free = candidate_information(made(), sites)
    assert free.seen_by.tolist() == [2, 2, 2, 0]


def test_what_is_left_after_a_loss_has_the_windows_of_that_team() -> None:
    judged = made(obstacles_m=[[[33.0, -60.0], [37.0, -60.0], [37.0, 10.0], [33.0, 10.0]]])
    rest = remainder_of(judged.team, Loss(landmarks=(0,)))
    left, afresh = rest.windows(judged.windows), find_windows(rest.team)
    np.testing.assert_array_equal(left.starts, afresh.starts)
    np.testing.assert_array_equal(left.ends, afresh.ends)


@pytest.mark.parametrize("direction", ["ccw", "alternate"])
def test_phases_are_chosen_for_where_the_wall_ends(direction: str) -> None:
    wall = [[33.0, -60.0], [37.0, -60.0], [37.0, 6.0], [33.0, 6.0]]
    orbit = circling(direction=direction)
    judged = made(orbit=orbit, obstacles_m=[wall])
    (link,) = judged.links
    most = 0.0
    for phase in np.linspace(0.0, 2.0 * np.pi, 121):
        orbits = replace(judged.orbits, phases=np.array([judged.orbits.phases[0], phase]))
        windows = find_windows(judged.team.on(orbits), (np.array([0]), np.array([1])))
        most = max(most, float(np.sum(windows.ends - windows.starts)))
    assert 0.97 * most < link.contact <= most + 0.01
    assert judged.synchronisation is not None
    share = link.contact / judged.orbits.period
    assert judged.synchronisation.attainable is not None
    assert share <= judged.synchronisation.attainable[0, 1] + 1e-9


def test_a_phase_that_slips_by_more_than_its_tolerance_loses_sight() -> None:
    # always within range: sight alone can be lost, when one is low while the other is high
    sensor = {"range_m": 120.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1}
    wall = [[33.0, -60.0], [37.0, -60.0], [37.0, 6.0], [33.0, 6.0]]
    judged = made(sensor=sensor, obstacles_m=[wall])
    (link,) = judged.links
    assert link.tolerance < made(sensor=sensor).links[0].tolerance == np.pi

    assert meet_when_shifted(judged, 0.999 * link.tolerance)
    assert meet_when_shifted(judged, -0.999 * link.tolerance)
    beyond = (1.001 * link.tolerance, -1.001 * link.tolerance)
    assert not all(meet_when_shifted(judged, slip) for slip in beyond)


def test_a_link_that_nothing_can_serve_has_no_say_in_the_senses() -> None:
    # a triangle of links, which can't alternate all round: v1-v3 behind the wall is the odd one out
    centers = [[0.0, 0.0], [70.0, 0.0], [35.0, 60.6]]
    across = np.array([[-30.0, -5.0], [30.0, -5.0], [30.0, 5.0], [-30.0, 5.0]])
    turn = np.radians(150.0)
    way = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    wall = (across @ way + np.array([17.5, 30.3])).tolist()
    orbit = circling(direction="alternate")
    judged = made(orbit=orbit, formation={"centers_m": centers}, obstacles_m=[wall])
    assert [(link.a, link.b) for link in judged.dropped_links] == [(0, 2)]
    assert judged.orbits.senses.tolist() == [1.0, -1.0, 1.0]
    assert judged.synchronisation is not None
    assert judged.synchronisation.odd_cycle == ()
