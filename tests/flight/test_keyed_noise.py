"""Random numbers by key against numpy.random.Philox, and their moments."""

import numpy as np
import pytest

from syncplan.flight.keyed_noise import Word, key_of, normal_pair, uniform, words_at
from tests.tools import plain_truth
from tests.tools.inner_kernels import called_alone


def _counters(generator: np.random.Generator) -> list[tuple[int, int, int]]:
    few = [(1, 0, 0), (1, 0, 1), (1, 1, 0), (2**31, 999, 1200)]
    return few + [tuple(int(n) for n in generator.integers(1, 5000, 3)) for _ in range(50)]  # type: ignore[misc]


@pytest.mark.parametrize(("seed", "trial"), [(0, 0), (7, 3), (2**63 - 1, 999_999)])
def test_words_are_those_of_numpys_philox(seed: int, trial: int) -> None:
    key = key_of(seed, trial)
    for counter in _counters(np.random.default_rng(1)):
        found = [int(word) for word in words_at(key, *counter)]
        assert found == plain_truth.words(key, *counter)


def test_numbers_of_a_sighting_are_its_own() -> None:
    """Other trial, seed, step, observer or target: other words."""
    keys = [key_of(0, 0), key_of(0, 1), key_of(1, 0)]
    found = {words_at(keys[k], 5, 1, 2) for k in range(3)}
    found |= {words_at(keys[0], *one) for one in ((6, 1, 2), (5, 2, 1), (5, 1, 3), (5, 0, 2))}
    assert len(found) == 7


def test_uniform_numbers_are_never_0_or_1() -> None:
    number = called_alone(uniform)
    least, most = number(Word(0)), number(Word(2**64 - 1))
    assert 0.0 < least < 1e-15
    assert 1.0 - 1e-15 < most < 1.0


def test_pairs_are_independent_standard_normal_numbers() -> None:
    """4-sigma bands of 20,000 pairs."""
    key, count = key_of(3, 0), 20_000
    words = np.array([words_at(key, k, 1, 2) for k in range(1, count + 1)], dtype=np.uint64)
    pair = called_alone(normal_pair)
    pairs = np.array([pair(four[0], four[1]) for four in words])
    band = 4.0 / np.sqrt(count)
    assert np.abs(pairs.mean(axis=0)).max() < band
    assert np.abs(np.mean(pairs**2, axis=0) - 1.0).max() < np.sqrt(2.0) * band
    assert abs(np.mean(pairs[:, 0] * pairs[:, 1])) < band
    assert abs(np.mean(pairs[:-1, 0] * pairs[1:, 0])) < band
    assert np.abs(np.mean(pairs**4, axis=0) - 3.0).max() < np.sqrt(96.0) * band
