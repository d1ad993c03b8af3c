"""Random numbers by key: those of a sighting do not depend on other sightings.

In flight, sightings differ from trial to trial, and with every change of a plan or of a guidance
law. The numbers of a sighting are therefore not part of a sequence but a function of the trial's
key and of the counter (step, observer, target, 0). Runs that differ in one thing are paired in
everything else.

The function is Philox4x64 with ten rounds, as in numpy.random.Philox:

    Philox(key=key, counter=counter - 1).random_raw(4)  ==  words_at(key, counter)

Source: Salmon et al. (2011), Parallel random numbers: as easy as 1, 2, 3; normal deviates by Box
and Muller (1958).
"""

import math

import numpy as np
from numpy.typing import NDArray

from syncplan.estimation.kernels import inner, kernel

Word = np.uint64
"""Unsigned word of 64 bits."""

Words = tuple[Word, Word, Word, Word]
"""Four words of 64 bits."""

SIGHTED = 2
"""Key, below a trial's, of the numbers of its sightings; 1 is that of its filter."""

ROUNDS = 10
FACTORS = (np.uint64(0xD2E7470EE14C6C93), np.uint64(0xCA5A826395121157))
INCREMENTS = (np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBB67AE8584CAA73B))
LOW = np.uint64(0xFFFFFFFF)
HALF = np.uint64(32)
SPARE = np.uint64(12)
STEP = 2.0**-52


def key_of(seed: int, trial: int) -> NDArray[np.uint64]:
    """Return the key (2,) of a trial's sightings, as unsigned integers of 64 bits."""
    sequence = np.random.SeedSequence(seed, spawn_key=(trial, SIGHTED))
    return sequence.generate_state(2, np.uint64)  # type: ignore[return-value]


@inner
def _high(a: Word, b: Word) -> Word:
    """Upper half of the product of two words, from products of their halves."""
    a_low, a_high, b_low, b_high = a & LOW, a >> HALF, b & LOW, b >> HALF
    middle = a_high * b_low + ((a_low * b_low) >> HALF)
    other = a_low * b_high + (middle & LOW)
    return a_high * b_high + (middle >> HALF) + (other >> HALF)


@kernel
def words_at(key: NDArray[np.uint64], step: int, observer: int, target: int) -> Words:
    """Return four words for a sighting of a trial with this key (2,)."""
    a, b, c, d = np.uint64(step), np.uint64(observer), np.uint64(target), np.uint64(0)
    k, m = key[0], key[1]
    for _ in range(ROUNDS):
        high_a, low_a = _high(FACTORS[0], a), FACTORS[0] * a
        high_c, low_c = _high(FACTORS[1], c), FACTORS[1] * c
        a, b, c, d = high_c ^ b ^ k, low_c, high_a ^ d ^ m, low_a
        k += INCREMENTS[0]
        m += INCREMENTS[1]
    return a, b, c, d


@inner
def uniform(word: Word) -> float:
    """Return a number in (0, 1) from a word: the middle of one of 2^52 parts, which is exact."""
    return (float(word >> SPARE) + 0.5) * STEP


@inner
def normal_pair(first: Word, second: Word) -> tuple[float, float]:
    """Return two independent standard normal numbers from two words."""
    radius = math.sqrt(-2.0 * math.log(uniform(first)))
    angle = 2.0 * math.pi * uniform(second)
    return radius * math.cos(angle), radius * math.sin(angle)
