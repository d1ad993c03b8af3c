"""Ranks, rows and reasons against finite differences, dense matrices and the known cases."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.observability.rank import (
    DISTINCT_LANDMARKS,
    RANK_TOLERANCE,
    assess,
    assess_team,
    link_information,
    lone_rows,
)
from syncplan.observability.referred_rows import NEAREST, sighting_rows
from syncplan.observability.unobservable_modes import name_modes
from syncplan.orbits.circles import Orbits, heading, position
from syncplan.orbits.sightings import sample_sightings
from syncplan.orbits.team import Sensors, Team
from syncplan.planning.planner import Plan, judge, plan
from syncplan.reports.plan_report import PlanDocument, plan_document
from tests.tools.draws import draw_equipped_team, draw_team, judge_team, sightings_of
from tests.tools.measurement_graphs import union_over
from tests.tools.scenarios import circling, example, small

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


@pytest.fixture(scope="module")
def documents(plans: dict[str, Plan]) -> dict[str, PlanDocument]:
    return {name: plan_document(made) for name, made in plans.items()}


@pytest.mark.parametrize("name", RANKS)
def test_the_known_formations_have_their_known_rank(name: str, plans: dict[str, Plan]) -> None:
    verdict = plans[name].observability
    assert (verdict.rank, verdict.state_dim) == RANKS[name]
    assert len(plans[name].unobservable) == verdict.state_dim - verdict.rank


@pytest.mark.parametrize("name", RANKS)
def test_the_rank_has_a_wide_gap(name: str, plans: dict[str, Plan]) -> None:
    verdict = plans[name].observability
    assert verdict.gap > 1e6
    assert verdict.singular_values[verdict.rank - 1] > 1e3 * RANK_TOLERANCE


@pytest.mark.parametrize("name", RANKS)
def test_on_the_known_formations_the_certificate_agrees_with_the_rank(
    name: str, plans: dict[str, Plan]
) -> None:
    assert plans[name].certificate.holds == plans[name].observable


def _measured(
    orbits: Orbits, landmarks: np.ndarray, poses: np.ndarray, a: int, b: int, time: float
) -> float:
    """Bearing of b from a when the vehicles start from `poses` and keep speed and turn rate."""

    def flown(k: int) -> tuple[np.ndarray, float]:
        w, v = orbits.turn_rates[k], orbits.speeds[k]
        end = poses[k, 2] + w * time
        step = [np.sin(end) - np.sin(poses[k, 2]), np.cos(poses[k, 2]) - np.cos(end)]
        return poses[k, :2] + v / w * np.array(step), end

    own, ahead = flown(a)
    target = flown(b)[0] if b < orbits.count else landmarks[b - orbits.count]
    away = target - own
    return float(np.arctan2(away[1], away[0]) - ahead)


@given(st.integers(0, 2**32 - 1))
def test_rows_of_bearings_are_the_derivative_by_the_initial_poses(seed: int) -> None:
    team = draw_team(np.random.default_rng(seed))
    orbits, landmarks, sensors = team.orbits, team.landmarks, team.sensors
    sightings = sightings_of(team, 40)
    rows = sighting_rows(team, sightings)
    scale = orbits.radii.mean()
    poses = np.column_stack([position(orbits, 0.0), heading(orbits, 0.0)])
    for s in range(0, len(rows), max(len(rows) // 10, 1)):
        a, b = int(sightings.observers[s]), int(sightings.targets[s])
        time = float(sightings.steps[s]) * sensors.sample_time
        if np.hypot(*rows[s, :2]) * sensors.bearing_sigmas[a] > 0.5 / NEAREST:
            # so near that the row is weighted down, and is no derivative any more
            continue
        for column in range(6):
            vehicle = a if column < 3 else b
            if vehicle >= orbits.count:
                assert rows[s, column] == 0.0
                continue
            unit = scale if column % 3 < 2 else 1.0
            h = 1e-6
            change = np.zeros_like(poses)
            change[vehicle, column % 3] = h * unit
            ahead = _measured(orbits, landmarks, poses + change, a, b, time)
            behind = _measured(orbits, landmarks, poses - change, a, b, time)
            turned = (ahead - behind + np.pi) % (2.0 * np.pi) - np.pi
            numeric = turned / (2.0 * h) / sensors.bearing_sigmas[a]
            assert abs(rows[s, column] - numeric) < 1e-5 * (1.0 + np.max(np.abs(rows[s])) ** 2)


@given(st.integers(0, 2**32 - 1))
def test_reducing_each_link_leaves_the_singular_values_alone(seed: int) -> None:
    team = draw_equipped_team(np.random.default_rng(seed))
    orbits = team.orbits
    sightings = sightings_of(team, 100)
    rows = sighting_rows(team, sightings)
    dense = np.zeros((len(rows), 3 * orbits.count))
    for s, (a, b) in enumerate(zip(sightings.observers, sightings.targets, strict=True)):
        dense[s, 3 * a : 3 * a + 3] += rows[s, :3]
        if b < orbits.count:
            dense[s, 3 * b : 3 * b + 3] += rows[s, 3:]
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
        certificate, verdict = judge_team(draw(np.random.default_rng(number)))
        if certificate.holds:
            held += 1
            near += verdict.singular_values[-1] < 1e-4 * verdict.singular_values[0]
            assert verdict.observable, number
    assert held > 0.4 * draws
    assert near > 0.0012 * draws, "the draws no longer come close to degenerate"


def test_a_counterexample_to_one_tolerance_for_each_link_alone_is_not_certified() -> None:
    # the weakest link passes at 1e-6 of its own largest singular value, the team's rank falls short
    certificate, verdict = judge_team(draw_team(np.random.default_rng(1024639)))
    assert not verdict.observable
    assert not certificate.holds


def test_mirror_motion_leaves_the_range_of_a_link_unobserved(plans: dict[str, Plan]) -> None:
    for link in plans["paper-grid-alternate"].links:
        assert link.rank == 2
        assert not link.certified
        assert "line of sight never turns" in link.reason


def _two(
    radii: tuple[float, float],
    phases: tuple[float, float],
    distance: float = 40.0,
    ranges: tuple[float, float] = (100.0, 100.0),
) -> Plan:
    scenario = small(
        formation={"centers_m": [[0.0, 0.0], [distance, 0.0]]},
        orbit=circling(radius_m=list(radii), direction="ccw"),
        sensor=[{"range_m": ranges[0]}, {"range_m": ranges[1]}],
    )
    orbits = Orbits(
        np.array([[0.0, 0.0], [distance, 0.0]]),
        np.array(radii),
        np.ones(2),
        np.array(phases),
        0.2,
    )
    return judge(scenario, orbits)


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


def test_two_sightings_are_too_few() -> None:
    scenario = small(
        sensor={"range_m": 50.0, "sample_time_s": 14.0},
        formation={"centers_m": [[0.0, 0.0], [89.0, 0.0]]},
    )
    made = plan(scenario)
    for link in made.links:
        assert link.rank < 3
        assert "sighting" in link.reason or "samples" in link.reason


def test_the_bridge_can_turn_about_its_only_landmark(
    documents: dict[str, PlanDocument],
) -> None:
    verdict = documents["landmark-bridge"].observability
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
    made = plan(small(formation={"centers_m": [[0, 0]]}, landmarks_m=[[30, 0], [0, 30]]))
    assert made.observable
    assert made.certificate.holds
    assert made.approach is None


def test_a_vehicle_that_sees_nothing_has_rank_zero() -> None:
    made = plan(small(formation={"centers_m": [[0, 0]]}))
    assert made.observability.rank == 0
    assert len(made.unobservable) == 3


def test_landmarks_nearly_at_one_place_count_as_one() -> None:
    apart = 0.5 * DISTINCT_LANDMARKS * 20.0
    near = plan(small(formation={"centers_m": [[0, 0]]}, landmarks_m=[[30, 0], [30, apart]]))
    assert not near.certificate.holds
    far = plan(small(formation={"centers_m": [[0, 0]]}, landmarks_m=[[30, 0], [30, 4 * apart]]))
    assert far.certificate.holds


def test_the_witness_carries_the_certificate(plans: dict[str, Plan]) -> None:
    for name in ("paper-grid-same", "triangle-lattice", "mixed-radii-camera"):
        made = plans[name]
        strong = {(link.a, link.b) for link in made.links if link.certified}
        for tree in made.certificate.witness:
            assert len(tree.vehicle_links) == len(tree.vehicles) - 1
            assert set(tree.vehicle_links) <= strong
            assert len({landmark for _, landmark in tree.landmark_links}) == 2


def test_a_window_as_long_as_the_connectivity_period_certifies_from_any_start() -> None:
    made = plan(example("paper-grid-same"))
    assert made.connectivity_period is not None
    held = [_certified_from(made, k, made.connectivity_period) for k in range(0, 315, 7)]
    assert all(held)
    short = [_certified_from(made, k, made.connectivity_period - 0.25) for k in range(315)]
    assert not all(short)


def _certified_from(made: Plan, start: int, length: float) -> bool:
    """Whether the sightings after sample start - 1, over `length` s, certify the team."""
    from syncplan.observability.rank import certify

    sample_time = made.sensors.sample_time
    last = start - 1 + round(length / sample_time)
    sightings = sample_sightings(made.windows, made.orbits.period, made.sensors, start, last)
    links = link_information(made.team, sightings)
    return certify(made.team, made.observability, links).holds


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
    made = plan(
        small(
            sensor=[
                {"range_m": 50.0, "fov_deg": 150.0},
                {"range_m": 31.0, "bearing_sigma_rad": 0.2},
            ]
        )
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
    made = plan(small(formation={"centers_m": [[0, 0]]}, landmarks_m=[[5, 0], [150, 0]]))
    (motion,) = made.unobservable
    assert motion.description == "turn of v1 about L1"
    assert "v1 passes L2 at 130 m, 80 m out of range" in motion.cure
    alone = plan(small(formation={"centers_m": [[0, 0]]}, landmarks_m=[[5, 0]]))
    assert "L1" not in alone.unobservable[0].cure.replace("other than L1", "")
    inside = plan(
        small(formation={"centers_m": [[0, 0]]}, landmarks_m=[[5, 0]], sensor={"range_m": 9})
    )
    assert all("v1 passes L1 at 15 m" in item.cure for item in inside.unobservable)


def test_a_stretch_names_no_vehicle_that_a_landmark_holds() -> None:
    made = plan(example("crooked-line-alternate"))
    for item in made.unobservable:
        assert 5 not in item.vehicles


def test_the_two_landmarks_of_a_witness_are_distinct() -> None:
    near = 0.01 * DISTINCT_LANDMARKS * 20.0
    made = plan(
        small(
            formation={"centers_m": [[0, 0]]},
            landmarks_m=[[30, 0], [30, near], [0, 30], [0, 30 + near]],
        )
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
    one = plan(small(**far, window_s=0.1))
    assert one.links[0].reason == "fewer than three sightings (2)"
    two = plan(small(**far, window_s=0.2))
    assert "fewer" not in two.links[0].reason


@pytest.mark.parametrize("phase", [0.0, 1e-12, 1e-9, 1e-7, 1e-4])
def test_a_pass_at_no_distance_does_not_drown_the_other_sightings(phase: float) -> None:
    # the circles touch, and both vehicles are there at time 0
    touching = {"centers_m": [[0, 0], [40, 0]]}
    orbit = circling(first_phase_rad=phase)
    made = plan(small(formation=touching, orbit=orbit, landmarks_m=[[30, 10], [-30, 5]]))
    assert made.observability.rank == 6
    assert made.certificate.holds


def test_a_landmark_on_the_path_does_not_drown_the_other_sightings() -> None:
    made = plan(
        small(
            formation={"centers_m": [[0, 0], [70, 0]]},
            orbit={"radius_m": 20.0, "angular_rate_rad_s": 2.0 * np.pi / 30.0},
            landmarks_m=[[0, 20], [90, 0], [-30, 0]],
        )
    )
    assert made.observability.rank == 6
    assert made.certificate.holds


def test_a_team_that_certifies_only_over_more_than_two_periods_has_no_connectivity_period() -> None:
    slow = {"range_m": 50.0, "sample_time_s": 26.0}
    made = plan(small(sensor=slow, window_s=2000.0, landmarks_m=[[-40, 0], [-40, 30]]))
    if made.connectivity_period is not None:
        assert made.connectivity_period <= 2.0 * made.orbits.period + 26.0
