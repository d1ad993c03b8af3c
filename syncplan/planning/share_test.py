"""Sequential test of a share of flights: is it good, or bad?

A share p of flights fails. Good is p = GOOD_SHARE, bad is p = BAD_SHARE. After k failures in n
flights, the logarithm of the likelihood ratio of bad to good is

    L = k log(BAD / GOOD) + (n - k) log((1 - BAD) / (1 - GOOD))

Flights go on while |L| < log((1 - ERROR) / ERROR). A share of GOOD_SHARE is then called bad, and a
share of BAD_SHARE good, with a probability of about ERROR each. Without a failure, FEWEST_FLIGHTS
flights show that a share is good; three failures in the first three flights show that it is bad.

The interval of a share is Clopper and Pearson's, which covers the true share with at least the
stated probability.

Source: Wald, Sequential Analysis, 1947, 3.2 and 5.2; Clopper, Pearson, Biometrika 26 (1934).
"""

import math
from typing import Literal

import numpy as np

from syncplan.arrays import Array, Flags, Index

GOOD_SHARE, BAD_SHARE, ERROR = 0.03, 0.12, 0.05

_FAILED = math.log(BAD_SHARE / GOOD_SHARE)
_PASSED = math.log((1.0 - BAD_SHARE) / (1.0 - GOOD_SHARE))
_LIMIT = math.log((1.0 - ERROR) / ERROR)

FEWEST_FLIGHTS = math.ceil(-_LIMIT / _PASSED)
"""Flights that show that a share is good if none fails: 31."""

MOST_FLIGHTS = 96
"""Flights after which a share that is neither good nor bad remains undecided."""

Standing = Literal["good", "bad", "undecided"]


def standing(failures: int, flights: int) -> Standing:
    """Return what so many failures in so many flights show of the share that fails."""
    ratio = float(_ratio(np.array(failures), np.array(flights)))
    if ratio >= _LIMIT:
        return "bad"
    return "good" if ratio <= -_LIMIT else "undecided"


def deciding_flights(failed: Flags) -> int | None:
    """Return the number of flights that decide: a share is bad, or all are good; None if none do.

    All have to be good at the same number, so a share that was good earlier may still be found bad.

    `failed` (flights, shares) holds whether each flight failed, in the order in which they flew.
    """
    flights = np.arange(1, len(failed) + 1)[:, None]
    ratios = _ratio(np.cumsum(failed, axis=0), flights)
    decided = np.flatnonzero((ratios >= _LIMIT).any(axis=1) | (ratios <= -_LIMIT).all(axis=1))
    return int(decided[0]) + 1 if len(decided) else None


def share_interval(failures: int, flights: int, probability: float = 0.95) -> tuple[float, float]:
    """Return the two-sided interval of the share that fails."""
    from scipy.special import betaincinv

    tail, passes = 0.5 * (1.0 - probability), flights - failures
    low = float(betaincinv(failures, passes + 1, tail)) if failures else 0.0
    high = float(betaincinv(failures + 1, passes, 1.0 - tail)) if passes else 1.0
    return low, high


def share_of(failed: Flags) -> tuple[float, tuple[float, float]]:
    """Return the share of flights, or trials, that failed (flights,), and its interval."""
    return float(failed.mean()), share_interval(int(failed.sum()), len(failed))


def _ratio(failures: Index, flights: Index) -> Array:
    """Logarithm of the likelihood ratio of bad to good."""
    return np.asarray(failures * _FAILED + (flights - failures) * _PASSED)
