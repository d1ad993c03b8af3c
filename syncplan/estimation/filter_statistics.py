"""A filter run, and its statistics: squared errors, coverage, NEES, innovations and a series."""

from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.filter_setup import FilterSetup, Readings, Truth

ERROR, SQUARE, VARIANCE = range(3)
"""Quantities that a series sums over trials, of each state."""


class FilterStatistics(NamedTuple):
    """Statistics of the 3n + e states of each lane; only the series is summed over lanes.

    Fields
    ------
    squares, late_squares : (3n + e, lanes) sums of squared error over all k >= 1, and over
        2k > samples
    final : (3n + e, lanes) error at the last sample
    covered : (3n + e, lanes) sampled steps at which an error is within three sigma
    nees, nees_samples : (lanes,) of the poses, sum and number of samples with a positive definite
        covariance
    nis, accepted, gated : (lanes,) sum and number of accepted innovations, number of rejected ones
    innovations : (s, 2, lanes) of each sighting the innovation, in the unit of its kind, and 1 over
        its variance, 0 where it is rejected or missed; (0, 2, lanes) if not wanted
    series : (samples + 1, 3n + e, 3) of errors, their squares and variances; (0, 3n + e, 3) if not
        wanted; the lanes add to it
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


class FilterRun(NamedTuple):
    """What a filter of lanes is given, and the statistics that it adds to.

    Fields
    ------
    setup : what all lanes share
    readings : of each lane
    truth : that its estimates are compared with
    statistics : of the comparison
    """

    setup: FilterSetup
    readings: Readings
    truth: Truth
    statistics: FilterStatistics


def empty_series(states: int, samples: int, *, wanted: bool) -> Array:
    """Return zeros to sum a series of so many states into; no rows where it is not wanted."""
    return np.zeros((samples + 1 if wanted else 0, states, 3))


def empty_statistics(lanes: int, series: Array, sightings: int = 0) -> FilterStatistics:
    """Return statistics of zeros that add to the given `series`.

    Innovations are kept of the first so many sightings: of all, or of none.
    """
    states = series.shape[1]
    return FilterStatistics(
        squares=np.zeros((states, lanes)),
        late_squares=np.zeros((states, lanes)),
        final=np.zeros((states, lanes)),
        covered=np.zeros((states, lanes)),
        nees=np.zeros(lanes),
        nees_samples=np.zeros(lanes),
        nis=np.zeros(lanes),
        accepted=np.zeros(lanes),
        gated=np.zeros(lanes),
        innovations=np.zeros((sightings, 2, lanes)),
        series=series,
    )
