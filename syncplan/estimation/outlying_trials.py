"""How the error is spread over trials: the median trial, and the share of trials far off.

An RMS over trials is that of its few worst ones where a filter is lost in some. The median trial is
what to expect of one run, and the share of trials over a multiple of the bound is how often to
expect something else.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.trials import MonteCarloResult


@dataclass(frozen=True, slots=True)
class TrialErrors:
    """Errors of each trial.

    Attributes
    ----------
    late_position : (trials, n) m, RMS over the second half of the run
    """

    late_position: Array

    def median(self) -> Array:
        """Return the median over trials, (n,) m."""
        return np.asarray(np.median(self.late_position, axis=0))

    def overall_median(self) -> float:
        """Return the median over trials of the RMS over vehicles, m."""
        return float(np.median(np.sqrt(np.mean(self.late_position**2, axis=1))))

    def share_over(self, limits: Array) -> Array:
        """Return the share (n,) of trials over each vehicle's limit (n,) in m."""
        return np.asarray(np.mean(self.late_position > limits, axis=0))

    def overall_share_over(self, limits: Array) -> float:
        """Return the share of trials in which any vehicle is over its limit (n,) in m."""
        return float(np.mean(np.any(self.late_position > limits, axis=1)))


def trial_errors(result: MonteCarloResult) -> TrialErrors:
    """Return the errors of each trial of a run."""
    squares = result.late_mean_squares
    return TrialErrors(np.sqrt(squares[..., 0] + squares[..., 1]))
