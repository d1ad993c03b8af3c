"""The filter in plain NumPy, one trial at a time: arcs by readings, corrected by bearings.

This is the filter to read; `lane_filter` computes the same, compiled, and is tested against it.
The state is (x, y, heading) of each of n vehicles; its covariance runs over the 3n stacked.

Turning at w while driving v for a time T moves a vehicle along a chord,

    displacement = v T s(a) e(heading + c w T),      a = w T / 2

    exact arc             s = sin(a) / a                  c = 1 / 2
    Euler, N sub-steps    s = sin(a) / (N sin(a / N))     c = (N - 1) / (2 N)

The second line is the closed form of the paper's Algorithm 1, the sum over k < N of
(v T / N) e(heading + k w T / N); it tends to the first as N grows. Here the sum itself is computed.

Source of predict and update: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking
and Navigation, 2001, 10.3 (extended Kalman filter).
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.filter_setup import MotionModel
from syncplan.orbits.circles import perpendicular, unit, wrap
from syncplan.orbits.sighting_kinds import BEARING


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
    """Return (n, 2, 2): the derivative of the displacement by speed (s) and turn rate (m s).

    Columns are speed and turn rate. The derivative by heading is the displacement turned a
    quarter turn counter-clockwise, for either way of integrating.
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


def predict(
    x: Array, P: Array, speeds: Array, turn_rates: Array, motion: MotionModel
) -> tuple[Array, Array]:
    """Return state (n, 3) and covariance (3n, 3n) one sample later.

    `speeds` (n,) m/s and `turn_rates` (n,) rad/s are the readings of that sample.
    """
    time, substeps = motion.time, motion.substeps
    moved = displacement(x[:, 2], speeds, turn_rates, time, substeps)
    by_reading = displacement_jacobian(x[:, 2], speeds, turn_rates, time, substeps)
    n = len(x)
    F, G = np.eye(3 * n), np.zeros((3 * n, 2 * n))
    for i in range(n):
        F[3 * i : 3 * i + 2, 3 * i + 2] = perpendicular(moved[i])
        G[3 * i : 3 * i + 2, 2 * i : 2 * i + 2] = by_reading[i]
        G[3 * i + 2, 2 * i + 1] = time
    Q = np.diag(np.tile([motion.speed_variance, motion.turn_rate_variance], n))
    return x + np.column_stack([moved, turn_rates * time]), F @ P @ F.T + G @ Q @ G.T


def predict_bearing(x: Array, observer: int, target: int, landmarks: Array) -> tuple[float, Array]:
    """Return the bearing in rad (not wrapped) and its derivative (3n,) by the state (n, 3).

    Targets from n on are landmarks (m, 2).
    """
    n = len(x)
    q = (x[target, :2] if target < n else landmarks[target - n]) - x[observer, :2]
    slope = BEARING.slopes(q[:, None], np.ones(1))[:, 0]
    row = np.zeros((n, 3))
    row[observer, :2] = -slope
    row[observer, 2] = BEARING.by_heading
    if target < n:
        row[target, :2] = slope
    return float(BEARING.measured(q, x[observer, 2])), row.ravel()


def update(
    x: Array,
    P: Array,
    observer: int,
    target: int,
    bearing: float,
    sigma: float,
    landmarks: Array,
    gate: float = math.inf,
) -> tuple[Array, Array, float, float]:
    """Return state, covariance, innovation in rad and its variance after one bearing.

    The bearing counts only while innovation^2 <= gate * variance. `sigma` is in rad.
    """
    expected, h = predict_bearing(x, observer, target, landmarks)
    innovation = float(wrap(bearing - expected))
    u = P @ h
    variance = max(float(h @ u), 0.0) + sigma**2
    if not innovation**2 <= gate * variance:
        return x, P, innovation, variance
    gained = (u * (innovation / variance)).reshape(x.shape)
    return x + gained, P - np.outer(u, u) / variance, innovation, variance


def _sinc_slope(angle: Array) -> Array:
    """Derivative of sin(a) / a, by its series near zero where the closed form cancels."""
    near = np.abs(angle) < 1e-2
    a = np.where(near, 1.0, angle)
    series = -angle / 3.0 + angle**3 / 30.0
    return np.where(near, series, (np.cos(a) - np.sin(a) / a) / a)
