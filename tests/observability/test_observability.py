"""Ranks and reasons against dense matrices and the known cases."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.observability.rank import (
    DISTINCT_LANDMARKS,
    assess,
    assess_team,
    link_information,
    lone_rows,
)
from syncplan.observability.referred_rows import dense_rows, state_rows
from syncplan.observability.spectrum import RANK_TOLERANCE
from syncplan.observability.unobservable_modes import name_modes
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.team import Sensors, Team
from syncplan.planning.planner import Plan, judge, plan
from syncplan.reports.plan_report import plan_document
from tests.tools.draws import draw_equipped_team, draw_team, sightings_of
from tests.tools.measurement_graphs import union_over
from tests.tools.scenarios import circling, example, planned

RANKS = {
    "paper-grid-same": (18, 18),
    "paper-grid-alternate": (16, 18),
    "crooked-line-alternate": (13, 18),
    "triangle-lattice": (36, 36),
    "five-ring": (15, 15),
    "landmark-bridge": (5, 6),
    "four-ground-robots": (12, 12),
    "mixed-radii-camera": (12, 12),
    "triangle-alternate": (6, 9),
}


@pytest.fixture(scope="module")
def plans() -> dict[str, Plan]:
    return {name: plan(example(name)) for name in RANKS}


@pytest.mark.parametrize("name", RANKS)
def test_the_known_formations_have_their_known_rank(name: str, plans: dict[str, Plan]) -> None:
    verdict = plans[name].observability
    assert (verdict.rank, verdict.state_dim) == RANKS[name]
    assert len(plans[name].unobservable) == verdict.state_dim - verdict.rank
    assert verdict.gap > 1e6
    assert verdict.singular_values[verdict.rank - 1] > 1e3 * RANK_TOLERANCE
    assert plans[name].certificate.holds == plans[name].observable


@given(st.integers(0, 2**32 - 1))
def test_reducing_each_link_leaves_the_singular_values_alone(seed: int) -> None:
    team = draw_equipped_team(np.random.default_rng(seed))
    sightings = sightings_of(team, 100)
    dense = dense_rows(state_rows(team, sightings, layout_of(team, [])), 3 * team.count)
    alone = lone_rows(team, sightings)
    verdict = assess(team, link_information(team, sightings), alone)
    values = np.linalg.svd(dense, compute_uv=False)
    largest = max(float(values.max(initial=0.0)), 1e-300)
    count = min(len(values), verdict.state_dim)
    np.testing.assert_allclose(
        verdict.singular_values[:count], values[:count], atol=1e-12 * largest
    )


@pytest.mark.parametrize(
    ("draw", "draws"), [(draw_team, 1500), (draw_equipped_team, 600)], ids=["plain", "equipped"]
)
def test_no_certificate_holds_without_full_rank(
    draw: Callable[[np.random.Generator], Team], draws: int
) -> None:
    held = near = 0
    for number in range(draws):
        team = draw(np.random.default_rng(number))
        assessed = assess_team(team, team.orbits.period)
        verdict = assessed.observability
        if assessed.certificate.holds:
            held += 1
            near += verdict.singular_values[-1] < 1e-4 * verdict.singular_values[0]
            assert verdict.observable, number
    assert held > 0.4 * draws
    assert near > 0.0012 * draws, "the draws no longer come close to degenerate"


def test_a_counterexample_to_one_tolerance_for_each_link_alone_is_not_certified() -> None:
    # the weakest link passes at 1e-6 of its own largest singular value, the team's rank falls short
    team = draw_team(np.random.default_rng(1024639))
    assessed = assess_team(team, team.orbits.period)
    assert not assessed.observability.observable
    assert not assessed.certificate.holds


def test_mirror_motion_leaves_the_range_of_a_link_unobserved(plans: dict[str, Plan]) -> None:
    for link in plans["paper-grid-alternate"].links:
        assert link.rank == 2
        assert not link.certified
        assert "line of sight never turns" in link.reason


def _two(
    radii: tuple[float, float],
    phases: tuple[float, float],
    ranges: tuple[float, float] = (100.0, 100.0),
) -> Plan:
    made = planned(
        formation={"centers_m": [[0.0, 0.0], [40.0, 0.0]]},
        orbit=circling(radius_m=list(radii), direction="ccw"),
        sensor=[{"range_m": ranges[0]}, {"range_m": ranges[1]}],
    )
    return judge(made.scenario, replace(made.orbits, phases=np.array(phases)), bound="never")


def test_one_way_sighting_at_the_degenerate_ratio_loses_a_turn() -> None:
    # 25 and 20 m at 36.87 degrees: R_j = R_i cos(phi_i - phi_j), all three conditions of Lemma 3.1
    exact = _two((25.0, 20.0), (0.0, float(np.arccos(0.8))), ranges=(100.0, 1.0))
    assert exact.links[0].rank == 2
    assert "one-way" in exact.links[0].reason
    off = _two((25.0, 20.0), (0.0, float(np.arccos(0.8)) + 0.05), ranges=(100.0, 1.0))
    assert off.links[0].rank == 3
    both_ways = _two((25.0, 20.0), (0.0, float(np.arccos(0.8))))
    assert both_ways.links[0].rank == 3


def test_parallel_headings_with_unequal_radii_have_full_rank() -> None:
    assert _two((25.0, 20.0), (0.4, 0.4)).links[0].rank == 3


def test_parallel_motion_at_equal_speed_loses_the_distance() -> None:
    link = _two((20.0, 20.0), (0.4, 0.4)).links[0]
    assert link.rank == 2
    assert "parallel motion" in link.reason


def test_the_bridge_can_turn_about_its_only_landmark(plans: dict[str, Plan]) -> None:
    verdict = plan_document(plans["landmark-bridge"]).observability
    assert not verdict.certificate.holds
    assert "v2" in verdict.certificate.reason
    (motion,) = verdict.unobservable
    assert motion.description == "turn of v2 about L2"
    assert motion.vehicles == ["v2"]
    assert "L1" in motion.cure


@pytest.mark.parametrize("name", ["paper-grid-alternate", "crooked-line-alternate"])
def test_named_motions_are_null_vectors(name: str, plans: dict[str, Plan]) -> None:
    made = plans[name]
    verdict = made.observability
    for item in made.unobservable:
        assert "stretch" in item.description
        vector = (item.motion / [verdict.scale, verdict.scale, 1.0]).ravel()
        vector /= np.linalg.norm(vector)
        inside = verdict.null_space @ vector
        assert abs(np.linalg.norm(inside) - 1.0) < 1e-6
        moving = set(np.flatnonzero(np.abs(item.motion).max(axis=1) > 1e-9).tolist())
        assert moving == set(item.vehicles)


def test_a_team_without_landmarks_shifts_and_turns(plans: dict[str, Plan]) -> None:
    names = [item.description for item in plans["triangle-alternate"].unobservable]
    assert names == [
        "shift of everything along x",
        "shift of everything along y",
        "turn of everything about its middle",
    ]


def test_a_lone_vehicle_with_two_landmarks_is_certified() -> None:
    made = planned(formation={"centers_m": [[0, 0]]}, landmarks_m=[[30, 0], [0, 30]])
    assert made.observable
    assert made.certificate.holds
    assert made.approach is None


def test_a_vehicle_that_sees_nothing_has_rank_zero() -> None:
    made = planned(formation={"centers_m": [[0, 0]]})
    assert made.observability.rank == 0
    assert len(made.unobservable) == 3


def test_landmarks_nearly_at_one_place_count_as_one() -> None:
    apart = 0.5 * DISTINCT_LANDMARKS * 20.0
    near = planned(formation={"centers_m": [[0, 0]]}, landmarks_m=[[30, 0], [30, apart]])
    assert not near.certificate.holds
    far = planned(formation={"centers_m": [[0, 0]]}, landmarks_m=[[30, 0], [30, 4 * apart]])
    assert far.certificate.holds


def test_the_witness_carries_the_certificate(plans: dict[str, Plan]) -> None:
    for name in ("paper-grid-same", "triangle-lattice", "mixed-radii-camera"):
        made = plans[name]
        strong = {(link.a, link.b) for link in made.links if link.certified}
        for tree in made.certificate.witness:
            assert len(tree.vehicle_links) == len(tree.vehicles) - 1
            assert set(tree.vehicle_links) <= strong
            assert len({landmark for _, landmark in tree.landmark_links}) == 2


def test_the_rpmg_switches_and_its_union_grows(plans: dict[str, Plan]) -> None:
    made = plans["paper-grid-same"]
    period = made.orbits.period
    at_start = union_over(made.windows, period, 0.0, 0.0)
    whole = union_over(made.windows, period, 0.0, period)
    assert set(at_start.edges) < set(whole.edges)
    assert whole.number_of_edges() == 16
    later = union_over(made.windows, period, 10.0, 0.0)
    assert set(later.edges) != set(at_start.edges)


def test_more_samples_in_a_period_raise_the_information_not_a_faster_team() -> None:
    # design.md 2.6: per period the log-determinant falls as the rate rises
    values = []
    for rate in (0.2, 0.4, 1.0):
        scenario = example("paper-grid-same")
        orbit = scenario.orbit.model_copy(update={"angular_rate_rad_s": rate})
        made = plan(scenario.model_copy(update={"orbit": orbit}))
        values.append(2.0 * np.sum(np.log(made.observability.singular_values)))
    assert values[0] > values[1] > values[2]


def test_coarse_sensors_do_not_change_a_rank_but_their_sigma_scales_the_values() -> None:
    scenario = example("paper-grid-same")
    one = plan(scenario).observability.singular_values
    sensor = scenario.sensor.model_copy(update={"bearing_sigma_rad": 0.2})  # type: ignore[union-attr]
    two = plan(scenario.model_copy(update={"sensor": sensor})).observability.singular_values
    np.testing.assert_allclose(one, 2.0 * two, rtol=1e-10)


def test_a_sensor_can_be_given_for_each_vehicle() -> None:
    made = planned(
        sensor=[
            {"range_m": 50.0, "fov_deg": 150.0},
            {"range_m": 31.0, "bearing_sigma_rad": 0.2},
        ]
    )
    assert isinstance(made.sensors, Sensors)
    np.testing.assert_allclose(made.sensors.ranges, [50.0, 31.0])
    assert made.links[0].forward.size != 0
    assert made.links[0].contact >= float(np.sum(np.diff(made.links[0].backward)))


@given(st.integers(0, 2**32 - 1))
def test_the_modes_named_span_the_null_space(seed: int) -> None:
    team = draw_team(np.random.default_rng(seed))
    assessed = assess_team(team, 20.5 * team.sensors.sample_time)
    verdict = assessed.observability
    names = [f"v{k}" for k in range(team.count)]
    modes = name_modes(assessed, names, [f"L{k}" for k in range(len(team.landmarks))])
    assert len(modes) == verdict.state_dim - verdict.rank
    vectors = []
    for item in modes:
        vector = (item.motion / [verdict.scale, verdict.scale, 1.0]).ravel()
        vectors.append(vector / np.linalg.norm(vector))
        inside = verdict.null_space.T @ (verdict.null_space @ vectors[-1])
        assert np.linalg.norm(vectors[-1] - inside) < 2e-3
    if vectors:
        assert np.linalg.svd(np.array(vectors), compute_uv=False)[-1] > 1e-3


def test_the_cure_states_how_far_out_of_range_the_nearest_landmark_is() -> None:
    made = planned(formation={"centers_m": [[0, 0]]}, landmarks_m=[[5, 0], [150, 0]])
    (motion,) = made.unobservable
    assert motion.description == "turn of v1 about L1"
    assert "v1 passes L2 at 130 m, 80 m out of range" in motion.cure
    alone = planned(formation={"centers_m": [[0, 0]]}, landmarks_m=[[5, 0]])
    assert "L1" not in alone.unobservable[0].cure.replace("other than L1", "")
    inside = planned(formation={"centers_m": [[0, 0]]}, landmarks_m=[[5, 0]], sensor={"range_m": 9})
    assert all("v1 passes L1 at 15 m" in item.cure for item in inside.unobservable)


def test_a_stretch_names_no_vehicle_that_a_landmark_holds() -> None:
    made = plan(example("crooked-line-alternate"))
    for item in made.unobservable:
        assert 5 not in item.vehicles


def test_the_two_landmarks_of_a_witness_are_distinct() -> None:
    near = 0.01 * DISTINCT_LANDMARKS * 20.0
    made = planned(
        formation={"centers_m": [[0, 0]]},
        landmarks_m=[[30, 0], [30, near], [0, 30], [0, 30 + near]],
    )
    (tree,) = made.certificate.witness
    (_, one), (_, two) = tree.landmark_links
    places = made.landmarks[[one, two]]
    assert np.hypot(*(places[0] - places[1])) > DISTINCT_LANDMARKS * 20.0


def test_the_gap_is_the_ratio_round_the_rank() -> None:
    verdict = plan(example("paper-grid-alternate")).observability
    values = verdict.singular_values
    assert verdict.gap == pytest.approx(values[15] / values[16])


def test_the_window_holds_the_samples_before_its_end() -> None:
    far = {"formation": {"centers_m": [[0, 0], [70, 0]]}, "sensor": {"range_m": 500.0}}
    one = planned(**far, window_s=0.1)
    assert one.links[0].reason == "fewer than three sightings (2)"
    two = planned(**far, window_s=0.2)
    assert "fewer" not in two.links[0].reason


@pytest.mark.parametrize(
    ("centers", "orbit", "landmarks"),
    [
        # the circles touch, and both vehicles are there at time 0
        *(
            ([[0, 0], [40, 0]], circling(first_phase_rad=phase), [[30, 10], [-30, 5]])
            for phase in (0.0, 1e-12, 1e-9, 1e-7, 1e-4)
        ),
        # a landmark on the path
        (
            [[0, 0], [70, 0]],
            circling(angular_rate_rad_s=2.0 * np.pi / 30.0),
            [[0, 20], [90, 0], [-30, 0]],
        ),
    ],
)
def test_a_pass_at_no_distance_does_not_drown_the_other_sightings(
    centers: Any, orbit: Any, landmarks: Any
) -> None:
    made = planned(formation={"centers_m": centers}, orbit=orbit, landmarks_m=landmarks)
    assert made.observability.rank == 6
    assert made.certificate.holds


def test_a_team_that_certifies_only_over_more_than_two_periods_has_no_connectivity_period() -> None:
    slow = {"range_m": 50.0, "sample_time_s": 26.0}
    made = planned(sensor=slow, window_s=2000.0, landmarks_m=[[-40, 0], [-40, 30]])
    if made.connectivity_period is not None:
        assert made.connectivity_period <= 2.0 * made.orbits.period + 26.0
