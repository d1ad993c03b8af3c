"""What the filter with further states is given: columns of errors, true errors, statistics of them.

The state stacks the 3 n of poses and the errors of a StateLayout.
"""

from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.filter_setup import FilterSetup
from syncplan.estimation.filter_statistics import FilterStatistics, empty_statistics
from syncplan.orbits.error_states import ERROR_STATES, StateLayout

ERROR_SERIES = ("error", "square", "variance")
"""Quantities that the series of further states sums over trials."""


class AugmentedSetup(NamedTuple):
    """What all trials share.

    Fields
    ------
    poses : as of a filter of poses alone; its true headings are not used
    columns : (n, 9) place in the state of each vehicle's wind x, wind y, speed scale, turn-rate
        bias, bearing bias, gust x, gust y, bearing walk and clock offset; -1 where there is none
    variances : (e,) of the further states at the start
    first_changing : place of the first of them that is no constant; all after it change, too
    decays : (e,) share of each that is left after a sample, 1 of constants; what it gains keeps
        its variance as it is
    """

    poses: FilterSetup
    columns: Index
    variances: Array
    first_changing: int
    decays: Array


class AugmentedReadings(NamedTuple):
    """What the filter reads, and what is true, a lane for each trial.

    Fields
    ------
    initial : (n, 3, lanes) initial estimate in m, m, rad; that of the further states is zero
    speeds, turn_rates : (steps, n, lanes) m/s, rad/s
    sightings : (s, lanes) in the unit of their kind; NaN where a sighting is missed
    headings : (samples + 1, n, lanes) rad, true
    constants : (c, lanes) the true values of the further states that are constant
    changing : (samples + 1, e - c, lanes) those of the others
    """

    initial: Array
    speeds: Array
    turn_rates: Array
    sightings: Array
    headings: Array
    constants: Array
    changing: Array


class ErrorStatistics(NamedTuple):
    """Statistics of the e further states of each lane; only the series is summed over lanes.

    Fields
    ------
    squares, late_squares : (e, lanes) sums of squared error over all k >= 1, and over 2k > steps
    covered : (e, lanes) sampled steps at which the error is within three sigma
    series : (steps + 1, e, 3) as ERROR_SERIES, (0, e, 3) if not wanted
    """

    squares: Array
    late_squares: Array
    covered: Array
    series: Array


class AugmentedStatistics(NamedTuple):
    """Statistics of the poses and of the further states."""

    poses: FilterStatistics
    errors: ErrorStatistics


def columns_of(layout: StateLayout) -> Index:
    """Return (n, 9) where each vehicle's errors are in the state, as AugmentedSetup has them."""
    found = [
        layout.columns.get(name, np.full((layout.count, len(state.axes)), -1, dtype=np.int64))
        for name, state in ERROR_STATES.items()
    ]
    return np.ascontiguousarray(np.concatenate(found, axis=1))


def augmented_setup_of(poses: FilterSetup, layout: StateLayout) -> AugmentedSetup:
    """Return the set-up of a filter with the states of a layout, from that of its poses."""
    return AugmentedSetup(
        poses=poses,
        columns=columns_of(layout),
        variances=np.square(layout.sigmas),
        first_changing=layout.first_changing,
        decays=np.exp(-poses.motion.time / layout.times),
    )


def without_errors(poses: FilterSetup) -> AugmentedSetup:
    """Return the set-up of a filter of poses alone as one that has no further states."""
    n = len(poses.initial_variances)
    return AugmentedSetup(
        poses=poses,
        columns=np.full((n, 9), -1, dtype=np.int64),
        variances=np.zeros(0),
        first_changing=3 * n,
        decays=np.ones(0),
    )


def empty_augmented_statistics(
    n: int, errors: int, lanes: int, series: tuple[Array, Array], sightings: int = 0
) -> AugmentedStatistics:
    """Return statistics of zeros that add to the series of poses and of further states.

    `sightings` is as in `empty_statistics`.
    """
    return AugmentedStatistics(
        empty_statistics(n, lanes, series[0], sightings),
        ErrorStatistics(
            squares=np.zeros((errors, lanes)),
            late_squares=np.zeros((errors, lanes)),
            covered=np.zeros((errors, lanes)),
            series=series[1],
        ),
    )
