"""The closed loop: vehicles fly by their estimates, the filter estimates from what they read.

Each sample:

    steer    commands from the estimate
    move     truth obeys them                     `true_motion`
    sight    who truly sees whom                  `true_sightings`
    filter   prediction by the readings, correction by the sightings; errors are counted

Sightings that arrive late are taken in late: the filter stays so many samples behind, and what
steers is its estimate carried on by the readings since.

The filter's kernels are those of `augmented_filter`, and so is the state.
"""

import math

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.augmented_correction import AT_ONCE, correct_augmented
from syncplan.estimation.augmented_frame import OWN, bring_to_now, frame_of
from syncplan.estimation.augmented_prediction import move, predict_augmented
from syncplan.estimation.augmented_rows import MOST_ENTRIES
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedSetup,
    AugmentedStatistics,
)
from syncplan.estimation.augmented_statistics import is_wanted_now, record_augmented
from syncplan.estimation.filter_setup import COMPASS_KIND, FilterSetup
from syncplan.estimation.lane_filter import Lanes, compiled, inner
from syncplan.flight.flight_options import OPEN_LOOP, TRACKING
from syncplan.flight.flight_setup import FlightSetup, Flown
from syncplan.flight.seeking import move_circles
from syncplan.flight.tracking_law import command_plan, track
from syncplan.flight.true_motion import move_truly
from syncplan.flight.true_sightings import sight_truly


@compiled
def carry_on(
    x: Array,
    errors: Array,
    speeds: Array,
    turn_rates: Array,
    setup: AugmentedSetup,
    slopes: Array,
    lanes: Lanes,
) -> tuple[Array, Array]:
    """Return the estimate (poses, further states) after further samples' readings (k, n, lanes)."""
    if len(speeds) == 0:
        return x, errors
    x, errors = x.copy(), errors.copy()
    motion = setup.poses.motion
    for k in range(len(speeds)):
        for i in range(len(x)):
            move(x, errors, i, speeds[k], turn_rates[k], motion, setup.columns[i], slopes, lanes)
    return x, errors


@compiled
def fly_to(
    target: int,
    at: int,
    x: Array,
    errors: Array,
    flight: FlightSetup,
    flown: Flown,
    setup: AugmentedSetup,
    readings: AugmentedReadings,
    slopes: Array,
    lanes: Lanes,
) -> None:
    """Fly until step `target` by the filter's estimate, which is that of step `at`."""
    while flown.places[0] < target:
        step = flown.places[0]
        read = readings.speeds[at:step], readings.turn_rates[at:step]
        now, further = carry_on(x, errors, read[0], read[1], setup, slopes, lanes)
        if flight.law.mode == TRACKING:
            moved, commands, time = flown.moved, flown.commands, step * flight.time
            track(
                flight.circles,
                flight.law,
                time,
                now,
                further,
                setup.columns,
                moved,
                commands,
                lanes,
            )
        elif flight.law.mode == OPEN_LOOP:
            command_plan(flight.circles, flown.commands, lanes)
        speeds, turn_rates = readings.speeds[step], readings.turn_rates[step]
        move_truly(flight, flown, step, speeds, turn_rates, lanes)
        sight_truly(flight, flown, step + 1, setup, readings.sightings, lanes)
        flown.places[0] += 1


@inner
def _part_gone(P: Array, flight: FlightSetup, step: int) -> None:
    """Make the poses of vehicles that are gone independent of all else; P is a lower triangle.

    They would share the wind with the others. The others' estimates do not depend on it.
    """
    for i in range(len(flight.circles.radii)):
        if flight.mishaps.gone_from[i] <= step:
            r = 3 * i
            P[r : r + 3, :r] = 0.0
            P[r + 3 :, r : r + 3] = 0.0


@inner
def _hear(setup: FilterSetup, sightings: Array, step: int, heard: Index, lanes: Lanes) -> None:
    """Note of whom, and by whom, the filter has taken in sightings at a step."""
    for s in range(setup.first[step], setup.first[step + 1]):
        if setup.kinds[s] == COMPASS_KIND:
            continue
        o, t = setup.observers[s], setup.targets[s]
        for lane in range(len(lanes)):
            if math.isfinite(sightings[s, lane]):
                heard[o, lane] = step
                if t < len(heard):
                    heard[t, lane] = step


@inner
def compare_truly(
    x: Array,
    errors: Array,
    flight: FlightSetup,
    flown: Flown,
    readings: AugmentedReadings,
    step: int,
    offs: Array,
    error_offs: Array,
    lanes: Lanes,
) -> None:
    """Fill in errors of poses (3n, lanes), headings wrapped, and of further states (e, lanes).

    Those of a vehicle that is gone are zero.
    """
    constants = len(readings.constants)
    for i in range(len(x)):
        there = 1.0 if step < flight.mishaps.gone_from[i] else 0.0
        for lane in range(len(lanes)):
            offs[3 * i, lane] = there * (x[i, 0, lane] - flown.path[step, i, 0, lane])
            offs[3 * i + 1, lane] = there * (x[i, 1, lane] - flown.path[step, i, 1, lane])
            off = x[i, 2, lane] - flown.path[step, i, 2, lane]
            turns = np.floor((off + math.pi) / (2.0 * math.pi))
            offs[3 * i + 2, lane] = there * (off - 2.0 * math.pi * turns)
    for k in range(len(errors)):
        true = readings.constants[k] if k < constants else readings.changing[step, k - constants]
        for lane in range(len(lanes)):
            error_offs[k, lane] = errors[k, lane] - true[lane]


@compiled
def fly_lanes(
    flight: FlightSetup,
    flown: Flown,
    setup: AugmentedSetup,
    readings: AugmentedReadings,
    statistics: AugmentedStatistics,
    lanes: Lanes,
    x: Array,
    errors: Array,
    P: Array,
    begin: int,
    end: int,
) -> None:
    """Take x, errors and P, lower triangle, from step `begin` to step `end`, flying on the way."""
    poses, n, size, width = setup.poses, len(x), len(P), len(lanes)
    slopes, before = np.empty((12, width)), np.empty((OWN, 3, width))
    halves = (np.empty((AT_ONCE, size, width)), np.empty((AT_ONCE, size, width)))
    row = (np.zeros(MOST_ENTRIES, dtype=np.int64), np.zeros((MOST_ENTRIES, width)))
    seen = (np.empty((4, width)), np.empty(width), np.zeros(width))
    frame = frame_of(setup, lanes)
    error_offs, block = np.empty_like(errors), np.empty((3 * n, 3 * n, width))
    scratch = (np.empty((3 * n, width)), np.empty_like(block), halves[0][0], halves[1][0])
    about, compared = (x, errors, False), (error_offs, scratch, block)
    offs = scratch[0]
    if begin == 0:
        compare_truly(x, errors, flight, flown, readings, 0, offs, error_offs, lanes)
        record_augmented(P, poses, 0, compared, statistics, lanes)
    for step in range(begin + 1, end + 1):
        ahead = min(step + flight.mishaps.late, flight.steps)
        fly_to(ahead, step - 1, x, errors, flight, flown, setup, readings, slopes, lanes)
        speeds, turn_rates = readings.speeds[step - 1], readings.turn_rates[step - 1]
        predict_augmented(
            x, errors, P, speeds, turn_rates, setup, step, frame, slopes, before, lanes
        )
        correct_augmented(
            x, errors, P, step, setup, readings, about, frame, seen, row, halves, statistics, lanes
        )
        _hear(poses, readings.sightings, step, flown.heard, lanes)
        looks = step % flight.contact.look_every == 0
        if step == end or looks or is_wanted_now(poses, step, statistics):
            bring_to_now(P, setup, frame, before, lanes)
            _part_gone(P, flight, step)
        if looks:
            heard, moved, sought = flown.heard, flown.moved, flown.sought
            move_circles(flight.contact, setup.columns, P, step, heard, moved, sought, lanes)
        compare_truly(x, errors, flight, flown, readings, step, offs, error_offs, lanes)
        record_augmented(P, poses, step, compared, statistics, lanes)
