"""The recursion by groups and by samples against a plain dense information recursion."""

import numpy as np
import pytest

from syncplan.estimation import covariances, foreseen_sightings, referred_run
from syncplan.estimation.covariances import variances_along
from syncplan.estimation.referred_run import Run

UPPER = np.triu_indices(3)


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
    return Run(
        noise=np.moveaxis(blocks[..., UPPER[0], UPPER[1]], -1, 0),
        rows=rows,
        observers=observers,
        targets=targets,
        first=np.concatenate([[0], np.cumsum(number)]),
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
            a, b = 3 * run.observers[s], 3 * run.targets[s]
            row[a : a + 3] += run.rows[s, :3]
            row[b : b + 3] += run.rows[s, 3:]
            information += np.outer(row, row)
        covariance = np.linalg.inv(information)
        for v in range(count):
            block = covariance[3 * v : 3 * v + 3, 3 * v : 3 * v + 3]
            found[:, v, k] = block[0, 0] + block[1, 1], block[0, 2], block[1, 2], block[2, 2]
    return found


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
    for limit in (count, count - 1):
        monkeypatch.setattr(covariances, "GROUPED_VEHICLES", limit)
        found = variances_along(run, start)
        np.testing.assert_allclose(found / scale, expected / scale, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("limit", [0, 3])
def test_without_sightings_the_noise_adds_up(limit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    generator = np.random.default_rng(3)
    drawn = _drawn(generator, 3, steps=5, most=1)
    none = np.zeros(0, dtype=np.int64)
    run = Run(drawn.noise, np.zeros((0, 6)), none, none, np.zeros(7, dtype=np.int64))
    monkeypatch.setattr(covariances, "GROUPED_VEHICLES", limit)
    found = variances_along(run, np.eye(9))
    np.testing.assert_allclose(found[3], 1.0 + np.cumsum(run.noise[5], axis=-1))
    np.testing.assert_allclose(found[1], np.cumsum(run.noise[2], axis=-1), atol=1e-15)


def test_the_initial_covariance_is_left_alone() -> None:
    generator = np.random.default_rng(4)
    run = _drawn(generator, 2, steps=20, most=4)
    start = _initial(generator, 2)
    kept = start.copy()
    variances_along(run, start)
    np.testing.assert_array_equal(start, kept)


@pytest.mark.parametrize("limit", [0, 2])
def test_exact_poses_without_noise_stay_exact(limit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    generator = np.random.default_rng(5)
    drawn = _drawn(generator, 2, steps=20, most=4)
    run = Run(0.0 * drawn.noise, drawn.rows, drawn.observers, drawn.targets, drawn.first)
    monkeypatch.setattr(covariances, "GROUPED_VEHICLES", limit)
    np.testing.assert_array_equal(variances_along(run, np.zeros((6, 6))), 0.0)
