"""The recursion by groups and by samples against a plain dense information recursion."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from syncplan.estimation import covariances, foreseen_sightings, referred_run
from syncplan.estimation.covariances import carried_along, variances_by_groups
from syncplan.estimation.referred_run import Run
from syncplan.observability.referred_rows import SightingRows

UPPER = np.triu_indices(3)
Way = Callable[[Run, np.ndarray], np.ndarray]


def _drawn(generator: np.random.Generator, count: int, steps: int, most: int) -> Run:
    """A run with up to `most` rows a sample, a third of the samples without any."""
    factor = 0.05 * generator.normal(size=(count, steps + 1, 3, 2))
    blocks = factor @ np.swapaxes(factor, -1, -2)
    blocks[:, 0] = 0.0
    number = generator.integers(1, most + 1, steps + 1) * (generator.random(steps + 1) < 2.0 / 3.0)
    number[0] = 0
    total = int(number.sum())
    rows = generator.normal(size=(total, 6))
    observers = generator.integers(0, count, total)
    targets = (observers + generator.integers(0, count, total)) % count
    # where observer and target are the same, the target is a landmark
    rows[observers == targets, 3:] = 0.0
    bodies = np.column_stack([observers, targets])
    columns = (3 * bodies[:, :, None] + np.arange(3)).reshape(-1, 6)
    return Run(
        noise=np.moveaxis(blocks[..., UPPER[0], UPPER[1]], -1, 0),
        rows=SightingRows(rows, columns),
        first=np.concatenate([[0], np.cumsum(number)]),
        size=3 * count,
    )


def _initial(generator: np.random.Generator, count: int) -> np.ndarray:
    factor = generator.normal(size=(3 * count, 3 * count + 2))
    return np.asarray(factor @ factor.T)


def _by_information(run: Run, covariance: np.ndarray) -> np.ndarray:
    """(4, n, steps + 1) by inverting there and back at each sample."""
    count = run.count
    found = np.empty((4, *run.noise.shape[1:]))
    for k in range(run.noise.shape[-1]):
        covariance = covariance.copy()
        for v in range(count):
            xx, xy, xp, yy, yp, pp = run.noise[:, v, k]
            block = np.array([[xx, xy, xp], [xy, yy, yp], [xp, yp, pp]])
            covariance[3 * v : 3 * v + 3, 3 * v : 3 * v + 3] += block
        information = np.linalg.inv(covariance)
        for s in range(run.first[k], run.first[k + 1]):
            row = np.zeros(3 * count)
            np.add.at(row, run.rows.columns[s], run.rows.entries[s])
            information += np.outer(row, row)
        covariance = np.linalg.inv(information)
        found[..., k] = _four(covariance)
    return found


def _four(covariance: np.ndarray) -> np.ndarray:
    """(4, n) xx + yy, x psi, y psi and psi psi of each vehicle's block."""
    xx, yy, turn = (np.diagonal(covariance)[axis::3] for axis in range(3))
    x_turn, y_turn = (np.diagonal(covariance, 2 - axis)[axis::3] for axis in range(2))
    return np.stack([xx + yy, x_turn, y_turn, turn])


def _by_samples(run: Run, covariance: np.ndarray) -> np.ndarray:
    return np.stack([_four(one.covariance) for one in carried_along(run, covariance)], axis=-1)


WAYS = [_by_samples, variances_by_groups]


@pytest.mark.parametrize(("rows", "groups"), [(64, 24), (7, 1), (1, 5), (16, 3)])
@pytest.mark.parametrize("seed", range(6))
def test_groups_and_samples_equal_the_information_recursion(
    seed: int, rows: int, groups: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    generator = np.random.default_rng(seed)
    count = int(generator.integers(1, 6))
    run = _drawn(generator, count, steps=40, most=(3, 9, 30)[seed % 3])
    start = _initial(generator, count)
    expected = _by_information(run, start)
    for module in (covariances, foreseen_sightings, referred_run):
        monkeypatch.setattr(module, "GROUP_ROWS", rows)
    monkeypatch.setattr(covariances, "GROUPS_AT_ONCE", groups)
    scale = np.abs(expected).max(axis=-1, keepdims=True)
    for way in WAYS:
        found = way(run, start)
        np.testing.assert_allclose(found / scale, expected / scale, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("way", WAYS)
def test_without_sightings_the_noise_adds_up(way: Way) -> None:
    generator = np.random.default_rng(3)
    drawn = _drawn(generator, 3, steps=5, most=1)
    none = SightingRows(np.zeros((0, 6)), np.zeros((0, 6), dtype=np.int64))
    run = Run(drawn.noise, none, np.zeros(7, dtype=np.int64), 9)
    found = way(run, np.eye(9))
    np.testing.assert_allclose(found[3], 1.0 + np.cumsum(run.noise[5], axis=-1))
    np.testing.assert_allclose(found[1], np.cumsum(run.noise[2], axis=-1), atol=1e-15)


@pytest.mark.parametrize("way", WAYS)
def test_the_initial_covariance_is_left_alone(way: Way) -> None:
    generator = np.random.default_rng(4)
    run = _drawn(generator, 2, steps=20, most=4)
    start = _initial(generator, 2)
    kept = start.copy()
    way(run, start)
    np.testing.assert_array_equal(start, kept)


@pytest.mark.parametrize("way", WAYS)
def test_exact_poses_without_noise_stay_exact(way: Way) -> None:
    generator = np.random.default_rng(5)
    drawn = _drawn(generator, 2, steps=20, most=4)
    run = replace(drawn, noise=0.0 * drawn.noise)
    np.testing.assert_array_equal(way(run, np.zeros((6, 6))), 0.0)
