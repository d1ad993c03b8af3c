"""Filters in plain NumPy, one trial at a time: steps by `reference_filter` and along the truth."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.filter_setup import (
    COMPASS_KIND,
    DISTANCE_KIND,
    FilterSetup,
    start_of,
)
from syncplan.orbits.circles import unit, wrap
from tests.tools.filter_scenes import Scene, derivative, true_state
from tests.tools.reference_filter import (
    _errors_of,
    covariance_at_start,
    moved_state,
    predict_state,
    sighted,
    transition_of,
    update_state,
)


class Plain(NamedTuple):
    """A step of a plain filter.

    Fields
    ------
    sample : of the truth that it is compared with, or -1
    x, P : state (3n + e,) and covariance
    error : (3n + e,) what it is off the truth, where it is compared
    made : (s, 2) innovations of its sightings and their variances
    """

    sample: int
    x: Array
    P: Array
    error: Array
    made: Array


def in_step(setup: FilterSetup, k: int) -> FilterSetup:
    """The set-up of step k, whose readings hold for all of it: their errors are random walks."""
    motion, span = setup.motion, float(setup.spans[k - 1])
    held = motion._replace(
        time=span,
        speed_variance=motion.speed_variance * motion.time / span,
        turn_rate_variance=motion.turn_rate_variance * motion.time / span,
    )
    decays = setup.states.decays ** (span / motion.time)
    return setup._replace(motion=held, states=setup.states._replace(decays=decays))


def beyond_tangent(x: Array, P: Array, s: int, setup: FilterSetup) -> float:
    """Variance of a sighting's term of second order, for normal errors along and across it."""
    kind, o, t = setup.kinds[s], 3 * setup.observers[s], 3 * setup.targets[s]
    if not setup.second_order or kind == COMPASS_KIND:
        return 0.0
    relative = np.zeros((2, len(x)))
    relative[:, o : o + 2] = -np.eye(2)
    q = -x[o : o + 2]
    if t < 3 * setup.vehicles:
        relative[:, t : t + 2] = np.eye(2)
        q = q + x[t : t + 2]
    else:
        q = q + setup.landmarks[t // 3 - setup.vehicles]
    rho = np.hypot(*q)
    axes = np.array([[q[0], q[1]], [-q[1], q[0]]]) / rho @ relative
    (aa, ab), (_, bb) = axes @ P @ axes.T
    return float(bb**2 / (2.0 * rho**2) if kind == DISTANCE_KIND else (aa * bb + ab**2) / rho**4)


def extended_steps(given: Scene, lane: int) -> Iterator[Plain]:
    """The filter to read, of `reference_filter`."""
    setup, readings, truth = given
    n, C = setup.vehicles, covariance_at_start(setup)
    x = start_of(setup, readings)[0][:, lane]
    for k in range(1, len(setup.spans) + 1):
        step, sample = in_step(setup, k), int(setup.compared[k])
        read = readings.speeds[k - 1, :, lane], readings.turn_rates[k - 1, :, lane]
        x, C = predict_state(x, C, *read, step)
        made = []
        for s in range(setup.first[k], setup.first[k + 1]):
            variances = step.variances + beyond_tangent(x, C, s, setup)
            z, noisy = float(readings.sightings[s, lane]), step._replace(variances=variances)
            x, C, nu, S = update_state(x, C, s, z, noisy, read)
            made.append((nu, S))
        error = x - true_state(truth, max(sample, 0), lane)
        error[2 : 3 * n : 3] = wrap(error[2 : 3 * n : 3])
        yield Plain(sample, x, C, error, np.reshape(made, (-1, 2)))


def true_readings(given: Scene, k: int, lane: int) -> Array:
    """Speeds and turn rates (2n,) that lead along arcs through the air to the truth at sample k."""
    setup, _, truth = given
    before, after = (true_state(truth, one, lane) for one in (k - 1, k))
    n, time = setup.vehicles, setup.motion.time
    drift, scale, bias = _errors_of(before, setup)
    way, turn = np.split((after - before)[: 3 * n].reshape(n, 3), [2], axis=1)
    turn, ahead = wrap(turn[:, 0]), before[2 : 3 * n : 3]
    along = np.sum((way - time * drift) * unit(ahead + 0.5 * turn), axis=1)
    path = along / np.sinc(turn / (2.0 * np.pi))
    return np.concatenate([path / (time * (1.0 + scale)), turn / time - bias])


def ideal_steps(given: Scene, lane: int) -> Iterator[Plain]:
    """A linear filter along the truth."""
    setup, readings, truth = given
    n, P = setup.vehicles, covariance_at_start(setup)
    off = start_of(setup, readings)[0][:, lane] - true_state(truth, 0, lane)
    for k in range(1, len(setup.spans) + 1):
        before, after = true_state(truth, k - 1, lane), true_state(truth, k, lane)
        true = true_readings(given, k, lane)
        read = readings.speeds[k - 1, :, lane], readings.turn_rates[k - 1, :, lane]
        G = derivative(lambda one: moved_state(before, one[:n], one[n:], setup), true, 1e-5)  # noqa: B023
        moved, P = predict_state(before, P, true[:n], true[n:], setup)
        missed = moved - after
        missed[2 : 3 * n : 3] = wrap(missed[2 : 3 * n : 3])
        F = transition_of(before, true[:n], true[n:], setup)
        off = F @ off + G @ (np.concatenate(read) - true) + missed
        made = []
        for s in range(setup.first[k], setup.first[k + 1]):
            o, t, kind = (int(one[s]) for one in (setup.observers, setup.targets, setup.kinds))
            expected, h = sighted(after, kind, o, t, setup, read)
            u, nu = P @ h, float(readings.sightings[s, lane]) - expected
            S = float(h @ u) + float(setup.variances[s])
            nu = (nu if kind == DISTANCE_KIND else float(wrap(nu))) - float(h @ off)
            if nu**2 <= setup.gate * S:
                off, P = off + u * nu / S, P - np.outer(u, u) / S
            made.append((nu, S))
        yield Plain(k, after + off, P, off, np.reshape(made, (-1, 2)))
