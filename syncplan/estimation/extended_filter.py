"""The extended Kalman filter of poses, of many trials: `batched_filter` has its steps.

With second-order noise in its set-up it is the second-order filter: `second_order`.
"""

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.batched_filter import (
    bearing_lanes,
    correct_lanes,
    motion_in,
    predict_lanes,
    sighting_lanes,
)
from syncplan.estimation.filter_setup import BEARING_KIND, FilterSetup, Readings
from syncplan.estimation.filter_statistics import FilterStatistics
from syncplan.estimation.lane_filter import LaneFilter, Lanes, compiled, pose_specimen
from syncplan.estimation.lane_statistics import record_lanes
from syncplan.estimation.second_order import second_order_lanes


@compiled
def _filter(
    setup: FilterSetup,
    readings: Readings,
    statistics: FilterStatistics,
    lanes: Lanes,
    x: Array,
    P: Array,
    begin: int,
    end: int,
) -> None:
    """Take x and P, lower triangle, from sample `begin` to sample `end`."""
    n, width = len(x), len(lanes)
    moves, u, gain = np.empty((6, width)), np.empty((3 * n, width)), np.empty((3 * n, width))
    work = (np.empty((3, width)), np.empty(width), u, gain, np.zeros(width))
    scratch = (np.empty((3 * n, width)), np.empty((3 * n, 3 * n, width)), u, gain)
    if begin == 0:
        record_lanes(x, P, setup, 0, scratch, statistics, lanes)
    for step in range(begin + 1, end + 1):
        speeds, turn_rates = readings.speeds[step - 1], readings.turn_rates[step - 1]
        predict_lanes(x, P, speeds, turn_rates, motion_in(setup, step), moves, lanes)
        for s in range(setup.first[step], setup.first[step + 1]):
            o, t, z = setup.observers[s], setup.targets[s], readings.sightings[s]
            kind, variance = setup.kinds[s], setup.variances[s]
            if kind == BEARING_KIND:
                bearing_lanes(x, o, t, setup.landmarks, z, work[0], work[1], lanes)
            else:
                sighting_lanes(kind, x, o, t, setup.landmarks, z, work[0], work[1], lanes)
            if setup.second_order:
                second_order_lanes(kind, x, P, o, t, setup.landmarks, work[4], lanes)
            correct_lanes(x, P, o, t, variance, setup.gate, work, statistics, lanes)
            if s < len(statistics.innovations):
                statistics.innovations[s, 0], statistics.innovations[s, 1] = work[1], work[0][0]
        if setup.compared[step] >= 0:
            record_lanes(x, P, setup, setup.compared[step], scratch, statistics, lanes)


EXTENDED = LaneFilter(_filter, pose_specimen)
"""The extended Kalman filter."""
