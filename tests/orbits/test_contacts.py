"""Contact windows: closed forms, symmetries, and samples."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import (
    close_pairs,
    find_windows,
    merge_windows,
    outer_gaps,
    reachable_pairs,
    smallest_outer_gap,
)
from syncplan.orbits.sightings import sample_sightings
from syncplan.orbits.team import Team
from tests.tools.draws import NOISE
from tests.tools.obstructed import compare, covered, draw_obstructed
from tests.tools.on_paper import plan
from tests.tools.phase_teams import cameras
from tests.tools.scenarios import example


def _pair(
    distance: float,
    senses: tuple[float, float] = (1.0, 1.0),
    phases: tuple[float, float] = (0.3, 0.3 + np.pi),
    reach: float = 50.0,
    view: float = 2.0 * np.pi,
) -> Team:
    centers = np.array([[0.0, 0.0], [distance, 0.0]])
    orbits = Orbits(centers, np.full(2, 20.0), np.array(senses), np.array(phases), rate=1.0)
    return Team(orbits, np.array([[3.0, 4.0]]), cameras(2, reach, view, 0.0), NOISE)


@pytest.mark.parametrize("senses", [(1.0, -1.0), (-1.0, -1.0)])
@pytest.mark.parametrize("reach", [29.9, 30.1, 60.0, 109.9, 110.1, 500.0])
@pytest.mark.parametrize("view", [2.0 * np.pi, 0.2, np.pi, 5.5])
def test_near_tangent_permanent_and_absent_contact(
    senses: tuple[float, float], reach: float, view: float
) -> None:
    team = _pair(70.0, senses=senses, phases=(0.3, np.pi - 0.3), reach=reach, view=view)
    assert compare(team).mismatches == ()


def test_contact_exactly_at_the_range_limit_all_the_time_counts() -> None:
    # same circle radius and phase: the distance is constant and equal to the range
    team = _pair(50.0, phases=(0.7, 0.7), reach=50.0)
    np.testing.assert_allclose(find_windows(team).of(0), [[0.0, team.orbits.period]])


def test_a_tangent_of_the_range_opens_no_more_than_an_instant() -> None:
    vehicle = find_windows(_pair(70.0, phases=(0.0, np.pi), reach=30.0)).of(0)
    assert np.sum(vehicle[:, 1] - vehicle[:, 0]) < 1e-5


def test_the_spatial_index_finds_the_same_pairs_as_all_pairs() -> None:
    generator = np.random.default_rng(5)
    count = 700
    places, radii = generator.uniform(0.0, 900.0, (count, 2)), generator.uniform(1.0, 30.0, count)
    orbits = Orbits(places, radii, np.ones(count), np.zeros(count), 1.0)
    landmarks = generator.uniform(0.0, 900.0, (20, 2))
    reach = generator.uniform(5.0, 60.0, count)
    a, b = reachable_pairs(orbits, reach, landmarks)
    centers, all_radii = np.concatenate([places, landmarks]), np.append(radii, np.zeros(20))
    distance = np.hypot(*(centers[None] - places[:, None]).transpose(2, 0, 1))
    own = radii[:, None]
    gap = np.maximum(distance - own - all_radii, abs(own - all_radii) - distance)
    gap[np.arange(count), np.arange(count)] = np.inf
    expected = np.argwhere(gap <= reach[:, None])
    np.testing.assert_array_equal(np.column_stack([a, b]), expected)


def test_the_nearest_circles_are_the_same_with_the_spatial_index(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    generator = np.random.default_rng(6)
    radii = np.append(generator.uniform(1.0, 30.0, 299), 200.0)
    for side in (600.0, 9000.0):
        centers = generator.uniform(0.0, side, (300, 2))
        every = close_pairs(centers, radii, 0.0)
        gaps = outer_gaps(centers, radii, every)
        smallest = smallest_outer_gap(centers, radii)
        assert smallest == gaps.min()
        with monkeypatch.context() as patched:
            patched.setattr("syncplan.orbits.contacts.DENSE_LIMIT", 2)
            for gap in (-50.0, 5.0, 20.0):
                near = close_pairs(centers, radii, gap)
                kept = near[outer_gaps(centers, radii, near) <= gap]
                np.testing.assert_array_equal(kept, every[gaps <= gap])
                assert len(near) < len(every)
            assert smallest_outer_gap(centers, radii) == smallest
    assert smallest_outer_gap(centers[:1], radii[:1]) == np.inf


def test_merged_windows_cover_what_their_parts_cover() -> None:
    merged = merge_windows(np.array([[9.0, 11.0], [0.5, 2.0], [1.0, 3.0]]), 10.0)
    np.testing.assert_allclose(merged, [[9.0, 13.0]])
    np.testing.assert_allclose(merge_windows(np.array([[0.0, 6.0], [5.0, 10.5]]), 10.0), [[0, 10]])
    assert merge_windows(np.zeros((0, 2)), 10.0).shape == (0, 2)


@given(st.integers(0, 2**32 - 1))
def test_sightings_are_the_samples_inside_windows(seed: int) -> None:
    team = draw_obstructed(np.random.default_rng(seed))
    windows, period, steps = find_windows(team), team.orbits.period, 400
    sightings = sample_sightings(windows, period, team.sensors, 1, steps)
    time = np.arange(1, steps + 1) * team.sensors.sample_time
    for pair, (a, b) in enumerate(zip(windows.observers, windows.targets, strict=True)):
        inside = covered(windows.of(pair), time % period, period)
        since = (time[:, None] - windows.of(pair).ravel() + 1e-9) % period
        clear = since.min(axis=1, initial=np.inf) >= 2e-9
        taken = sightings.steps[(sightings.observers == a) & (sightings.targets == b)]
        times_taken = np.bincount(taken, minlength=steps + 1)[1:]
        np.testing.assert_array_equal(times_taken[clear], inside[clear])


def test_a_pair_exactly_at_reach_is_found_in_large_teams_too() -> None:
    def pairs(count: int) -> set[tuple[int, int]]:
        centers = np.column_stack([9.03 * np.arange(count), np.zeros(count)])
        orbits = Orbits(centers, np.full(count, 2.01), np.ones(count), np.zeros(count), 1.0)
        a, b = reachable_pairs(orbits, np.full(count, 5.01))
        return set(zip(a.tolist(), b.tolist(), strict=True))

    assert {pair for pair in pairs(600) if max(pair) < 400} == pairs(400)


@pytest.mark.parametrize("rate", [0.2, 2.0 * np.pi / 30.0, 1.0, 0.37])
def test_a_sample_on_a_windows_edge_counts_in_every_turn(rate: float) -> None:
    orbits = Orbits(np.zeros((1, 2)), np.array([20.0]), np.ones(1), np.zeros(1), rate)
    sample_time = orbits.period / 12.0
    reach = np.sqrt(2000.0 - 1600.0 * np.cos(np.pi / 6.0))
    sensors = replace(cameras(1, reach, 2.0 * np.pi, 0.0), sample_time=sample_time)
    windows = find_windows(Team(orbits, np.array([[40.0, 0.0]]), sensors, NOISE))
    turns = 20
    sightings = sample_sightings(windows, orbits.period, sensors, 1, 12 * turns)
    assert set((sightings.steps % 12).tolist()) == {0, 1, 11}
    assert len(sightings.steps) == 3 * turns


def test_the_union_of_both_ways_holds_what_either_sees() -> None:
    made = plan(example("mixed-radii-camera"))
    period = made.orbits.period
    t = np.linspace(0.0, period, 5000, endpoint=False)
    one_sided = 0
    for link in made.links:
        forward, backward = (covered(w, t, period) for w in (link.forward, link.backward))
        np.testing.assert_array_equal(covered(link.windows, t, period), forward | backward)
        one_sided += int(np.any(forward & ~backward)) + int(np.any(backward & ~forward))
    assert one_sided >= 2


def test_same_sense_range_windows_have_their_closed_form() -> None:
    # |q|^2 = D^2 + m^2 - 2 D m cos(tau - tau0), m = 40, D = 70: half width arccos(0.7142857...)
    start, end = find_windows(_pair(70.0)).of(0)[0]
    half = np.arccos((70.0**2 + 40.0**2 - 50.0**2) / (2.0 * 70.0 * 40.0))
    assert abs((end - start) - 2.0 * half) < 1e-12
