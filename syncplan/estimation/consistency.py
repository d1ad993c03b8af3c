"""Consistency: whether a filter's covariance agrees with its errors.

A filter's sigma is no evidence of its error. Three figures compare the two:

    ANEES      mean of e' P^-1 e / dimension of e      1 where P is the errors' covariance
    NIS        mean of nu^2 / S over innovations, over that of a consistent filter with the gate
                                                       1 where S is the innovations' variance
    coverage   share of |error| <= 3 sigma             0.9973 for normal errors

The first two come with the two-sided 95 % band into which a consistent filter's figure falls.

Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
5.4 (consistency of state estimators; chi-square bands of averaged NEES and NIS).
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from syncplan.arrays import Array

__all__ = ["Consistency", "anees", "chi_square_band", "coverage", "gate_threshold", "nis"]

Verdict = Literal["consistent", "optimistic", "conservative", "unknown"]

BAND_PROBABILITY = 0.95


@dataclass(frozen=True, slots=True)
class Consistency:
    """A normalised squared error, its band, and whether it lies inside, above or below.

    Attributes
    ----------
    value : mean normalised squared error, 1 for a consistent filter; NaN without samples
    band : (low, high) two-sided 95 % band
    degrees : chi-square degrees of freedom behind the band
    verdict : "optimistic" above the band (sigmas too small), "conservative" below,
        "unknown" without samples
    """

    value: float
    band: tuple[float, float]
    degrees: int
    verdict: Verdict


def chi_square_band(degrees: int, probability: float = BAND_PROBABILITY) -> tuple[float, float]:
    """Return the two-sided band of a chi-square variable over its degrees of freedom."""
    from scipy.special import chdtri

    tail = 0.5 * (1.0 - probability)
    return float(chdtri(degrees, 1.0 - tail) / degrees), float(chdtri(degrees, tail) / degrees)


def gate_threshold(probability: float | None) -> float:
    """Return the largest innovation^2 / variance to accept; infinite for None.

    A consistent filter's innovation stays below it with the given probability (one degree).
    """
    from scipy.special import chdtri

    return math.inf if probability is None else float(chdtri(1, 1.0 - probability))


def anees(nees: Array, dimension: int) -> Consistency:
    """Return the average NEES over its dimension, from the mean NEES of each trial (trials,).

    NEES is correlated along a run, so each run counts as one sample however long it is: the band
    has trials * dimension degrees of freedom. For runs much longer than the errors' correlation
    time the band is wider than it need be. Trials without a NEES (NaN) count in neither.
    """
    judged = nees[~np.isnan(nees)]
    if not len(judged):
        return _nothing()
    return _judged(float(judged.mean()) / dimension, len(judged) * dimension)


def nis(total: float, count: int, gate_probability: float | None = None) -> Consistency:
    """Return the mean of `count` normalised squared scalar innovations with the sum `total`.

    Innovations of a consistent filter are white, so each is a sample of its own. A gate cuts off
    their tail: the mean of the rest is below 1 (0.987 for a gate of 99.9 %) and its variance
    smaller. The value is divided by that mean, so a consistent filter has 1 whatever the gate; the
    band is that of the chi-square variable with the same mean and variance.
    """
    if not count:
        return _nothing()
    mean, variance = _gated_moments(gate_probability)
    return _judged(float(total) / count / mean, round(2.0 * mean**2 / variance * count))


def coverage(covered: Array, samples: int) -> Array:
    """Return the share (...) of the coordinates within three sigma, of `samples` each."""
    return np.asarray(covered / samples)


def _gated_moments(probability: float | None) -> tuple[float, float]:
    """Mean and variance of a chi-square variable of one degree below a gate."""
    from scipy.special import chdtr

    gate = gate_threshold(probability)
    if math.isinf(gate):
        return 1.0, 2.0
    # y^k times the density of 1 degree is a multiple of the density of 1 + 2 k degrees
    share = float(chdtr(1, gate))
    mean = float(chdtr(3, gate)) / share
    return mean, 3.0 * float(chdtr(5, gate)) / share - mean**2


def _judged(value: float, degrees: int) -> Consistency:
    low, high = chi_square_band(degrees)
    verdict: Verdict = "consistent"
    if value > high:
        verdict = "optimistic"
    elif value < low:
        verdict = "conservative"
    return Consistency(value, (low, high), degrees, verdict)


def _nothing() -> Consistency:
    return Consistency(math.nan, (math.nan, math.nan), 0, "unknown")
