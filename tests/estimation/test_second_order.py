"""Second-order noise: moments of the second-order term, and the same from both kernels."""

from dataclasses import replace

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.estimation.augmented_curvature import curved_variances
from syncplan.estimation.augmented_setup import without_errors
from syncplan.estimation.extended_filter import EXTENDED
from syncplan.estimation.filter_setup import BEARING_KIND, COMPASS_KIND, DISTANCE_KIND, Readings
from syncplan.estimation.filter_statistics import empty_series, empty_statistics
from syncplan.estimation.second_order import second_order_lanes, second_order_variance
from tests.estimation.test_further_states import Scene, a_team, filtered, scene_of

KINDS = {"bearing": BEARING_KIND, "distance": DISTANCE_KIND}


def noise_of(kind: int, q: Array, P: Array) -> float:
    """The variance at a relative position q (2,) of covariance P (2, 2)."""
    x, y = q.tolist()
    return second_order_variance(kind, x, y, P[0, 0], P[0, 1], P[1, 1])


def curvature(kind: int, q: Array) -> Array:
    """(2, 2) second derivative of a sighting by the relative position, by differences."""

    def seen(place: Array) -> float:
        if kind == DISTANCE_KIND:
            return float(np.hypot(*place))
        # about the line of sight, where no branch is cut
        return float(np.arctan2(q[0] * place[1] - q[1] * place[0], q @ place))

    h, axes = 1e-3, np.eye(2)
    return np.array(
        [
            [
                sum(a * b * seen(q + h * (a * one + b * two)) for a in (1, -1) for b in (1, -1))
                / (4.0 * h * h)
                for one in axes
            ]
            for two in axes
        ]
    )


@pytest.mark.parametrize("name", KINDS)
def test_the_variance_is_that_of_the_second_order_term(name: str) -> None:
    """Isserlis: e' H e / 2 has the variance tr(H P H P) / 2 where e is normal."""
    random = np.random.default_rng(2)
    for _ in range(20):
        q, root = random.uniform(-20.0, 20.0, 2), random.normal(size=(2, 2))
        P, H = root @ root.T, curvature(KINDS[name], q)
        found = noise_of(KINDS[name], q, P)
        np.testing.assert_allclose(found, 0.5 * np.trace(H @ P @ H @ P), rtol=1e-4)


@pytest.mark.parametrize("name", KINDS)
def test_drawn_sightings_spread_as_much_beyond_their_tangents(name: str) -> None:
    q, P = np.array([30.0, -12.0]), np.array([[9.0, 3.0], [3.0, 4.0]])
    random = np.random.default_rng(3)
    e = random.multivariate_normal(np.zeros(2), P, 400_000)
    there, square = q + e, float(q @ q)
    if name == "bearing":
        seen = np.arctan2(q[0] * there[:, 1] - q[1] * there[:, 0], there @ q)
        slope = np.array([-q[1], q[0]]) / square
    else:
        seen, slope = np.hypot(*there.T), q / np.sqrt(square)
    found = noise_of(KINDS[name], q, P)
    # terms of third order are left
    np.testing.assert_allclose(np.var(seen - e @ slope), found, rtol=0.06)


def test_a_compass_has_none_and_bodies_at_one_place_have_finite_noise() -> None:
    assert second_order_variance(COMPASS_KIND, 3.0, 4.0, 1.0, 0.2, 2.0) == 0.0
    for kind in KINDS.values():
        assert np.isfinite(second_order_variance(kind, 0.0, 0.0, 1.0, 0.2, 2.0))


def test_both_kernels_have_the_same_noise_and_that_of_the_relative_position() -> None:
    setup = without_errors(scene_of(a_team(()), 10, 1).setup.poses)
    random, width = np.random.default_rng(6), 3
    lanes, landmarks = np.zeros(width, dtype=np.int8), setup.poses.landmarks
    x = random.uniform(-30.0, 30.0, (3, 3, width))
    roots = random.normal(size=(width, 9, 9))
    whole = np.moveaxis(roots @ roots.swapaxes(1, 2), 0, -1)
    P = np.where(np.tril(np.ones((9, 9), dtype=bool))[..., None], whole, np.nan)
    frame = (np.zeros((3, 6, width)), np.zeros(2), np.zeros(0))
    halves = np.zeros((8, 9, width)), np.zeros((8, 9, width))
    poses, further = np.empty(width), np.empty(width)
    for kind in KINDS.values():
        for o, t in [(0, 1), (2, 0), (1, 3), (2, 4)]:
            second_order_lanes(kind, x, P, o, t, landmarks, poses, lanes)
            curved_variances(kind, x, o, t, P, 0, setup, frame, halves, further, lanes)
            np.testing.assert_allclose(further, poses, rtol=1e-10)
            away = np.zeros((2, 9))
            away[[0, 1], [3 * o, 3 * o + 1]] = -1.0
            if t < 3:
                away[[0, 1], [3 * t, 3 * t + 1]] = 1.0
            for lane in range(width):
                place = x[t, :2, lane] if t < 3 else landmarks[t - 3]
                q, spread = place - x[o, :2, lane], away @ whole[..., lane] @ away.T
                expected = noise_of(kind, q, spread)
                np.testing.assert_allclose(poses[lane], expected, rtol=1e-9)


def test_both_filters_run_alike_with_second_order_noise() -> None:
    team = a_team((), detection=1.0)
    team = replace(team, noise=replace(team.noise, position_sigma=8.0, heading_sigma=0.3))
    setup, readings = scene_of(team, 45, 3, filter="second-order")
    assert setup.poses.second_order
    state, P, _ = filtered(Scene(setup, readings))
    plain = Readings(*readings[:4])
    statistics = empty_statistics(3, 3, empty_series(3, 45, wanted=False))
    x, covariance = EXTENDED.run(setup.poses, plain, statistics)
    np.testing.assert_allclose(x.reshape(9, 3), state, rtol=1e-9, atol=1e-9)
    lower = np.tril_indices(9)
    np.testing.assert_allclose(covariance[lower], P[lower], rtol=1e-8, atol=1e-12)
    first = scene_of(team, 45, 3, filter="ekf")
    without, _, _ = filtered(first)
    assert np.abs(without - state).max() > 1e-3
