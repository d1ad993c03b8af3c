"""Kinds of sighting against finite differences, and the order of states of lasting errors."""

from dataclasses import fields, replace
from itertools import product

import numpy as np
import pytest

from syncplan.estimation.correction_kernels import sight_poses
from syncplan.observability.referred_rows import sighting_rows
from syncplan.orbits.circles import wrap
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.noise import ErrorSigmas
from syncplan.orbits.sighting_kinds import COMPASS, DISTANCE, SIGHTING_KINDS, place_of
from syncplan.orbits.sightings import sample_sightings
from tests.tools.draws import draw_team, sightings_of
from tests.tools.inner_kernels import called_alone


@pytest.mark.parametrize("name", SIGHTING_KINDS)
def test_slopes_are_the_derivative_of_what_is_measured(name: str) -> None:
    kind, h = SIGHTING_KINDS[name], 1e-6
    q, psi = np.random.default_rng(1).normal(size=(2, 50)), np.full(50, 0.3)
    weights = np.linspace(0.5, 2.0, 50)
    slopes = kind.slopes(q, weights)
    for axis, step in enumerate(h * np.eye(2)[:, :, None]):
        change = kind.measured(q + step, psi) - kind.measured(q - step, psi)
        np.testing.assert_allclose(slopes[axis], weights * change / (2.0 * h), rtol=1e-4)
    turned = kind.measured(q, psi + h) - kind.measured(q, psi - h)
    np.testing.assert_allclose(turned / (2.0 * h), kind.by_heading, atol=1e-8)


def test_each_sighting_is_of_a_kind_that_its_observers_sensor_measures() -> None:
    team = draw_team(np.random.default_rng(3))
    bearings = sightings_of(team, 30)
    rows = sighting_rows(team, bearings)
    some, none = np.full(team.count, np.inf), np.full(team.count, np.inf)
    some[0], none[1] = 0.5, 0.1
    sensors = replace(team.sensors, range_sigmas=some, compass_sigmas=none)
    both = replace(team, sensors=sensors)
    seen = sample_sightings(find_windows(team), team.orbits.period, both.sensors, 0, 30)
    distances, headings = seen.kinds == place_of(DISTANCE), seen.kinds == place_of(COMPASS)
    assert set(seen.observers[distances].tolist()) == {0}
    assert distances.sum() == np.sum(bearings.observers == 0) > 0
    np.testing.assert_array_equal(seen.steps[headings], np.arange(31))
    assert set(seen.observers[headings].tolist()) == set(seen.targets[headings].tolist()) == {1}
    kept = ~(distances | headings)
    for field in fields(bearings):
        np.testing.assert_array_equal(
            getattr(seen, field.name)[kept], getattr(bearings, field.name)
        )
    np.testing.assert_array_equal(sighting_rows(both, seen)[kept], rows)
    order = np.lexsort((seen.kinds, seen.targets, seen.observers, seen.steps))
    np.testing.assert_array_equal(order, np.arange(len(order)))


@pytest.mark.parametrize("compass_every", [1, 7])
def test_slow_sensors_see_at_multiples_of_their_intervals(compass_every: int) -> None:
    team = draw_team(np.random.default_rng(3))
    every = np.arange(team.count) + 1
    compasses = replace(team.sensors, compass_sigmas=np.array(0.1))
    slow = replace(compasses, every=every, compass_every=np.array(compass_every)).only(every - 1)
    windows, period = find_windows(team), team.orbits.period
    seen = sample_sightings(windows, period, slow, 1, 60)
    full = sample_sightings(windows, period, team.sensors, 1, 60)
    ready = full.steps % every[full.observers] == 0
    own = seen.kinds == place_of(COMPASS)
    assert 0 < ready.sum() < len(ready)
    np.testing.assert_array_equal(seen.steps[~own], full.steps[ready])
    np.testing.assert_array_equal(seen.targets[~own], full.targets[ready])
    read = np.arange(compass_every, 61, compass_every)
    np.testing.assert_array_equal(seen.steps[own], np.repeat(read, team.count))
    np.testing.assert_allclose(slow.compass_sigmas_each_sample, 0.1 * np.sqrt(compass_every))


def test_a_sighting_made_with_some_probability_counts_as_that_share_of_one() -> None:
    team = draw_team(np.random.default_rng(3))
    sensors = replace(team.sensors, range_sigmas=np.array(0.3), compass_sigmas=np.array(0.04))
    team = replace(team, sensors=sensors.only(np.arange(team.count)))
    seen = sightings_of(team, 30)
    missed = replace(team, sensors=replace(team.sensors, detection=np.full(team.count, 0.49)))
    share = np.where(seen.kinds == place_of(COMPASS), 1.0, 0.7)
    rows = sighting_rows(team, seen)
    np.testing.assert_allclose(sighting_rows(missed, seen), rows * share[:, None], rtol=1e-14)


def test_the_compiled_filter_has_every_kind() -> None:
    compiled, random = called_alone(sight_poses), np.random.default_rng(1)
    lanes, landmarks = 5, np.array([[3.0, -4.0]])
    for kind, target in product(SIGHTING_KINDS.values(), (1, 2)):
        x, measured = random.normal(size=(2, 3, lanes)), random.normal(size=lanes)
        row, innovation = np.full((3, lanes), np.nan), np.full(lanes, np.nan)
        seen = (place_of(kind), x.reshape(6, lanes), 0, target, 2, landmarks, measured)
        compiled(*seen, row, innovation, np.zeros(lanes, dtype=np.int8))
        there = x[1, :2] if target == 1 else landmarks[0][:, None]
        q = there - x[0, :2]
        np.testing.assert_allclose(row[:2], -kind.slopes(q, np.ones(lanes)), rtol=1e-12)
        np.testing.assert_array_equal(row[2], kind.by_heading)
        expected = measured - kind.measured(q, x[0, 2])
        if kind.unit == "rad":
            expected = wrap(expected)
        np.testing.assert_allclose(innovation, expected, atol=1e-12)


# --- errors that last -----------------------------------------------------------------------------


CONSTANT = [name for name, state in ERROR_STATES.items() if state.constant]


def test_states_follow_the_poses_in_the_order_of_the_table() -> None:
    team = draw_team(np.random.default_rng(2))
    n = team.count
    odd = np.arange(n) % 2 == 1
    sensors = replace(
        team.sensors,
        bearing_bias_sigmas=np.where(odd, 0.02, 0.0),
        bearing_walk_sigmas=np.where(odd, 0.0, 0.03),
    )
    errors = ErrorSigmas(dict.fromkeys(ERROR_STATES, 0.1), estimated=tuple(ERROR_STATES))
    team = replace(team, sensors=sensors, errors=errors)
    layout = layout_of(team)
    changing = [name for name in ERROR_STATES if name not in CONSTANT]
    assert layout.names == (*CONSTANT, *changing)
    labels = layout.labels([f"v{k + 1}" for k in range(n)])
    assert labels[:4] == ["wind x", "wind y", "speed scale of v1", "speed scale of v2"]
    walking = [label for label in labels if label.startswith("bearing walk")]
    assert walking == [f"bearing walk of v{k + 1}" for k in range(n) if not k % 2]
    assert labels[-len(walking) :] == walking
    assert labels[-len(walking) - 2 :][:2] == [f"gusts x of v{n}", f"gusts y of v{n}"]
    biased = [label for label in labels if label.startswith("bearing bias")]
    assert biased == [f"bearing bias of v{k + 1}" for k in range(n) if k % 2]
    assert layout.size == 3 * n + len(labels) == 3 * n + 2 + 2 * n + n + n + 2 * n
    assert layout_of(team, ["wind"]).size == 3 * n + 2
