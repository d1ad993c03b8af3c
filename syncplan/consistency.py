"""Consistency: whether a filter's own covariance tells the truth about its errors.

A filter's sigma is no evidence of its error. Three figures compare the two:

    ANEES      mean of e' P^-1 e / dimension of e      1 where P is the errors' covariance
    NIS        mean of nu^2 / S over innovations       1 where S is the innovations' variance
    coverage   share of |error| <= 3 sigma             0.9973 for normal errors

The first two come with the two-sided 95 % band a consistent filter's figure falls into.
Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 5.4.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["Consistency", "anees", "chi_square_band", "coverage", "gate_threshold", "nis"]

Array = NDArray[np.float64]
Verdict = Literal["consistent", "optimistic", "conservative", "unknown"]

BAND_PROBABILITY = 0.95


@dataclass(frozen=True, slots=True)
class Consistency:
    """A normalised squared error, its band, and on which side of it it lies.

    Attributes
    ----------
    value : mean normalised squared error, 1 for a consistent filter; NaN without samples
    band : (low, high) two-sided 95 % band
    degrees : chi-square degrees of freedom behind the band
    verdict : "optimistic" above the band (sigmas too small), "conservative" below,
        "unknown" where there was nothing to judge
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

    NEES is correlated along a run, so a run counts as one sample however long it is: the band
    has trials * dimension degrees of freedom. It is wider than the truth for runs much longer
    than the errors' memory. Trials without a NEES (NaN) are left out of value and band.
    """
    judged = nees[~np.isnan(nees)]
    if not len(judged):
        return _nothing()
    return _judged(float(judged.mean()) / dimension, len(judged) * dimension)


def nis(total: float, count: int) -> Consistency:
    """Return the mean of `count` normalised squared scalar innovations that sum up to `total`.

    Innovations of a consistent filter are white, so each is a sample of its own. A gate cuts the
    tail off and so lowers the mean a little: 0.987 instead of 1 for a gate of 99.9 %.
    """
    return _judged(float(total) / count, count) if count else _nothing()


def coverage(covered: Array, samples: int) -> Array:
    """Return the share (...) of the coordinates within three sigma, of `samples` each."""
    return np.asarray(covered / samples)


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
