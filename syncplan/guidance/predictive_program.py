"""The quadratic program of one vehicle, which improves a predicted flight.

Variables: changes of the guessed commands, x = (dv_0 .. dv_N-1, dw_0 .. dw_N-1) in units of the
plan's own speed V and rate; with separation also s >= 0, N shortfalls.

Objective, of the exact flight and of the program that models it:

    sum_m f(|e_m|) + heading (1 - cos(psi_N - plan's)) + effort / 2 sum_k (dev v_k^2 + dev w_k^2)
                   + shortfall sum of what separation lacks / near,
    f(e) = log(1 + (e / near)^2) / 2

e_m is the error of place after m steps, along and across the circle alike; dev is the deviation
from the commands that the plan needs in this wind, in units of V and rate. f counts near errors by
their square and hardly distinguishes far ones. The sum is therefore about the time spent away from
the plan's place, and its minimum a return in little more than the least time. The program has f's
quadratic majorant at the guess, |e_m|^2 / 2 with the weight 1 / (near^2 + |guessed e_m|^2).

Displacements in closed form. With d_k the way through the air in step k, g_m = d_0 + .. + d_m-1
and J a quarter turn,

    dp_m / dv_k = d_k / v_k = a_k,    dp_m / dw_k = b_k + h J (g_m - g_k+1),    b_k = dd_k / dw_k

so the Hessian needs sums over m > max(k, l) of q_m, q_m g_m and q_m |g_m|^2 alone.

Separation, for the nearest neighbours at each step m, with u the direction away from one:
u dp_m / near >= (asked - distance) / near - s_m / sqrt(shortfall),
which keeps s of the same size as x.

Sources: real-time iteration, Diehl, Bock, Schloeder (2005), SIAM J. Control Optim. 43(5);
quadratic majorants (iteratively reweighted least squares), Holland and Welsch (1977).
"""

import math
from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.kernels import inner, kernel
from syncplan.guidance.predictive_model import Bounds, Course, shortened


class Weights(NamedTuple):
    """Weights of the objective; see the module.

    Fields
    ------
    near : (n,) m, size of errors up to which their square counts
    heading, effort : dimensionless
    shortfall : cost of lacking `near` of separation
    speeds : (n,) m/s, V
    rate : rad/s
    separations : (n,) m, distance from others that each vehicle asks; 0 for none
    step : s
    """

    near: Array
    heading: float
    effort: float
    shortfall: float
    speeds: Array
    rate: float
    separations: Array
    step: float


class Program(NamedTuple):
    """Arrays of a quadratic program min x P x / 2 + q x, lower <= A x <= upper.

    Fields
    ------
    hessian : data of P's upper triangle, column by column
    gradient : q
    rows : data of A, column by column
    lower, upper : of the rows
    scale : (1,) factor of the objective
    """

    hessian: Array
    gradient: Array
    rows: Array
    lower: Array
    upper: Array
    scale: Array


@inner
def _asked_distance(i: int, j: int, m: int, poses: Array, weights: Weights) -> float:
    """Return the distance in m asked of vehicles i and j after m steps.

    Up to half a step before or after, they are then no nearer than the separation, if they fly
    straight.
    """
    x = (poses[i, m, 0] - poses[i, m - 1, 0]) - (poses[j, m, 0] - poses[j, m - 1, 0])
    y = (poses[i, m, 1] - poses[i, m - 1, 1]) - (poses[j, m, 1] - poses[j, m - 1, 1])
    return math.sqrt(weights.separations[i] ** 2 + 0.25 * (x * x + y * y))


@kernel
def _shortfall_of(i: int, own: Array, poses: Array, weights: Weights) -> tuple[float, float]:
    """Return the separation in m that flight `own` (N + 1, 3) lacks: its sum and its largest."""
    total, most = 0.0, 0.0
    if weights.separations[i] <= 0.0:
        return total, most
    for j in range(len(poses)):
        if j != i:
            for m in range(1, len(own)):
                x, y = own[m, 0] - poses[j, m, 0], own[m, 1] - poses[j, m, 1]
                asked = _asked_distance(i, j, m, poses, weights)
                if x * x + y * y < asked * asked:
                    lack = asked - math.sqrt(x * x + y * y)
                    total, most = total + lack, max(most, lack)
    return total, most


@kernel
def cost_of(
    i: int, commands: Array, own: Array, poses: Array, course: Course, weights: Weights
) -> tuple[float, float]:
    """Return the objective of a flight of vehicle i, and the largest separation in m it lacks.

    `commands` (N, 2), `own` (N + 1, 3) are its flight; `poses` (n, N + 1, 3) the others'.
    """
    near, places, feed = weights.near[i], course.places[i], course.feed[i]
    total, steps = 0.0, len(commands)
    for m in range(1, steps + 1):
        x, y = own[m, 0] - places[m, 0], own[m, 1] - places[m, 1]
        total += 0.5 * math.log(1.0 + (x * x + y * y) / near**2)
    total += weights.heading * (1.0 - math.cos(own[steps, 2] - course.headings[i, steps]))
    for k in range(steps):
        v = (commands[k, 0] - feed[k, 0]) / weights.speeds[i]
        w = (commands[k, 1] - feed[k, 1]) / weights.rate
        total += 0.5 * weights.effort * (v * v + w * w)
    lack, most = _shortfall_of(i, own, poses, weights)
    return total + weights.shortfall * lack / near, most


@kernel
def _slopes_of(commands: Array, poses: Array, step: float) -> tuple[Array, Array, Array]:
    """Return g (N + 1, 2) m, a (N, 2) s and b - h J g_k+1 (N, 2) m s of a flight."""
    steps = len(commands)
    gone, by_v, by_w = np.zeros((steps + 1, 2)), np.empty((steps, 2)), np.empty((steps, 2))
    for k in range(steps):
        v, w = commands[k, 0], commands[k, 1]
        a = 0.5 * step * w
        s = shortened(a)
        bend = (math.cos(a) - s) / a if abs(a) > 1e-4 else -a / 3.0
        c, d = math.cos(poses[k, 2] + a), math.sin(poses[k, 2] + a)
        by_v[k, 0], by_v[k, 1] = step * s * c, step * s * d
        gone[k + 1, 0] = gone[k, 0] + v * by_v[k, 0]
        gone[k + 1, 1] = gone[k, 1] + v * by_v[k, 1]
        half = 0.5 * step * step * v
        by_w[k, 0] = half * (bend * c - s * d) + step * gone[k + 1, 1]
        by_w[k, 1] = half * (bend * d + s * c) - step * gone[k + 1, 0]
    return gone, by_v, by_w


@inner
def _write_limits(
    i: int, commands: Array, before: Array, weights: Weights, bounds: Bounds, program: Program
) -> None:
    """Fill in the rows of limits and of changes; the guess is within them."""
    steps = len(commands)
    for d in range(2):
        unit = weights.speeds[i] if d == 0 else weights.rate
        for k in range(steps):
            here = commands[k, d]
            changed = here - (before[d] if k == 0 else commands[k - 1, d])
            row = d * steps + k
            program.lower[row] = min(bounds.least[i, d] - here, 0.0) / unit
            program.upper[row] = max(bounds.most[i, d] - here, 0.0) / unit
            row += 2 * steps
            program.lower[row] = min(-bounds.changes[i, d] - changed, 0.0) / unit
            program.upper[row] = max(bounds.changes[i, d] - changed, 0.0) / unit


@inner
def _scale(steps: int, program: Program) -> None:
    """Multiply P and q so that the mean of P's diagonal is 1."""
    total = 0.0
    for k in range(2 * steps):
        total += program.hessian[k * (k + 3) // 2]
    scale = 2.0 * steps / total
    for k in range(steps * (2 * steps + 1)):
        program.hessian[k] *= scale
    for k in range(2 * steps):
        program.gradient[k] *= scale
    program.scale[0] = scale


@kernel
def write_program(
    i: int,
    commands: Array,
    own: Array,
    before: Array,
    course: Course,
    weights: Weights,
    bounds: Bounds,
    program: Program,
) -> None:
    """Fill in P, q and the bounds of the program about a flight of vehicle i."""
    _write_limits(i, commands, before, weights, bounds, program)
    steps, step = len(commands), weights.step
    gone, by_v, by_w = _slopes_of(commands, own, step)
    units = weights.speeds[i], weights.rate
    near, places, feed = weights.near[i], course.places[i], course.feed[i]
    off = own[steps, 2] - course.headings[i, steps]
    pull = weights.heading * step * math.sin(off)
    bent = weights.heading * step * step * max(math.cos(off), 0.0)
    q0 = qx = qy = qq = rx = ry = rg = 0.0
    hessian, gradient = program.hessian, program.gradient
    for k in range(steps - 1, -1, -1):
        x, y = own[k + 1, 0] - places[k + 1, 0], own[k + 1, 1] - places[k + 1, 1]
        q = 1.0 / (near**2 + x * x + y * y)
        jx, jy = -gone[k + 1, 1], gone[k + 1, 0]
        q0, qx, qy, qq = q0 + q, qx + q * jx, qy + q * jy, qq + q * (jx * jx + jy * jy)
        rx, ry, rg = rx + q * x, ry + q * y, rg + q * (jx * x + jy * y)
        v = (commands[k, 0] - feed[k, 0]) / units[0]
        w = (commands[k, 1] - feed[k, 1]) / units[1]
        gradient[k] = units[0] * (by_v[k, 0] * rx + by_v[k, 1] * ry) + weights.effort * v
        slope = by_w[k, 0] * rx + by_w[k, 1] * ry + step * rg + pull
        gradient[steps + k] = units[1] * slope + weights.effort * w
        ax, ay, cx, cy = by_v[k, 0], by_v[k, 1], by_w[k, 0], by_w[k, 1]
        turn, late = (steps + k) * (steps + k + 1) // 2, k * (k + 1) // 2
        for m in range(k + 1):
            fx, fy, ex, ey = by_v[m, 0], by_v[m, 1], by_w[m, 0], by_w[m, 1]
            hessian[late + m] = units[0] ** 2 * q0 * (ax * fx + ay * fy)
            vw = fx * (cx * q0 + step * qx) + fy * (cy * q0 + step * qy)
            wv = ax * (ex * q0 + step * qx) + ay * (ey * q0 + step * qy)
            other = (steps + m) * (steps + m + 1) // 2
            hessian[turn + m] = units[0] * units[1] * vw
            hessian[other + k] = units[0] * units[1] * wv
            ww = q0 * (cx * ex + cy * ey) + step * ((cx + ex) * qx + (cy + ey) * qy)
            hessian[turn + steps + m] = units[1] ** 2 * (ww + step * step * qq + bent)
        hessian[late + k] += weights.effort
        hessian[turn + steps + k] += weights.effort
    _scale(steps, program)


@kernel
def _nearest(i: int, m: int, own: Array, poses: Array, weights: Weights, chosen: Index) -> None:
    """Fill in the vehicles with least margin over the distance asked at step m; -1 for none."""
    chosen[:] = -1
    margins = np.full(len(chosen), np.inf)
    for j in range(len(poses)):
        if j == i:
            continue
        x, y = own[m, 0] - poses[j, m, 0], own[m, 1] - poses[j, m, 1]
        margin = math.sqrt(x * x + y * y) - _asked_distance(i, j, m, poses, weights)
        place = len(chosen)
        while place > 0 and margin < margins[place - 1]:
            place -= 1
        for r in range(len(chosen) - 1, place, -1):
            chosen[r], margins[r] = chosen[r - 1], margins[r - 1]
        if place < len(chosen):
            chosen[place], margins[place] = j, margin


@kernel
def write_separation(
    i: int,
    commands: Array,
    own: Array,
    poses: Array,
    weights: Weights,
    starts: Index,
    neighbours: int,
    program: Program,
) -> None:
    """Add separation to P, q and the rows, after `write_program`.

    `starts` (3N,) is the place in A's data where the rows of separation begin in each column;
    `poses` (n, N + 1, 3) are the others' predicted flights.
    """
    steps, near = len(commands), weights.near[i]
    penalty = math.sqrt(weights.shortfall) * program.scale[0]
    gone, by_v, by_w = _slopes_of(commands, own, weights.step)
    own_v, own_w = weights.speeds[i] / near, weights.rate / near
    chosen = np.empty(neighbours, dtype=np.int64)
    for m in range(1, steps + 1):
        program.hessian[steps * (2 * steps + 1) + m - 1] = program.scale[0]
        program.gradient[2 * steps + m - 1] = penalty
        _nearest(i, m, own, poses, weights, chosen)
        for r in range(neighbours):
            j, ux, uy, lower = chosen[r], 0.0, 0.0, -np.inf
            if j >= 0:
                ux, uy = own[m, 0] - poses[j, m, 0], own[m, 1] - poses[j, m, 1]
                size = math.sqrt(ux * ux + uy * uy)
                ux, uy = ux / max(size, 1e-9), uy / max(size, 1e-9)
                lower = (_asked_distance(i, j, m, poses, weights) - size) / near
            program.lower[5 * steps + (m - 1) * neighbours + r] = lower
            side = weights.step * (uy * gone[m, 0] - ux * gone[m, 1])
            for k in range(m):
                entry = (m - 1 - k) * neighbours + r
                along = ux * by_v[k, 0] + uy * by_v[k, 1]
                across = ux * by_w[k, 0] + uy * by_w[k, 1] + side
                program.rows[starts[k] + entry] = own_v * along
                program.rows[starts[steps + k] + entry] = own_w * across
