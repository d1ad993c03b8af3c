"""Random numbers by key against numpy.random.Philox."""

import numpy as np
import pytest

from syncplan.flight.keyed_noise import Word, key_of, uniform, words_at
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


def test_uniform_numbers_are_never_0_or_1() -> None:
    number = called_alone(uniform)
    least, most = number(Word(0)), number(Word(2**64 - 1))
    assert 0.0 < least < 1e-15
    assert 1.0 - 1e-15 < most < 1.0
