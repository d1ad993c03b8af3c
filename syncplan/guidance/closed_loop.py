"""The closed loop: vehicles fly by their estimates, and the filter estimates from their readings.

Each sample:

    steer    commands from the estimate
    move     true motion by these commands        `truth`
    sight    true sightings                       `truth`
    filter   prediction by the readings, correction by the sightings; error statistics

Where sightings arrive late, the filter stays that many samples behind. Vehicles steer by its
estimate, propagated with the readings since.

The filter and its state are those of `lane_filter`.
"""

import math

from syncplan.arrays import Array, Index
from syncplan.estimation.filter_setup import COMPASS_KIND, FilterRun, FilterSetup, Truth
from syncplan.estimation.kernels import Lanes, inner, lean
from syncplan.estimation.lane_filter import Scratch, step_filter
from syncplan.estimation.motion_kernels import bring_to_now, copy, move
from syncplan.estimation.statistics_kernels import (
    Comparison,
    fill_errors,
    fill_truth,
    is_sampled,
    record,
)
from syncplan.guidance.flight_options import OPEN_LOOP, TRACKING
from syncplan.guidance.flight_setup import FlightSetup, Flown
from syncplan.guidance.tracking_law import command_plan, move_circles, track
from syncplan.guidance.truth import move_truly, sight_truly


@lean
def carry_on(
    x: Array,
    ahead: Array,
    speeds: Array,
    turn_rates: Array,
    setup: FilterSetup,
    slopes: Array,
    lanes: Lanes,
) -> None:
    """Fill in `ahead` (3n + e, lanes), the estimate x propagated with readings (k, n, lanes)."""
    copy(x, ahead, lanes)
    for k in range(len(speeds)):
        read, turned = speeds[k], turn_rates[k]
        for i in range(len(read)):
            move(ahead, i, read, turned, setup.motion, setup.states, slopes, lanes)


@lean
def fly_to(
    target: int,
    at: int,
    x: Array,
    flight: FlightSetup,
    flown: Flown,
    run: FilterRun,
    slopes: Array,
    lanes: Lanes,
) -> None:
    """Fly until step `target` by the filter's estimate x, which is that of step `at`."""
    setup, readings = run.setup, run.readings
    while flown.places[0] < target:
        step = flown.places[0]
        speeds, turn_rates = readings.speeds[at:step], readings.turn_rates[at:step]
        carry_on(x, flown.ahead, speeds, turn_rates, setup, slopes, lanes)
        if flight.law.mode == TRACKING:
            time, now, moved = step * flight.time, flown.ahead, flown.moved
            track(flight.circles, flight.law, time, now, setup.states, moved, flown.commands, lanes)
        elif flight.law.mode == OPEN_LOOP:
            command_plan(flight.circles, flown.commands, lanes)
        move_truly(flight, flown, step, readings.speeds[step], readings.turn_rates[step], lanes)
        sight_truly(flight, flown, step + 1, setup, readings.sightings, lanes)
        flown.places[0] += 1


@inner
def _part_gone(P: Array, flight: FlightSetup, step: int) -> None:
    """Decorrelate the poses of lost vehicles from all other states; P is a lower triangle.

    Otherwise they would share the wind with others. Estimates of other vehicles do not change.
    """
    for i in range(len(flight.circles.radii)):
        if flight.mishaps.gone_from[i] <= step:
            r = 3 * i
            P[r : r + 3, :r] = 0.0
            P[r + 3 :, r : r + 3] = 0.0


@inner
def _hear(setup: FilterSetup, sightings: Array, step: int, heard: Index, lanes: Lanes) -> None:
    """Record a step in `heard` for each observer and target of the sightings processed then."""
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
def _compare(
    x: Array, flight: FlightSetup, truth: Truth, step: int, compared: Comparison, lanes: Lanes
) -> None:
    """Fill in the errors at a step; pose errors of lost vehicles are zero."""
    n = len(flight.circles.radii)
    fill_truth(compared.true, truth, step, lanes)
    fill_errors(x, compared.true, n, compared.errors, lanes)
    for i in range(n):
        if flight.mishaps.gone_from[i] <= step:
            compared.errors[3 * i : 3 * i + 3] = 0.0


@lean
def fly_lanes(
    flight: FlightSetup,
    flown: Flown,
    run: FilterRun,
    scratch: Scratch,
    lanes: Lanes,
    x: Array,
    P: Array,
    begin: int,
    end: int,
) -> None:
    """Advance x and P, lower triangle, from step `begin` to step `end`, flying on the way."""
    setup, readings, truth, statistics = run.setup, run.readings, run.truth, run.statistics
    frame, work, compared = scratch
    if begin == 0:
        _compare(x, flight, truth, begin, compared, lanes)
        record(P, setup, begin, frame, work, compared, statistics, lanes)
    for step in range(begin + 1, end + 1):
        ahead = min(step + flight.mishaps.late, flight.steps)
        fly_to(ahead, step - 1, x, flight, flown, run, work.slopes, lanes)
        step_filter(x, P, step, run, frame, work, lanes)
        _hear(setup, readings.sightings, step, flown.heard, lanes)
        looks = step % flight.contact.look_every == 0
        if step == end or looks or is_sampled(setup, step) or len(statistics.series):
            bring_to_now(P, setup.states, frame, lanes)
            _part_gone(P, flight, step)
        if looks:
            heard, moved, sought = flown.heard, flown.moved, flown.sought
            move_circles(flight.contact, setup.states, P, step, heard, moved, sought, work, lanes)
        _compare(x, flight, truth, step, compared, lanes)
        record(P, setup, step, frame, work, compared, statistics, lanes)
