"""Filter in plain NumPy, one trial at a time, with sightings of every kind.

This is the readable form; the compiled `lane_filter` is tested against it. The state stacks the
poses of n vehicles, (x, y, heading) each, and the bias states of a FilterSetup, 3 n + e in all. A
vehicle that reads v and w moves in a time T by

    (displacement((1 + scale) v, w + bias) + T drift, T (w + bias))

and bias states that are not constant decay. Turning at w with speed v moves it along a chord,

    displacement = v T s(a) e(heading + c w T),      a = w T / 2

    exact arc             s = sin(a) / a                  c = 1 / 2
    Euler, N sub-steps    s = sin(a) / (N sin(a / N))     c = (N - 1) / (2 N)

The second line is the closed form of the paper's Algorithm 1, the sum over k < N of
(v T / N) e(heading + k w T / N); it tends to the first as N grows. Here the sum itself is computed.
Sightings are those of syncplan.orbits.sighting_kinds, plus the shifts of the observer.

Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
10.3 (extended Kalman filter).
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.filter_setup import DELAY, DRIFT, SHIFT, SPEED, TURN, FilterSetup
from syncplan.orbits.circles import perpendicular, unit, wrap
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS

Read = tuple[Array, Array]
"""Readings of speed and turn rate, (n,) m/s and rad/s."""


def displacement(
    heading: Array, speed: Array, turn_rate: Array, time: float, substeps: int = 0
) -> Array:
    """Return the displacements (n, 2) in m over `time` s, by arc or by Euler sub-steps."""
    if substeps:
        turns = turn_rate[:, None] * time * np.arange(substeps) / substeps
        mean = unit(heading[:, None] + turns).mean(axis=1)
    else:
        half = 0.5 * turn_rate * time
        mean = np.sinc(half / np.pi)[:, None] * unit(heading + half)
    return np.asarray(speed[:, None] * time * mean)


def displacement_jacobian(
    heading: Array, speed: Array, turn_rate: Array, time: float, substeps: int = 0
) -> Array:
    """Return derivatives (n, 2, 2) of the displacement by speed (s) and turn rate (m s).

    Columns are speed and turn rate. For both ways of integrating, the derivative by heading is the
    displacement turned a quarter turn counter-clockwise.
    """
    by_speed = displacement(heading, np.ones_like(speed), turn_rate, time, substeps)
    if substeps:
        shares = time * np.arange(substeps) / substeps
        turned = perpendicular(unit(heading[:, None] + turn_rate[:, None] * shares))
        by_turn = (shares[:, None] * turned).mean(axis=1)
    else:
        half = 0.5 * turn_rate * time
        middle = unit(heading + half)
        sinc, slope = np.sinc(half / np.pi)[:, None], _sinc_slope(half)[:, None]
        by_turn = 0.5 * time * (slope * middle + sinc * perpendicular(middle))
    return np.stack([by_speed, speed[:, None] * time * by_turn], axis=-1)


def covariance_at_start(setup: FilterSetup) -> Array:
    """Return the covariance (3n + e, 3n + e) at time 0."""
    return np.diag(setup.initial_variances)


def moved_state(state: Array, speeds: Array, turn_rates: Array, setup: FilterSetup) -> Array:
    """Return the state (3n + e,) one sample later, from the readings (n,) m/s, rad/s."""
    n, motion = setup.vehicles, setup.motion
    x, after = state[: 3 * n].reshape(n, 3), state.copy()
    drift, scale, bias = _errors_of(state, setup)
    turns = turn_rates + bias
    way = displacement(x[:, 2], (1.0 + scale) * speeds, turns, motion.time, motion.substeps)
    way += motion.time * drift
    after[: 3 * n] += np.column_stack([way, motion.time * turns]).ravel()
    after[3 * n :] *= setup.states.decays
    return after


def transition_of(state: Array, speeds: Array, turn_rates: Array, setup: FilterSetup) -> Array:
    """Return F, the derivative (3n + e, 3n + e) of `moved_state` by the state."""
    n, time, substeps = setup.vehicles, setup.motion.time, setup.motion.substeps
    _, scale, bias = _errors_of(state, setup)
    ahead, grown, turns = state[2 : 3 * n : 3], (1.0 + scale) * speeds, turn_rates + bias
    way = displacement(ahead, grown, turns, time, substeps)
    slopes = displacement_jacobian(ahead, grown, turns, time, substeps)
    F = np.eye(len(state))
    for i in range(n):
        r = 3 * i
        F[r : r + 2, r + 2] = perpendicular(way[i])
        for act, column, axis in _acts_on(i, setup):
            if act == SPEED:
                F[r : r + 2, column] = slopes[i, :, 0] * speeds[i]
            elif act == TURN:
                F[r : r + 2, column], F[r + 2, column] = slopes[i, :, 1], time
            elif act == DRIFT:
                F[r + axis, column] = time
    further = range(3 * n, len(state))
    F[further, further] = setup.states.decays
    return F


def predict_state(
    state: Array, P: Array, speeds: Array, turn_rates: Array, setup: FilterSetup
) -> tuple[Array, Array]:
    """Return state and covariance one sample later."""
    n, motion = setup.vehicles, setup.motion
    F = transition_of(state, speeds, turn_rates, setup)
    _, scale, bias = _errors_of(state, setup)
    slopes = displacement_jacobian(
        state[2 : 3 * n : 3],
        (1.0 + scale) * speeds,
        turn_rates + bias,
        motion.time,
        motion.substeps,
    )
    G = np.zeros((len(state), 2 * n))
    for i in range(n):
        G[3 * i : 3 * i + 2, 2 * i] = slopes[i, :, 0] * (1.0 + scale[i])
        G[3 * i : 3 * i + 2, 2 * i + 1] = slopes[i, :, 1]
        G[3 * i + 2, 2 * i + 1] = motion.time
    Q = np.diag(np.tile([motion.speed_variance, motion.turn_rate_variance], n))
    after = F @ P @ F.T + G @ Q @ G.T
    further = range(3 * n, len(state))
    after[further, further] += setup.states.variances * (1.0 - setup.states.decays**2)
    return moved_state(state, speeds, turn_rates, setup), after


def sighted(
    state: Array,
    kind: int,
    observer: int,
    target: int,
    setup: FilterSetup,
    read: Read | None = None,
) -> tuple[float, Array]:
    """Return the expected value of a sighting and its derivative (3n + e,) by the state.

    `kind` is its place in SIGHTING_KINDS; targets from n on are landmarks. Angles are not wrapped.
    `read`, speeds and turn rates (n,) at the time, is needed if a clock offset is a state.
    """
    n, o, t = setup.vehicles, 3 * observer, 3 * target
    what = list(SIGHTING_KINDS.values())[kind]
    clock = max([-1, *(c for act, c, _ in _acts_on(observer, setup) if act == DELAY)])
    span = float(state[clock]) if clock >= 0 else 0.0
    here, own_rate = _later(state, observer, span, setup, read)
    there, rate = here, own_rate
    if target < n:
        there, rate = _later(state, target, span, setup, read)
    place = there[:2] if target < n else setup.landmarks[target - n]
    q = place - here[:2]
    value, row = float(what.measured(q, here[2])), np.zeros(len(state))
    slope = what.slopes(q[:, None], np.ones(1))[:, 0]
    row[o : o + 2] -= slope
    if target < n:
        row[t : t + 2] += slope
    row[o + 2] = what.by_heading
    if clock >= 0:
        gone = (rate[:2] if target < n else 0.0) - own_rate[:2]
        row[clock] = slope @ gone + what.by_heading * own_rate[2]
    shifts = zip(_acts_on(observer, setup), _kinds_of(observer, setup), strict=True)
    for (act, column, _), shifted in shifts:
        if act == SHIFT and shifted == kind:
            value, row[column] = value + float(state[column]), 1.0
    return value, row


def _later(
    state: Array, i: int, span: float, setup: FilterSetup, read: Read | None
) -> tuple[Array, Array]:
    """Pose (3,) of vehicle i after `span` s, by its readings, and its rate of change then."""
    pose = state[3 * i : 3 * i + 3]
    if read is None:
        return pose, np.zeros(3)
    air, scale, bias = (one[i] for one in _errors_of(state, setup))
    speed, turn = (1.0 + scale) * read[0][i], read[1][i] + bias
    halfway, then = unit(pose[2] + 0.5 * turn * span), unit(pose[2] + turn * span)
    return (
        np.append(pose[:2] + span * (speed * halfway + air), pose[2] + turn * span),
        np.append(speed * then + air, turn),
    )


def update_state(
    state: Array, P: Array, s: int, reading: float, setup: FilterSetup, read: Read | None = None
) -> tuple[Array, Array, float, float]:
    """Return state, covariance, innovation and its variance after sighting s of the set-up.

    State and covariance are unchanged if the reading is NaN, hence missed, or the gate rejects it.
    """
    kind = int(setup.kinds[s])
    o, t = int(setup.observers[s]), int(setup.targets[s])
    expected, h = sighted(state, kind, o, t, setup, read)
    u = P @ h
    variance = max(float(h @ u), 0.0) + float(setup.variances[s])
    innovation = reading - expected
    if list(SIGHTING_KINDS.values())[kind].unit == "rad":
        innovation = float(wrap(innovation))
    if math.isnan(reading) or not innovation**2 <= setup.gate * variance:
        return state, P, innovation, variance
    return state + u * (innovation / variance), P - np.outer(u, u) / variance, innovation, variance


def _acts_on(i: int, setup: FilterSetup) -> list[tuple[int, int, int]]:
    """Act, place in the state and first moved axis of each bias state of vehicle i."""
    states = setup.states
    own = slice(states.first[i] + 1, states.first[i + 1])
    return list(zip(states.acts[own], states.columns[own], states.axes[own, 0], strict=True))


def _kinds_of(i: int, setup: FilterSetup) -> list[int]:
    states = setup.states
    kinds: list[int] = states.kinds[states.first[i] + 1 : states.first[i + 1]].tolist()
    return kinds


def _errors_of(state: Array, setup: FilterSetup) -> tuple[Array, Array, Array]:
    """Air velocity (n, 2), speed scale (n,) and turn-rate bias (n,) of each vehicle."""
    n = setup.vehicles
    drift, scale, bias = np.zeros((n, 2)), np.zeros(n), np.zeros(n)
    for i in range(n):
        for act, column, axis in _acts_on(i, setup):
            if act == DRIFT:
                drift[i, axis] += state[column]
            elif act == SPEED:
                scale[i] += state[column]
            elif act == TURN:
                bias[i] += state[column]
    return drift, scale, bias


def _sinc_slope(angle: Array) -> Array:
    """Derivative of sin(a) / a, by its series near zero where the closed form cancels."""
    near = np.abs(angle) < 1e-2
    a = np.where(near, 1.0, angle)
    series = -angle / 3.0 + angle**3 / 30.0
    return np.where(near, series, (np.cos(a) - np.sin(a) / a) / a)
