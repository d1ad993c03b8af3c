"""Correction of further states by sightings, in the frame that their covariance is in.

The kernels are those of `augmented_filter`, rows those of `augmented_rows`. P is large, and each
correction would read all of it; so the halves u of a sample's corrections are kept, taken off what
is read of P, and P is corrected by all of them in one sweep.
"""

import math

from syncplan.arrays import Array, Index
from syncplan.estimation.augmented_clocks import sight_as_stamped
from syncplan.estimation.augmented_curvature import curved_variances
from syncplan.estimation.augmented_frame import BIAS, CLOCK, GUST, SCALE, TURN, WALK, WIND, Frame
from syncplan.estimation.augmented_rows import Sparse, dot, multiply, refer
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedSetup,
    AugmentedStatistics,
)
from syncplan.estimation.filter_setup import BEARING_KIND
from syncplan.estimation.lane_filter import Lanes, compiled, inner
from syncplan.estimation.lane_statistics import subtract_outer

About = tuple[Array, Array, bool]
"""Where sightings are linearised: poses (n, 3, lanes) and further states (e, lanes); and whether
the state that is corrected is what is off them, instead of them themselves."""

AT_ONCE = 8
"""Sightings that P is corrected by in one sweep."""


@compiled
def correct_augmented(
    x: Array,
    errors: Array,
    P: Array,
    step: int,
    setup: AugmentedSetup,
    readings: AugmentedReadings,
    about: About,
    frame: Frame,
    seen: tuple[Array, Array, Array],
    row: Sparse,
    halves: tuple[Array, Array],
    statistics: AugmentedStatistics,
    lanes: Lanes,
) -> None:
    """Correct state and P by the sightings of a step, one after another, and count them.

    `seen` are scratch for a sighting's slopes (4, lanes), innovation (lanes,) and, zero at first,
    second-order variance (lanes,), `row` for its row, `halves` for u and gain,
    (AT_ONCE, 3n + e, lanes) each.
    """
    poses, pending = setup.poses, 0
    places, expected, is_off = about
    at, read = (places, expected), (readings.speeds[step - 1], readings.turn_rates[step - 1])
    for s in range(poses.first[step], poses.first[step + 1]):
        o, t, z, kind = poses.observers[s], poses.targets[s], readings.sightings[s], poses.kinds[s]
        slopes, innovation, further = seen
        if poses.second_order:
            curved_variances(kind, x, o, t, P, pending, setup, frame, halves, further, lanes)
        sight_as_stamped(kind, at, o, t, z, setup, read, slopes, innovation, lanes)
        if kind == BEARING_KIND:
            expect_shift(expected, setup.columns[o], 3 * len(x), innovation, lanes)
        if is_off:
            _expect_off(x, errors, o, t, kind, setup.columns[o], slopes, innovation, lanes)
        entries = refer(slopes, o, t, kind, setup, frame, row, lanes)
        u, gain = halves[0][pending], halves[1][pending]
        multiply(P, row, entries, u, lanes)
        for j in range(pending):
            dot(row, entries, halves[0][j], gain[0], lanes)
            take_off(halves[1][j], gain[0], u, lanes)
        dot(row, entries, u, slopes[0], lanes)
        _weigh(poses.variances[s], poses.gate, further, slopes[0], innovation, statistics, lanes)
        kept = statistics.poses.innovations
        if s < len(kept):
            kept[s, 0], kept[s, 1] = innovation, slopes[0]
        for k in range(len(P)):
            for lane in range(len(lanes)):
                gain[k, lane] = u[k, lane] * slopes[0, lane]
        correct_state(x, errors, gain, innovation, setup, frame, lanes)
        pending += 1
        if pending == AT_ONCE:
            correct_covariance(P, pending, halves, lanes)
            pending = 0
    correct_covariance(P, pending, halves, lanes)


@inner
def _expect_off(
    x: Array,
    errors: Array,
    o: int,
    t: int,
    kind: int,
    own: Index,
    slopes: Array,
    innovation: Array,
    lanes: Lanes,
) -> None:
    """Take off the innovations (lanes,) what a state that is off leads one to expect."""
    for lane in range(len(lanes)):
        a, b = slopes[0, lane], slopes[1, lane]
        off = a * x[o, 0, lane] + b * x[o, 1, lane] + slopes[2, lane] * x[o, 2, lane]
        if t < len(x):
            off -= a * x[t, 0, lane] + b * x[t, 1, lane]
        if kind == BEARING_KIND and own[BIAS] >= 0:
            off += errors[own[BIAS] - 3 * len(x), lane]
        if kind == BEARING_KIND and own[WALK] >= 0:
            off += errors[own[WALK] - 3 * len(x), lane]
        if own[CLOCK] >= 0:
            off += slopes[3, lane] * errors[own[CLOCK] - 3 * len(x), lane]
        innovation[lane] -= off


@inner
def expect_shift(errors: Array, own: Index, first: int, innovation: Array, lanes: Lanes) -> None:
    """Take the errors that are expected of a bearing off the innovations (lanes,).

    `own` are the columns of its observer's errors, `first` that of the first of all.
    """
    for column in (own[BIAS], own[WALK]):
        if column >= 0:
            for lane in range(len(lanes)):
                off = innovation[lane] - errors[column - first, lane]
                turns = math.floor((off + math.pi) / (2.0 * math.pi))
                innovation[lane] = off - 2.0 * math.pi * turns


@inner
def take_off(gain: Array, shares: Array, u: Array, lanes: Lanes) -> None:
    """u -= gain shares: the correction by a sighting that P has not had yet."""
    for k in range(len(u)):
        for lane in range(len(lanes)):
            u[k, lane] -= gain[k, lane] * shares[lane]


@inner
def _weigh(
    variance: float,
    gate: float,
    further: Array,
    spread: Array,
    innovation: Array,
    statistics: AugmentedStatistics,
    lanes: Lanes,
) -> None:
    """Turn h' P h into what turns u into the gain: 0 where a sighting is missed, or rejected."""
    counted = statistics.poses
    for lane in range(len(lanes)):
        total = max(spread[lane], 0.0) + (variance + further[lane])
        made = 0.0 if math.isnan(innovation[lane]) else 1.0
        off = 0.0 if math.isnan(innovation[lane]) else innovation[lane]
        square = off * off
        accepted = made if square <= gate * total else 0.0
        counted.nis[lane] += accepted * (square / total)
        counted.accepted[lane] += accepted
        counted.gated[lane] += made - accepted
        innovation[lane] = off
        spread[lane] = accepted / total


@inner
def correct_state(
    x: Array,
    errors: Array,
    gain: Array,
    innovation: Array,
    setup: AugmentedSetup,
    frame: Frame,
    lanes: Lanes,
) -> None:
    """Add the gain, which is in P's frame, as it is now."""
    since, age, left = frame
    first = 3 * len(x)
    for i in range(len(x)):
        r, own = 3 * i, setup.columns[i]
        for lane in range(len(lanes)):
            turn = gain[r + 2, lane] * innovation[lane]
            x[i, 2, lane] += turn
        for axis in range(2):
            # a unit of heading moves x by -Y and y by X
            sign, across = (-1.0, 1) if axis == 0 else (1.0, 0)
            wind, blown = own[WIND + axis], own[GUST + axis]
            if wind >= 0:
                for lane in range(len(lanes)):
                    moved = gain[r + axis, lane] + sign * since[i, across, lane] * gain[r + 2, lane]
                    moved += age[0] * gain[wind, lane]
                    x[i, axis, lane] += moved * innovation[lane]
            else:
                for lane in range(len(lanes)):
                    moved = gain[r + axis, lane] + sign * since[i, across, lane] * gain[r + 2, lane]
                    x[i, axis, lane] += moved * innovation[lane]
            if blown >= 0:
                for lane in range(len(lanes)):
                    x[i, axis, lane] += age[1] * gain[blown, lane] * innovation[lane]
        if own[SCALE] >= 0:
            for lane in range(len(lanes)):
                change = gain[own[SCALE], lane] * innovation[lane]
                x[i, 0, lane] += since[i, 4, lane] * change
                x[i, 1, lane] += since[i, 5, lane] * change
        if own[TURN] >= 0:
            for lane in range(len(lanes)):
                change = gain[own[TURN], lane] * innovation[lane]
                x[i, 0, lane] += since[i, 2, lane] * change
                x[i, 1, lane] += since[i, 3, lane] * change
                x[i, 2, lane] += age[0] * change
    for k in range(len(errors)):
        for lane in range(len(lanes)):
            errors[k, lane] += left[k] * gain[first + k, lane] * innovation[lane]


@inner
def correct_covariance(P: Array, pending: int, halves: tuple[Array, Array], lanes: Lanes) -> None:
    """P -= sum of gain u' over the pending sightings, on the lower triangle."""
    us, gains = halves
    done = 0
    while pending - done >= 4:
        _subtract_four(P, gains[done : done + 4], us[done : done + 4], lanes)
        done += 4
    while pending - done >= 2:
        _subtract_two(P, gains[done : done + 2], us[done : done + 2], lanes)
        done += 2
    if done < pending:
        subtract_outer(P, gains[done], us[done], 0, lanes)


@inner
def _subtract_two(P: Array, g: Array, u: Array, lanes: Lanes) -> None:
    for i in range(len(P)):
        for j in range(i + 1):
            for lane in range(len(lanes)):
                P[i, j, lane] -= g[0, i, lane] * u[0, j, lane] + g[1, i, lane] * u[1, j, lane]


@inner
def _subtract_four(P: Array, g: Array, u: Array, lanes: Lanes) -> None:
    for i in range(len(P)):
        for j in range(i + 1):
            for lane in range(len(lanes)):
                P[i, j, lane] -= (g[0, i, lane] * u[0, j, lane] + g[1, i, lane] * u[1, j, lane]) + (
                    g[2, i, lane] * u[2, j, lane] + g[3, i, lane] * u[3, j, lane]
                )
