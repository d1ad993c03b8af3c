"""Meetings, separation and phase, on cases made by hand."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from syncplan.estimation.filter_setup import states_of
from syncplan.guidance.flown_figures import Meetings, kept_meetings, meetings_of, nearest, off_plan
from syncplan.guidance.flown_lanes import winds_of
from syncplan.orbits.circles import Orbits, position
from syncplan.orbits.contacts import Windows
from syncplan.orbits.error_states import layout_of
from tests.tools.filter_scenes import ALL, a_team

PERIOD, TIME = 10.0, 0.1
NEVER = np.full(4, np.iinfo(np.int64).max)


def _windows(*given: tuple[int, int, float, float]) -> Windows:
    """Of observer, target, start and end."""
    pairs = sorted({(o, t) for o, t, _, _ in given})
    spans = [[(s, e) for o, t, s, e in given if (o, t) == pair] for pair in pairs]
    flat = [span for each in spans for span in each]
    return Windows(
        np.array([o for o, _ in pairs]),
        np.array([t for _, t in pairs]),
        np.cumsum([0, *(len(each) for each in spans)]),
        np.array([s for s, _ in flat]),
        np.array([e for _, e in flat]),
    )


def test_a_meeting_is_planned_once_a_period_about_its_longest_window() -> None:
    windows = _windows((0, 1, 2.0, 3.0), (1, 0, 5.0, 9.0), (1, 0, 0.5, 1.0), (1, 3, 9.0, 12.0))
    found = meetings_of(windows, TIME, PERIOD, 350)
    assert found.pairs.tolist() == [[0, 1], [1, 3]]
    # middles 7 s and 0.5 s: the first whole periods about them end at 12 s and 15.5 s
    np.testing.assert_allclose(found.first_end * TIME, [12.0, 15.5])
    assert found.times.tolist() == [3, 2]
    assert found.period == pytest.approx(100.0)


@pytest.mark.parametrize(("steps", "times"), [(119, 0), (120, 1), (219, 1), (220, 2)])
def test_only_meetings_with_a_whole_period_in_the_run_count(steps: int, times: int) -> None:
    found = meetings_of(_windows((0, 1, 5.0, 9.0)), TIME, PERIOD, steps)
    assert found.times.tolist() == [times]


def test_a_contact_that_never_ends_is_a_meeting_each_period() -> None:
    found = meetings_of(_windows((0, 1, 0.0, PERIOD)), TIME, PERIOD, 300)
    assert found.times.tolist() == [3]


def test_a_team_that_meets_nobody_has_no_meetings() -> None:
    found = meetings_of(_windows(), TIME, PERIOD, 300)
    assert found.pairs.shape == (0, 2)


def _recorded(steps: int, *made: tuple[int, int, int]) -> Any:
    """A set-up that records sightings of step, observer and target."""
    count = np.bincount([step for step, _, _ in made], minlength=steps + 1)
    ordered = sorted(made)
    return SimpleNamespace(
        first=np.concatenate([[0], np.cumsum(count)]),
        observers=np.array([o for _, o, _ in ordered]),
        targets=np.array([t for _, _, t in ordered]),
    )


MEETINGS = Meetings(np.array([[0, 1], [1, 3]]), np.array([120.0, 155.0]), np.array([3, 2]), 100.0)


def test_a_meeting_is_kept_where_one_sees_the_other_within_its_period() -> None:
    setup = _recorded(350, (30, 0, 1), (119, 1, 0), (121, 0, 3), (240, 0, 1), (156, 1, 3))
    sightings = np.ones((5, 2))
    sightings[:, 1] = [np.nan, np.nan, 1.0, 1.0, 1.0]
    kept, times = kept_meetings(MEETINGS, setup, sightings, NEVER)
    # 0-1 in [20, 120), [120, 220), [220, 320); 1-3 in [55, 155), [155, 255)
    assert kept.tolist() == [[2.0, 1.0], [1.0, 1.0]]
    assert times.tolist() == [3, 2]


def test_sightings_beyond_the_meetings_of_a_run_count_for_none() -> None:
    setup = _recorded(350, (5, 0, 1), (340, 0, 1))
    kept, _ = kept_meetings(MEETINGS, setup, np.ones((2, 1)), NEVER)
    assert kept[0, 0] == 0.0


def test_meetings_that_end_after_one_of_the_two_is_gone_are_none() -> None:
    setup = _recorded(350, (30, 0, 1), (130, 0, 1), (60, 1, 3))
    for gone, times in ((119, 0), (120, 1), (219, 1), (220, 2), (1000, 3)):
        left = NEVER.copy()
        left[1] = gone
        kept, counted = kept_meetings(MEETINGS, setup, np.ones((3, 1)), left)
        assert counted[0] == times
        assert kept[0, 0] == min(times, 2)


def test_the_closest_two_are_those_of_all_pairs_and_steps() -> None:
    generator = np.random.default_rng(2)
    path, there = generator.normal(size=(7, 5, 3, 3)), generator.random((7, 5)) < 0.7
    found = nearest(path, there)
    for lane in range(3):
        best = min(
            (float(np.hypot(*(path[k, i, :2, lane] - path[k, j, :2, lane]))), i, j, k)
            for k in range(7)
            for i in range(5)
            for j in range(i + 1, 5)
            if there[k, i] and there[k, j]
        )
        assert found.distance[lane] == pytest.approx(best[0])
        assert found.pair[lane].tolist() == [best[1], best[2]]
        assert found.step[lane] == best[3]


def test_one_vehicle_is_close_to_nobody() -> None:
    found = nearest(np.zeros((3, 2, 3, 1)), np.array([[True, False]] * 3))
    assert found.distance.tolist() == [np.inf]


def _orbits() -> Orbits:
    return Orbits(
        np.array([[0.0, 0.0], [70.0, 0.0]]),
        np.array([20.0, 15.0]),
        np.array([1.0, -1.0]),
        np.array([0.3, 3.0]),
        0.2,
    )


@pytest.mark.parametrize("late", [3.0, -7.0, 15.0])
def test_phase_is_the_time_by_which_a_vehicle_is_ahead_whatever_its_sense(late: float) -> None:
    orbits, steps = _orbits(), 50
    times = TIME * np.arange(steps + 1)
    path = np.zeros((steps + 1, 2, 3, 1))
    path[:, :, :2, 0] = position(orbits, times - late)
    off, ahead = off_plan(orbits, path, TIME)
    np.testing.assert_allclose(ahead, -late)
    chord = 2.0 * orbits.radii * abs(np.sin(0.1 * late))
    np.testing.assert_allclose(off[..., 0], np.tile(chord, (steps + 1, 1)))


def test_the_air_at_a_vehicle_is_the_wind_and_its_own_gust() -> None:
    layout = layout_of(a_team(ALL))
    x = np.arange(1.0, layout.size + 1.0)
    found = winds_of(x, states_of(layout, 0.1))
    np.testing.assert_array_equal(found, x[layout.columns["wind"]] + x[layout.columns["gusts"]])
    assert not winds_of(x, states_of(layout_of(a_team(())), 0.1)).any()


def test_a_vehicle_beside_its_circle_is_off_the_plan_and_in_phase() -> None:
    orbits = _orbits()
    times = TIME * np.arange(11)
    path = np.zeros((11, 2, 3, 1))
    path[:, :, :2, 0] = orbits.centers + 1.25 * (position(orbits, times) - orbits.centers)
    off, ahead = off_plan(orbits, path, TIME)
    np.testing.assert_allclose(off[..., 0], np.tile(0.25 * orbits.radii, (11, 1)))
    np.testing.assert_allclose(ahead, 0.0, atol=1e-9)
