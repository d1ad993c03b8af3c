"""Kernels that add errors of poses and of further states to the statistics of lanes.

`lane_statistics` has those of poses alone.
"""

from syncplan.arrays import Array
from syncplan.estimation.augmented_setup import AugmentedStatistics, ErrorStatistics
from syncplan.estimation.filter_setup import FilterSetup
from syncplan.estimation.lane_filter import Lanes, compiled, inner
from syncplan.estimation.lane_statistics import record_errors

Compared = tuple[Array, tuple[Array, Array, Array, Array], Array]
"""Errors of the further states (e, lanes); scratch of `record_errors`, which begins with those of
the poses (3n, lanes); and room for the poses' covariance."""


@inner
def is_wanted_now(setup: FilterSetup, step: int, statistics: AugmentedStatistics) -> bool:
    """Return whether the statistics of a step take the covariance, as it is then."""
    return _is_sampled(setup, step) or len(statistics.poses.series) > 0


@inner
def _is_sampled(poses: FilterSetup, step: int) -> bool:
    taken = step % poses.sample_every == 0 or step == len(poses.truth) - 1
    return taken and step > poses.judged_from


@compiled
def record_augmented(
    P: Array,
    setup: FilterSetup,
    step: int,
    compared: Compared,
    statistics: AugmentedStatistics,
    lanes: Lanes,
) -> None:
    """Add the errors after a step to the statistics; step 0 counts in the series alone."""
    error_offs, scratch, block = compared
    late, counted = 2 * step > len(setup.truth) - 1, statistics.poses
    share, late_share = (1.0 if step else 0.0), (1.0 if late else 0.0)
    for i in range(len(counted.final)):
        for c in range(3):
            e = scratch[0][3 * i + c]
            for lane in range(len(lanes)):
                counted.final[i, c, lane] = e[lane]
                counted.squares[i, c, lane] += share * e[lane] * e[lane]
                counted.late_squares[i, c, lane] += late_share * e[lane] * e[lane]
    sampled = _is_sampled(setup, step)
    if sampled or len(counted.series):
        for i in range(len(block)):
            block[i, : i + 1] = P[i, : i + 1]
        record_errors(block, setup, step, scratch, counted, lanes)
    for k in range(len(error_offs)):
        _record_error(error_offs, P, step, k, sampled, late, statistics.errors, lanes)


@compiled
def _record_error(
    offs: Array,
    P: Array,
    step: int,
    k: int,
    sampled: bool,
    late: bool,
    counted: ErrorStatistics,
    lanes: Lanes,
) -> None:
    """Add what further state k is off, offs[k], to the statistics."""
    place = len(P) - len(offs) + k
    share, late_share = (1.0 if step else 0.0), (1.0 if late else 0.0)
    for lane in range(len(lanes)):
        e = offs[k, lane]
        counted.squares[k, lane] += share * e * e
        counted.late_squares[k, lane] += late_share * e * e
    if sampled:
        for lane in range(len(lanes)):
            e = offs[k, lane]
            counted.covered[k, lane] += 1.0 if e * e <= 9.0 * P[place, place, lane] else 0.0
    if len(counted.series):
        for lane in range(len(lanes)):
            e = offs[k, lane]
            counted.series[step, k, 0] += e
            counted.series[step, k, 1] += e * e
            counted.series[step, k, 2] += P[place, place, lane]
