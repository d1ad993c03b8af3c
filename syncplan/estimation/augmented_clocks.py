"""Sightings whose stamps are off: what they read when they were taken, and its rate of change.

A vehicle whose clock offset is delta stamps with t what it took at t + delta. By then each vehicle
has gone on from its pose at t along its arc, at what it reads less its errors, in the air that
moves; the rate of the reading is, with the observer's slopes (h_x, h_y, h_psi),

    h_x (v_o - v_t)_x + h_y (v_o - v_t)_y + h_psi w_o

How that way changes with heading, scale and air is of second order and left out of the row.
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.augmented_frame import CLOCK, GUST, SCALE, TURN, WIND
from syncplan.estimation.augmented_prediction import error_of
from syncplan.estimation.augmented_setup import AugmentedSetup
from syncplan.estimation.batched_filter import sighting_lanes
from syncplan.estimation.lane_filter import Lanes, compiled, inner

Read = tuple[Array, Array]
"""Speeds and turn rates (n, lanes) that are read at the time of a sighting, m/s and rad/s."""


@inner
def sight_as_stamped(
    kind: int,
    state: tuple[Array, Array],
    o: int,
    t: int,
    measured: Array,
    setup: AugmentedSetup,
    read: Read,
    slopes: Array,
    innovation: Array,
    lanes: Lanes,
) -> None:
    """Fill in slopes (4, lanes), the last by the clock offset, and innovation (lanes,).

    `state` are poses (n, 3, lanes) and further states (e, lanes). Without a clock offset among
    these the last slope stays as it is.
    """
    if setup.columns[o, CLOCK] >= 0:
        _sight_later(kind, state, o, t, measured, setup, read, slopes, innovation, lanes)
    else:
        landmarks = setup.poses.landmarks
        sighting_lanes(kind, state[0], o, t, landmarks, measured, slopes, innovation, lanes)


@compiled
def _sight_later(
    kind: int,
    state: tuple[Array, Array],
    o: int,
    t: int,
    measured: Array,
    setup: AugmentedSetup,
    read: Read,
    slopes: Array,
    innovation: Array,
    lanes: Lanes,
) -> None:
    x, errors = state
    n, clock = len(x), setup.columns[o, CLOCK] - 3 * len(x)
    poses, rates = np.zeros((2, 3, len(lanes))), np.zeros((2, 3, len(lanes)))
    for place, i in enumerate((o, t)):
        if i < n:
            _go_on(state, i, errors[clock], setup, read, poses[place], rates[place], lanes)
    # there are but these two; landmarks follow
    target = 1 if t < n else 2 + t - n
    landmarks = setup.poses.landmarks
    sighting_lanes(kind, poses, 0, target, landmarks, measured, slopes, innovation, lanes)
    for lane in range(len(lanes)):
        along = slopes[0, lane] * (rates[0, 0, lane] - rates[1, 0, lane])
        across = slopes[1, lane] * (rates[0, 1, lane] - rates[1, 1, lane])
        slopes[3, lane] = along + across + slopes[2, lane] * rates[0, 2, lane]


@inner
def _go_on(
    state: tuple[Array, Array],
    i: int,
    offsets: Array,
    setup: AugmentedSetup,
    read: Read,
    pose: Array,
    rates: Array,
    lanes: Lanes,
) -> None:
    """Fill in vehicle i's pose, (3, lanes), so many seconds later, and how it changes then."""
    x, errors = state
    n, own = len(x), setup.columns[i]
    for lane in range(len(lanes)):
        speed = (1.0 + error_of(errors, n, own[SCALE], lane)) * read[0][i, lane]
        turning = read[1][i, lane] + error_of(errors, n, own[TURN], lane)
        psi, span = x[i, 2, lane], offsets[lane]
        halfway, then = psi + 0.5 * turning * span, psi + turning * span
        air_x = error_of(errors, n, own[WIND], lane) + error_of(errors, n, own[GUST], lane)
        air_y = error_of(errors, n, own[WIND + 1], lane)
        air_y += error_of(errors, n, own[GUST + 1], lane)
        pose[0, lane] = x[i, 0, lane] + span * (speed * math.cos(halfway) + air_x)
        pose[1, lane] = x[i, 1, lane] + span * (speed * math.sin(halfway) + air_y)
        pose[2, lane] = then
        rates[0, lane] = speed * math.cos(then) + air_x
        rates[1, lane] = speed * math.sin(then) + air_y
        rates[2, lane] = turning
