"""The confidence interval of a mean, from independent samples of a skewed quantity.

Empirical likelihood: among all weights w on the samples x_1..x_k, sum w = 1, the likelihood of a
mean mu is the largest product of k w_i with sum w_i x_i = mu. The interval holds the means whose

    -2 log(likelihood) <= t^2           t Student's 97.5 % quantile with k - 1 degrees of freedom

For nearly normal samples this is Student's interval. Where a few samples are far above the rest,
as squared errors of lost trials are, Student's interval reaches far below all of them; this one
stays within the samples and bends towards the long tail.

Source: Owen, Empirical Likelihood, 2001, 2.2 to 2.5 and 2.9 (F calibration: t^2 is the quantile of
F with 1 and k - 1 degrees of freedom).
"""

import numpy as np

from syncplan.arrays import Array

INTERVAL_PROBABILITY = 0.95

_HALVINGS = 48
_LARGEST_LOG_TILT = 700.0


def interval_of_mean(
    samples: Array, probability: float = INTERVAL_PROBABILITY
) -> tuple[float, float]:
    """Return the two-sided interval of the mean of `samples` (k,), k >= 2 and finite."""
    from scipy.special import stdtrit

    least, largest = float(samples.min()), float(samples.max())
    spread = largest - least
    # within rounding they are all the same
    if not spread > 1e-14 * max(abs(least), abs(largest)):
        mean = float(samples.mean())
        return mean, mean
    largest_statistic = float(stdtrit(len(samples) - 1, 0.5 * (1.0 + probability))) ** 2
    low = least + spread * _least_mean((samples - least) / spread, largest_statistic)
    high = largest - spread * _least_mean((largest - samples) / spread, largest_statistic)
    return low, high


def _least_mean(shares: Array, largest_statistic: float) -> float:
    """The least mean of shares (k,) in [0, 1], 0 among them, that is likely enough.

    The likeliest weights of a mean below the samples' own are proportional to 1 / (1 + a share),
    a >= 0; both the mean's fall and the statistic grow with the tilt a.
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
