"""Consistency: whether a filter's covariance agrees with its errors.

A filter's sigma is no evidence of its error. Three figures compare the two:

    ANEES      mean of e' P^-1 e / dimension of e      1 where P is the errors' covariance
    NIS        mean of nu^2 / S over innovations, over that of a consistent filter with the gate
                                                       1 where S is the innovations' variance
    coverage   share of |error| <= 3 sigma             0.9973 for normal errors

The first two come with their 95 % confidence interval. Trials are independent, samples of one trial
are not, so the interval is that of a mean over trials, from their spread. A recording is a single
trial: its interval assumes that the sums are chi-square variables.

A filter is called optimistic (its sigmas are too small) or conservative where the whole interval is
more than TOLERANCE from 1. A smaller difference does not count, even where many trials establish
it.

The interval of a mean is by empirical likelihood, as its samples may be skewed. Among all weights w
on the samples x_1..x_k, sum w = 1, the likelihood of a mean mu is the largest product of k w_i with
sum w_i x_i = mu. The interval holds the means with

    -2 log(likelihood) <= t^2           t Student's 97.5 % quantile with k - 1 degrees of freedom

For nearly normal samples this is Student's interval. Where a few samples are far above the rest,
as squared errors of lost trials are, Student's interval reaches far below all of them; this one
stays within the samples and extends towards the long tail.

Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
5.4 (consistency of state estimators; chi-square bands of averaged NEES and NIS); Owen, Empirical
Likelihood, 2001, 2.2 to 2.5 and 2.9 (F calibration: t^2 is the quantile of F with 1 and k - 1
degrees of freedom).
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from syncplan.arrays import Array

# --- the interval of a mean -----------------------------------------------------------------------


INTERVAL_PROBABILITY = 0.95

FEWEST_TRIALS = 10
"""Fewest trials whose spread gives an interval."""

_HALVINGS = 48
_LARGEST_LOG_TILT = 700.0


def interval_of_mean(
    samples: Array, probability: float = INTERVAL_PROBABILITY
) -> tuple[float, float]:
    """Return the two-sided interval of the mean of `samples` (k,), k >= 2 and finite."""
    from scipy.special import stdtrit

    least, largest = float(samples.min()), float(samples.max())
    spread = largest - least
    # all are the same to within rounding
    if not spread > 1e-14 * max(abs(least), abs(largest)):
        mean = float(samples.mean())
        return mean, mean
    largest_statistic = float(stdtrit(len(samples) - 1, 0.5 * (1.0 + probability))) ** 2
    low = least + spread * _least_mean((samples - least) / spread, largest_statistic)
    high = largest - spread * _least_mean((largest - samples) / spread, largest_statistic)
    return low, high


def interval_of_rms(squares: Array) -> tuple[float, float] | None:
    """Return the 95 % interval of an RMS from the mean square of each trial (trials,).

    None for fewer than FEWEST_TRIALS trials, and where a mean square is not finite.
    """
    if len(squares) < FEWEST_TRIALS or not np.isfinite(squares).all():
        return None
    low, high = interval_of_mean(squares)
    return math.sqrt(low), math.sqrt(high)


def _least_mean(shares: Array, largest_statistic: float) -> float:
    """Return the least mean of shares (k,) in [0, 1], 0 among them, that is likely enough.

    The likeliest weights of a mean below the samples' own are proportional to 1 / (1 + a share),
    a >= 0. As the tilt a grows, the mean falls and the statistic rises.
    """
    low, high = -_LARGEST_LOG_TILT, _LARGEST_LOG_TILT
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _tilted(shares, middle)[1] > largest_statistic:
            high = middle
        else:
            low = middle
    return _tilted(shares, low)[0]


def _tilted(shares: Array, log_tilt: float) -> tuple[float, float]:
    """Mean under weights tilted by exp(log_tilt), and -2 log of their likelihood."""
    divisors = 1.0 + np.exp(log_tilt) * shares
    weights = 1.0 / divisors
    total = float(weights.sum())
    statistic = 2.0 * (float(np.log(divisors).sum()) + len(shares) * np.log(total / len(shares)))
    return float(weights @ shares) / total, float(statistic)


Verdict = Literal["consistent", "optimistic", "conservative", "unknown"]

Basis = Literal["trials", "chi-square"]

TOLERANCE = 0.1
"""Largest distance from 1 at which a figure counts as consistent: sigmas that are 5 % off."""

WIDEST = 0.4
"""Widest interval from the spread over trials that can show that a filter is consistent: a wider
one would hold 0.8 and 1.2."""

_NO_BAND = (math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class Consistency:
    """A normalised squared error, its confidence interval, and the verdict on the filter.

    Attributes
    ----------
    value : mean normalised squared error, 1 for a consistent filter; NaN without samples
    band : (low, high) its two-sided 95 % confidence interval; (NaN, NaN) where there is none
    count : number of trials, or of chi-square degrees of freedom, that give the interval
    basis : which of the two `count` is
    verdict : "optimistic" where the interval lies above 1 + TOLERANCE (sigmas too small),
        "conservative" where it lies below 1 - TOLERANCE, "unknown" without an interval, or where it
        is from the spread over trials and wider than WIDEST, otherwise "consistent"
    """

    value: float
    band: tuple[float, float]
    count: int
    basis: Basis
    verdict: Verdict


def chi_square_band(degrees: int, probability: float = INTERVAL_PROBABILITY) -> tuple[float, float]:
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

    Trials without a NEES (NaN) count in neither value nor interval.
    """
    judged = nees[~np.isnan(nees)]
    value = float(judged.mean()) / dimension if len(judged) else math.nan
    return _of_trials(value, judged / dimension)


def nis(sums: Array, counts: Array, gate_probability: float | None = None) -> Consistency:
    """Return the mean normalised squared scalar innovation over trials.

    `sums` and `counts` (trials,) are those of each trial. A gate cuts off the tail: the mean of the
    rest is below 1 (0.987 for a gate of 99.9 %). The value is divided by that mean, so a consistent
    filter has 1 whatever the gate.
    """
    total = float(counts.sum())
    if not total:
        return _of_trials(math.nan, np.empty(0))
    expected, _ = _gated_moments(gate_probability)
    mean = float(sums.sum()) / total
    # to first order, a ratio of two sums is the mean of these values, one for each trial
    own = mean + (sums - mean * counts) * (len(counts) / total)
    return _of_trials(mean / expected, own / expected)


def recorded_anees(nees: float, dimension: int) -> Consistency:
    """Return the average NEES over its dimension of a single trial.

    NEES is correlated along a run, so the whole run counts as one sample: the interval assumes a
    chi-square variable of `dimension` degrees of freedom, and is wider than necessary for a run
    much longer than the errors' correlation time.
    """
    return _of_recording(nees / dimension, 0 if math.isnan(nees) else dimension)


def recorded_nis(total: float, count: int, gate_probability: float | None = None) -> Consistency:
    """Return the mean of `count` normalised squared innovations of a single trial, sum `total`.

    Innovations of a consistent filter are white, so each is a sample of its own; the interval is
    that of the chi-square variable with the mean and variance that a gate leaves.
    """
    mean, variance = _gated_moments(gate_probability)
    value = float(total) / count / mean if count else math.nan
    return _of_recording(value, round(2.0 * mean**2 / variance * count))


def coverage(covered: Array, samples: int) -> Array:
    """Return the share (...) of `samples` at which each coordinate is within three sigma.

    NaN without samples.
    """
    return np.asarray(covered / (samples or np.nan))


def _gated_moments(probability: float | None) -> tuple[float, float]:
    """Mean and variance of a chi-square variable of one degree of freedom below a gate."""
    from scipy.special import chdtr

    gate = gate_threshold(probability)
    if math.isinf(gate):
        return 1.0, 2.0
    # y^k times the density of 1 degree is a multiple of the density of 1 + 2 k degrees
    share = float(chdtr(1, gate))
    mean = float(chdtr(3, gate)) / share
    return mean, 3.0 * float(chdtr(5, gate)) / share - mean**2


def _of_trials(value: float, values: Array) -> Consistency:
    """Return the figure `value`, the mean of the `values` (k,) of trials, with its interval."""
    if len(values) < FEWEST_TRIALS:
        return Consistency(value, _NO_BAND, len(values), "trials", "unknown")
    band = interval_of_mean(values)
    verdict = _verdict(band)
    if verdict == "consistent" and band[1] - band[0] > WIDEST:
        verdict = "unknown"
    return Consistency(value, band, len(values), "trials", verdict)


def _of_recording(value: float, degrees: int) -> Consistency:
    """Return the figure of a single trial, a chi-square variable over its degrees of freedom."""
    if not degrees:
        return Consistency(value, _NO_BAND, 0, "chi-square", "unknown")
    low, high = chi_square_band(degrees)
    band = value / high, value / low
    return Consistency(value, band, degrees, "chi-square", _verdict(band))


def _verdict(band: tuple[float, float]) -> Verdict:
    if band[0] > 1.0 + TOLERANCE:
        return "optimistic"
    return "conservative" if band[1] < 1.0 - TOLERANCE else "consistent"
