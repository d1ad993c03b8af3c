"""Ranks and reasons against dense matrices and the known cases."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example as known
from hypothesis import given
from hypothesis import strategies as st

from syncplan.observability.rank import (
    DISTINCT_LANDMARKS,
    Assessment,
    assess,
    assess_remainder,
    assess_team,
    link_information,
    lone_rows,
)
from syncplan.observability.referred_rows import dense_rows, state_rows
from syncplan.observability.spectrum import RANK_TOLERANCE
from syncplan.observability.unobservable_modes import name_modes
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.sighting_kinds import of_targets
from syncplan.orbits.sightings import Loss, remainder_of, single_losses
from syncplan.orbits.team import Team
from syncplan.planning.planner import judge
from syncplan.planning.plans import Plan
from syncplan.reports.plan_report import plan_document
from tests.tools.draws import draw_equipped_team, draw_parallel_team, draw_team, sightings_of
from tests.tools.on_paper import plan
from tests.tools.scenarios import changed, circling, example, planned

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
    return {name: plan(example(name), bound="never") for name in RANKS}


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
    links = link_information(team, sightings)
    assert all(link.a < link.b for link in links)
    verdict = assess(team, links, lone_rows(team, sightings))
    values = np.linalg.svd(dense, compute_uv=False)
    largest = max(float(values.max(initial=0.0)), 1e-300)
    count = min(len(values), verdict.state_dim)
    np.testing.assert_allclose(
        verdict.singular_values[:count], values[:count], atol=1e-12 * largest
    )


@pytest.mark.parametrize(
    ("draw", "draws", "degenerate"),
    [
        # of the last, the weakest link passes at 1e-6 of its own largest singular value
        (draw_team, 400, [638, 651, 685, 792, 1091, 1165, 1195, 1024639]),
        (draw_equipped_team, 200, [225, 253, 447]),
    ],
    ids=["plain", "equipped"],
)
def test_no_certificate_holds_without_full_rank(
    draw: Callable[[np.random.Generator], Team], draws: int, degenerate: list[int]
) -> None:
    held = near = 0
    for number in [*range(draws), *degenerate]:
        team = draw(np.random.default_rng(number))
        assessed = assess_team(team, team.orbits.period)
        verdict = assessed.observability
        if assessed.certificate.holds:
            held += 1
            near += verdict.singular_values[-1] < 1e-4 * verdict.singular_values[0]
            assert verdict.observable, number
    assert held > 0.4 * draws
    assert near > 2, "the draws no longer come close to degenerate"


def test_mirror_motion_leaves_the_range_of_a_link_unobserved(plans: dict[str, Plan]) -> None:
    for made in (plans["paper-grid-alternate"], plans["crooked-line-alternate"]):
        for link in made.links:
            assert link.rank == 2
            assert not link.certified
            assert "line of sight never turns" in link.reason
        verdict, rank = made.observability, made.observability.rank
        for item in made.unobservable:
            assert "stretch" in item.description
            vector = (item.motion / [verdict.scale, verdict.scale, 1.0]).ravel()
            inside = np.linalg.norm(verdict.null_space @ vector)
            assert abs(inside / np.linalg.norm(vector) - 1.0) < 1e-6
        ratio = verdict.singular_values[rank - 1] / verdict.singular_values[rank]
        assert verdict.gap == pytest.approx(ratio)


# three conditions of Lemma 3.1 lose a turn to one-way sighting: R_j = R_i cos(phi_i - phi_j)
DEGENERATE = float(np.arccos(0.8))


@pytest.mark.parametrize(
    ("radii", "phases", "reach", "rank", "words"),
    [
        ([25.0, 20.0], [0.0, DEGENERATE], 1.0, 2, "one-way"),
        ([25.0, 20.0], [0.0, DEGENERATE + 0.05], 1.0, 3, ""),
        ([25.0, 20.0], [0.0, DEGENERATE], 100.0, 3, ""),
        ([25.0, 20.0], [0.4, 0.4], 100.0, 3, ""),
        ([20.0, 20.0], [0.4, 0.4], 100.0, 2, "parallel motion"),
    ],
)
def test_a_link_of_one_sense_has_the_rank_that_its_radii_phases_and_ranges_allow(
    radii: list[float], phases: list[float], reach: float, rank: int, words: str
) -> None:
    made = planned(
        formation={"centers_m": [[0.0, 0.0], [40.0, 0.0]]},
        orbit=circling(radius_m=radii, direction="ccw"),
        sensor=[{"range_m": 100.0}, {"range_m": reach}],
    )
    orbits = replace(made.orbits, phases=np.array(phases))
    (link,) = judge(made.scenario, orbits, bound="never").links
    assert link.rank == rank
    assert words in link.reason


def test_the_bridge_can_turn_about_its_only_landmark(plans: dict[str, Plan]) -> None:
    verdict = plan_document(plans["landmark-bridge"]).observability
    assert not verdict.certificate.holds
    assert "v2" in verdict.certificate.reason
    (motion,) = verdict.unobservable
    assert motion.description == "turn of v2 about L2"
    assert motion.vehicles == ["v2"]
    assert "L1" in motion.cure


def test_a_team_without_landmarks_shifts_and_turns(plans: dict[str, Plan]) -> None:
    names = [item.description for item in plans["triangle-alternate"].unobservable]
    assert names == [
        "shift of everything along x",
        "shift of everything along y",
        "turn of everything about its middle",
    ]


def test_landmarks_nearly_at_one_place_count_as_one() -> None:
    apart = 0.5 * DISTINCT_LANDMARKS * 20.0
    near = planned(formation={"centers_m": [[0, 0]]}, landmarks_m=[[30, 0], [30, apart]])
    assert not near.certificate.holds
    far = planned(formation={"centers_m": [[0, 0]]}, landmarks_m=[[30, 0], [30, 4 * apart]])
    assert far.certificate.holds
    assert far.observable
    assert far.approach is None


def test_the_witness_carries_the_certificate(plans: dict[str, Plan]) -> None:
    for name in ("paper-grid-same", "triangle-lattice", "mixed-radii-camera"):
        made = plans[name]
        strong = {(link.a, link.b) for link in made.links if link.certified}
        for tree in made.certificate.witness:
            assert len(tree.vehicle_links) == len(tree.vehicles) - 1
            assert set(tree.vehicle_links) <= strong
            assert len({landmark for _, landmark in tree.landmark_links}) == 2


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
        if not item.description.startswith("joint motion"):
            moving = np.flatnonzero(np.abs(item.motion).max(axis=1) > 1e-9)
            assert set(moving.tolist()) == set(item.vehicles)
    if vectors:
        assert np.linalg.svd(np.array(vectors), compute_uv=False)[-1] > 1e-3


@given(st.integers(0, 2**32 - 1))
# names that come close: shifts and a stretch that change sightings by 5e-6 to 3e-5 of the largest
@known(455)
@known(1280)
@known(1485)
def test_a_motion_changes_no_sighting_by_more_than_the_tolerance_of_the_rank(seed: int) -> None:
    generator = np.random.default_rng(seed)
    team = draw_parallel_team(generator)
    steps = generator.choice([10.5, 30.5, team.orbits.period / team.sensors.sample_time])
    assessed = assess_team(team, steps * team.sensors.sample_time)
    verdict = assessed.observability
    modes = name_modes(assessed, ["v"] * team.count, ["L"] * len(team.landmarks))
    assert len(modes) == verdict.state_dim - verdict.rank
    rows = dense_rows(state_rows(team, assessed.sightings, layout_of(team, [])), 3 * team.count)
    for mode in modes:
        vector = (mode.motion / [verdict.scale, verdict.scale, 1.0]).ravel()
        change = np.linalg.norm(rows @ vector) / np.linalg.norm(vector)
        assert change <= 1.001 * RANK_TOLERANCE * assessed.largest, mode.description


def test_the_cure_states_how_far_out_of_range_the_nearest_landmark_is() -> None:
    made = planned(formation={"centers_m": [[0, 0]]}, landmarks_m=[[5, 0], [150, 0]])
    (motion,) = made.unobservable
    assert motion.description == "turn of v1 about L1"
    assert "v1 passes L2 at 130 m, 80 m out of range" in motion.cure
    alone = planned(formation={"centers_m": [[0, 0]]}, landmarks_m=[[5, 0]])
    assert "L1" not in alone.unobservable[0].cure.replace("other than L1", "")
    inside = planned(formation={"centers_m": [[0, 0]]}, landmarks_m=[[5, 0]], sensor={"range_m": 9})
    assert inside.observability.rank == 0
    assert len(inside.unobservable) == 3
    assert all("v1 passes L1 at 15 m" in item.cure for item in inside.unobservable)


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


def test_the_window_holds_the_samples_before_its_end() -> None:
    far = {"formation": {"centers_m": [[0, 0], [70, 0]]}, "sensor": {"range_m": 500.0}}
    one = planned(**far, window_s=0.1)
    assert one.links[0].reason == "fewer than three sightings (2)"
    two = planned(**far, window_s=0.2)
    assert "fewer" not in two.links[0].reason


TOUCHING, NEAR_ONE = [[0, 0], [40, 0]], [[30, 10], [-30, 5]]
SLOWER = circling(angular_rate_rad_s=2.0 * np.pi / 30.0)


@pytest.mark.parametrize(
    ("centers", "orbit", "landmarks"),
    [
        # the circles touch, and both vehicles are there at time 0
        *(
            (TOUCHING, circling(first_phase_rad=phase), NEAR_ONE)
            for phase in (0.0, 1e-12, 1e-9, 1e-7, 1e-4)
        ),
        # a landmark on the path
        ([[0, 0], [70, 0]], SLOWER, [[0, 20], [90, 0], [-30, 0]]),
    ],
)
def test_a_pass_at_no_distance_does_not_drown_the_other_sightings(
    centers: Any, orbit: Any, landmarks: Any
) -> None:
    made = planned(formation={"centers_m": centers}, orbit=orbit, landmarks_m=landmarks)
    assert made.observability.rank == 6
    assert made.certificate.holds


# --- distances and compasses ----------------------------------------------------------------------


def _boats(**keys: object) -> Plan:
    """Twenty boats along a coast, of which one passes the lighthouse."""
    given = {
        "orbit": {"radius_m": 60, "speed_mps": 3, "direction": "ccw"},
        "formation": {"shape": "line", "count": 20, "spacing_m": 180},
        "landmarks_m": {"lighthouse": [-140, 40]},
        "sensor": {
            "range_m": 150,
            "bearing_sigma_rad": 0.02,
            "sample_time_s": 0.5,
            "interval_s": 1.0,
            "range_sigma_m": 2.0,
            "detection_probability": 0.8,
        },
        "heading_sigma_rad": 0.03,
        **keys,
    }
    return planned(**given)


def _ranks(made: Plan) -> tuple[int, int]:
    return made.observability.rank, made.observability.state_dim


def test_twenty_boats_are_located_but_turn_about_the_lighthouse_without_their_compasses() -> None:
    assert _ranks(_boats()) == (60, 60)
    made = _boats(heading_sigma_rad=None)
    assert _ranks(made) == (59, 60)
    (mode,) = made.unobservable
    assert mode.description == "turn of everything about lighthouse"


def test_boats_with_compasses_and_no_lighthouse_shift_but_do_not_turn() -> None:
    made = _boats(landmarks_m=None)
    names = [mode.description for mode in made.unobservable]
    assert names == ["shift of everything along x", "shift of everything along y"]
    assert all(mode.cure.startswith("sightings of a landmark") for mode in made.unobservable)


def test_a_distance_gives_mirror_motion_the_rank_that_bearings_leave_out() -> None:
    measured = plan(changed("paper-grid-alternate", sensor={"range_sigma_m": 0.5}), bound="never")
    assert _ranks(measured) == (18, 18)
    assert all(link.rank == 3 and link.reason == "" for link in measured.links)
    assert measured.certificate.holds


def test_a_weak_distance_is_not_taken_for_a_lost_turn() -> None:
    # bearings alone lose the distance; one of 1e6 m sigma leaves it all but lost
    made = plan(changed("paper-grid-alternate", sensor={"range_sigma_m": 1e3}), bound="never")
    for link in made.links:
        assert link.rank == 3 or "never turns" in link.reason or "degenerate" in link.reason
        assert "ratio of radii" not in link.reason


@pytest.mark.parametrize("seed", range(15))
def test_what_a_loss_leaves_is_what_the_team_left_sees(seed: int) -> None:
    team = draw_equipped_team(np.random.default_rng(seed))
    assessed = assess_team(team, team.orbits.period)
    for loss in single_losses(team):
        left = remainder_of(team, loss)
        if left.team.count:
            _same(assess_remainder(assessed, left), assess_team(left.team, team.orbits.period))


def _same(one: Assessment, other: Assessment) -> None:
    for name in ("steps", "observers", "targets", "kinds"):
        np.testing.assert_array_equal(getattr(one.sightings, name), getattr(other.sightings, name))
    values = one.observability.singular_values, other.observability.singular_values
    np.testing.assert_allclose(*values, rtol=1e-12, atol=1e-12 * (1.0 + values[0][0]))


def test_a_boat_without_its_camera_keeps_its_compass() -> None:
    assessed = assess_team(_boats().team, 120.0)
    left = assess_remainder(assessed, remainder_of(assessed.team, Loss(sensors=(19,))))
    own = ~of_targets(left.sightings.kinds)
    assert np.sum(own & (left.sightings.observers == 19)) == 240
    assert not np.any(~own & (left.sightings.observers == 19))


def test_contact_that_no_sighting_falls_into_says_so() -> None:
    orbit = circling(direction="ccw", first_phase_rad=1.5)
    sensor = {"range_m": 40.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1, "interval_s": 100.0}
    made = planned(orbit=orbit, landmarks_m=[[0, -40]], sensor=sensor)
    (link,), (landmark,) = made.links, made.landmark_links
    assert link.contact > 0.0
    assert link.reason == landmark.reason == "in contact only between sightings (interval_s)"
