"""Phases for limited fields of view, and margins with a separation, against brute force."""

import numpy as np
import pytest
from hypothesis import example as known
from hypothesis import given, settings
from hypothesis import strategies as st

from syncplan.orbits.contacts import closest_approach, find_windows
from syncplan.planning.plans import Plan
from syncplan.reports.plan_report import PlanDocument, plan_document
from syncplan.synchronisation.contact_tables import contact_of_pairs, tabulated_contact
from syncplan.synchronisation.difference_tables import most_served
from syncplan.synchronisation.phase_rules import residuals, rules_of
from syncplan.synchronisation.phases import synchronise
from tests.searches.phases import graph_share, margin_shortfall, tree_share
from tests.tools.obstructed import covered
from tests.tools.on_paper import plan
from tests.tools.phase_teams import cameras, contact_curves, draw_seeing, team_of
from tests.tools.scenarios import example, planned

EQUILATERAL = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
ALL = np.array([[0, 1], [1, 2], [0, 2]])


def _camera_pair(**sensor: float) -> Plan:
    """Two vehicles that look to their left, and past each other where they come nearest."""
    return planned(
        formation={"centers_m": [[0, 0], [52, 0]]},
        landmarks_m=[[0, 28], [0, -28]],
        sensor={"range_m": 41.0, "fov_deg": 110.0, "boresight_deg": 80.0, **sensor},
    )


def test_a_camera_pair_meets_every_turn_though_not_where_it_comes_nearest() -> None:
    made = _camera_pair()
    assert not made.dropped_links
    (link,) = made.links
    assert abs(link.residual) > 1.0
    # 1.1008 s of 31.4 is the most of 7,200 phases by sampled sight
    assert link.contact > 1.09
    assert made.observable
    assert made.verdict.go


def test_a_pair_that_no_phases_let_see_each_other_says_so() -> None:
    made = _camera_pair(fov_deg=60.0, boresight_deg=90.0)
    assert not made.links
    (lost,) = made.dropped_links
    assert lost.reason.startswith("at no phases does either vehicle")
    codes = {one.code: one for one in made.verdict.findings}
    assert codes["link-lost"].subjects == ("v1", "v2")
    assert "unobservable" in codes
    assert not made.verdict.go


def test_links_that_exclude_each_other_are_served_one_by_one() -> None:
    # 40 cos(x / 2) >= 54 - 18 needs residuals x within 51.7 degrees, and three add up to 180
    team = team_of(54.0 * EQUILATERAL, ALL, cameras(3, 18.0, np.radians(300.0), 0.0))
    found = team.synchronised()
    (lost,) = found.dropped
    assert "by itself this link could be in contact for" in lost.reason
    contact = contact_of_pairs(team.flown(found.phases), team.pairs)
    most = contact_curves(team, 720).max(axis=1)
    assert contact[lost.link] == 0.0
    # the two that are left are a tree
    assert np.delete(contact / most, lost.link).min() > 0.95


def test_an_all_round_view_leaves_the_phases_as_they_are() -> None:
    for name in ("five-ring", "triangle-alternate", "paper-grid-same"):
        made = plan(example(name), bound="never")
        orbits = made.orbits
        pairs = np.array([(link.a, link.b) for link in made.links])
        first = made.scenario.orbit.first_phase_rad
        without = synchronise(
            orbits.centers, orbits.radii, orbits.senses, made.sensors.ranges, pairs, first
        )
        assert made.synchronisation is not None
        assert made.synchronisation.phases.tobytes() == without.phases.tobytes()
        assert made.synchronisation.attainable is None


def test_rules_are_met_where_the_view_costs_nothing() -> None:
    made = planned(sensor={"range_m": 50.0, "fov_deg": 359.0, "boresight_deg": 90.0})
    assert made.synchronisation is not None
    assert made.synchronisation.method == "closed form"
    assert made.synchronisation.margin == pytest.approx(20.0)
    assert abs(made.links[0].residual) < 1e-12


@pytest.mark.parametrize("apart", [0.0, 25.0])
def test_vehicles_whose_circles_cross_see_each_other_and_stay_apart(apart: float) -> None:
    # in range of each other for ever if they flew in step, one upon the other
    team = team_of(
        np.array([[0.0, 0.0], [apart, 0.0]]),
        np.array([[0, 1]]),
        cameras(2, 60.0, np.radians(200.0), 0.0),
    )
    found = team.synchronised()
    nearest = closest_approach(team.orbits(found.phases))
    assert nearest is not None
    assert nearest.distance >= 2.0 - 1e-3
    assert contact_of_pairs(team.flown(found.phases), team.pairs)[0] > 0.5


@given(st.integers(0, 2**32 - 1))
def test_the_contact_of_a_residual_is_what_sampled_windows_hold(seed: int) -> None:
    generator = np.random.default_rng(seed)
    team = draw_seeing(generator, tree=True)
    if len(team.pairs) == 0:
        return
    pairs = team.pairs[:1]
    phases = generator.uniform(0.0, 2.0 * np.pi, team.count)
    rules = rules_of(team.orbits(phases), team.sensors.ranges, pairs)
    table = tabulated_contact(rules, team.flown(np.zeros(team.count)))
    # at a sample of the table: between two, a degree apart, contact may begin like a square root
    off = residuals(rules, team.senses * phases)[0] - np.radians(generator.integers(360))
    a = pairs[0, 0]
    phases[a] -= team.senses[a] * off
    at = table.at(residuals(rules, team.senses * phases)[:, None])[0, 0]
    assert 0.0 <= at <= 1.0 + 1e-12
    flown = team.flown(phases)
    windows = find_windows(flown, (pairs.ravel(), pairs[:, ::-1].ravel()))
    time = np.linspace(0.0, 2.0 * np.pi, 4001)[:-1]
    seen = covered(windows.of(0), time, 2.0 * np.pi) | covered(windows.of(1), time, 2.0 * np.pi)
    assert contact_of_pairs(flown, pairs)[0] == pytest.approx(seen.mean(), abs=2e-3)
    assert at * table.attainable[0] == pytest.approx(seen.mean(), abs=2e-3)


@settings(max_examples=settings().max_examples // 2)
@given(st.integers(0, 2**32 - 1))
@known(443913051)  # equal circles in step, at the edge of range
def test_a_tree_has_nine_tenths_of_the_contact_of_every_link(seed: int) -> None:
    assert tree_share(np.random.default_rng(seed)) >= 0.9


def test_links_just_below_the_floor_count_in_part_and_a_conflict_counts_against_all() -> None:
    worth = np.array([[0.3, 0.15, -0.5, 0.3], [0.2, np.inf, 0.05, -np.inf]])
    np.testing.assert_allclose(most_served(0.2, 0.1)(worth), [2.0, 0.5, 0.0, -np.inf], atol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_linked_teams_see_as_much_as_brute_force_finds(seed: int) -> None:
    share = graph_share(np.random.default_rng([7, seed]))
    assert share is None or share >= 0.95


@pytest.mark.parametrize("seed", range(6))
def test_margins_that_keep_a_separation_reach_brute_force(seed: int) -> None:
    short = margin_shortfall(np.random.default_rng([7, seed]))
    assert short is None or short <= 0.01


@pytest.mark.parametrize(("side", "margin"), [(33.0, 29.23), (35.0, 27.73), (50.0, 34.92)])
def test_triangles_of_two_senses_reach_their_largest_margin(side: float, margin: float) -> None:
    # by brute force over 360 x 360 phases; the search used to end at 26.1 m, 25.4 m and 34.9 m
    team = team_of(
        side * EQUILATERAL,
        ALL,
        cameras(3, 50.0, 2.0 * np.pi, 0.0),
        senses=np.array([1.0, -1.0, 1.0]),
        separation=14.6,
    )
    found = team.synchronised()
    nearest = closest_approach(team.orbits(found.phases))
    assert found.margin is not None
    assert nearest is not None
    assert not found.dropped
    assert found.margin >= margin - 0.02
    assert nearest.distance >= 14.6


def test_a_ring_of_six_cameras_shares_what_can_be_seen() -> None:
    """Six vehicles are too many for the cell search; each link alone bounds the smallest share."""
    angles = np.arange(6) * (np.pi / 3.0)
    team = team_of(
        60.0 * np.column_stack([np.cos(angles), np.sin(angles)]),
        np.array([[k, (k + 1) % 6] for k in range(6)]),
        cameras(6, 50.0, np.radians(120.0), np.radians(60.0)),
    )
    found = team.synchronised()
    most = contact_curves(team, 720).max(axis=1)
    share = contact_of_pairs(team.flown(found.phases), team.pairs) / most
    assert found.method == "largest contact"
    assert not found.dropped
    assert share.min() > 0.9


def test_a_link_without_a_contact_share_still_loads() -> None:
    document = plan_document(_camera_pair())
    share = document.links[0].contact_share
    assert share is not None
    assert 0.97 < share <= 1.0
    written = document.as_json()
    assert written["links"][0]["contact_share"] == share
    del written["links"][0]["contact_share"]
    older = PlanDocument.model_validate(written)
    assert older.links[0].contact_share is None
    assert "contact_share" not in older.as_json()["links"][0]


def test_a_vehicle_shared_by_two_blocks_keeps_one_phase() -> None:
    """Two triangles that share a vehicle: each is as good as by itself."""
    centers = 56.0 * np.concatenate([EQUILATERAL, -EQUILATERAL[1:]])
    links = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [3, 4], [0, 4]])
    sensors = cameras(5, 60.0, np.radians(170.0), np.radians(40.0))
    both = team_of(centers, links, sensors)
    phases = both.synchronised().phases
    found = contact_of_pairs(both.flown(phases), both.pairs)
    alone = team_of(centers[:3], ALL, sensors.only(np.arange(3)))
    by_itself = contact_of_pairs(alone.flown(alone.synchronised().phases), alone.pairs)
    assert found[:3].min() == pytest.approx(by_itself.min(), rel=1e-6)
    assert found[3:].min() == pytest.approx(by_itself.min(), rel=0.03)
