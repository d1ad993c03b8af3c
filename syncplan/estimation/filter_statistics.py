"""Statistics of a filter run: squared errors, coverage, NEES, innovations and a series."""

from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array

SAMPLE_EVERY = 10
"""NEES and coverage are taken at every tenth step, and at the last."""

SERIES = (
    *("error_x", "error_y", "error_heading", "position", "heading", "var_position", "var_head"),
    *("square_x", "square_y", "var_x", "var_y"),
)
"""Quantities that the series sums over trials: three signed errors, the squared errors of position
and heading, their two variances, and squares and variances of x and y alone."""


class FilterStatistics(NamedTuple):
    """Statistics of each lane; only the series is summed over lanes.

    Fields
    ------
    squares, late_squares : (n, 3, lanes) sums of squared error over all k >= 1, and over 2k > steps
    final : (n, 3, lanes) error at the last step
    covered : (n, lanes) coordinates within three sigma, over the sampled steps
    nees, nees_samples : (lanes,) sum and number of samples with a positive definite covariance
    nis, accepted, gated : (lanes,) sum and number of accepted innovations, number of rejected ones
    innovations : (s, 2, lanes) of each sighting the innovation, in the unit of its kind, and 1 over
        its variance, 0 where it is rejected or missed; (0, 2, lanes) if not wanted
    series : (samples + 1, n, 11) as SERIES, (0, n, 11) if not wanted; the lanes add to it
    """

    squares: Array
    late_squares: Array
    final: Array
    covered: Array
    nees: Array
    nees_samples: Array
    nis: Array
    accepted: Array
    gated: Array
    innovations: Array
    series: Array


def empty_series(n: int, steps: int, *, wanted: bool) -> Array:
    """Return zeros to sum a series of n vehicles into; no rows where it is not wanted."""
    return np.zeros((steps + 1 if wanted else 0, n, len(SERIES)))


def empty_statistics(n: int, lanes: int, series: Array, sightings: int = 0) -> FilterStatistics:
    """Return statistics of zeros for n vehicles that add to the given `series`.

    Innovations are kept of the first so many sightings: of all, or of none.
    """
    return FilterStatistics(
        squares=np.zeros((n, 3, lanes)),
        late_squares=np.zeros((n, 3, lanes)),
        final=np.zeros((n, 3, lanes)),
        covered=np.zeros((n, lanes)),
        nees=np.zeros(lanes),
        nees_samples=np.zeros(lanes),
        nis=np.zeros(lanes),
        accepted=np.zeros(lanes),
        gated=np.zeros(lanes),
        innovations=np.zeros((sightings, 2, lanes)),
        series=series,
    )
