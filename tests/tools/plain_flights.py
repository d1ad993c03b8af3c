"""The closed loop of a flight in plain NumPy, one trial at a time: to read, and to compare with.

It takes what is tested by itself: the filter to read of `reference_filter`, and of the package the
tracking law to read of `reference_tracking` and the tree of anchors. All else is written again from
its description: `plain_truth`, late sightings, losses, circles that move to their anchors, the
bound along the path.

The filter runs without batch solutions: `ekf` or `second-order`.
"""

import math
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.filter_setup import FilterSetup
from syncplan.guidance.anchors import Anchors, anchors_of
from syncplan.guidance.flight_setup import FlightLimits
from syncplan.guidance.reference_tracking import tracking_commands, tracking_gains
from syncplan.orbits.circles import wrap
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS
from syncplan.planning.plan_flights import FlightRun
from tests.tools.plain_filters import beyond_tangent
from tests.tools.plain_truth import PlainTruth, Sighting, planned, steps_until
from tests.tools.reference_filter import (
    covariance_at_start,
    moved_state,
    predict_state,
    sighted,
    update_state,
)

SURE_SIGMAS, LEAD_PERIODS, LOOKS_IN_PERIOD = 4.0, 0.5, 32


@dataclass(frozen=True, slots=True)
class PlainFlight:
    """A trial that was flown; the first axis of arrays is the step.

    Attributes
    ----------
    truth : what happened
    states : (steps + 1, 3n + e) estimates after the sightings of that step
    true_states : (steps + 1, 3n + e)
    variances : (steps + 1, 3n + e) of the estimates
    nees : (steps + 1,) e' P^-1 e of the poses of vehicles that are there
    bounds : (steps + 1, n) m^2, the bound's variance of the place
    moved : (steps + 1, n, 2) m, of circles
    sought : (n,) number of steps with a shift of its own
    there : (steps + 1, n) whether a vehicle takes part
    """

    truth: PlainTruth
    states: Array
    true_states: Array
    variances: Array
    nees: Array
    bounds: Array
    moved: Array
    sought: Array
    there: Array

    @property
    def offs(self) -> Array:
        """(steps + 1, n, 3) errors of the poses, headings wrapped; zero for who is gone."""
        n = self.there.shape[1]
        found = (self.states - self.true_states)[:, : 3 * n].reshape(-1, n, 3)
        found[..., 2] = wrap(found[..., 2])
        return np.asarray(found * self.there[..., None])

    def second_half(self, values: Array) -> Array:
        """(n,) mean of (steps + 1, n) over the second half, while a vehicle is there."""
        late = 2 * np.arange(len(values)) > len(values) - 1
        counted = late[:, None] & (self.there > 0)
        return np.asarray(np.sum(values * counted, axis=0) / counted.sum(axis=0))

    def longest_unseen(self) -> Array:
        """(n,) most steps without a sighting, while a vehicle is there."""
        waited = longest = np.zeros(self.there.shape[1])
        for seen, there in zip(self.truth.seen[1:], self.there[1:], strict=True):
            waited = np.where(seen, 0.0, waited + 1.0) * there
            longest = np.maximum(longest, waited)
        return longest

    def least_separation(self) -> float:
        """M between the two vehicles that come nearest at a sample."""
        a, b = np.triu_indices(self.there.shape[1], 1)
        apart = np.linalg.norm(np.diff(self.truth.path[:, [a, b], :2], axis=1)[:, 0], axis=-1)
        both = (self.there[:, a] * self.there[:, b]) > 0
        return float(apart[both].min(initial=np.inf))


def fly_plainly(run: FlightRun, trial: int) -> PlainFlight:
    """Return a trial of a flight."""
    truth, loop, steps = PlainTruth(run, trial), PlainLoop(run), run.team.steps
    n, late = run.team.team.count, run.options.late
    states, variances, moved = [loop.state], [np.diag(loop.P)], [loop.moved.copy()]
    there = np.array([[not truth.gone(i, k) for i in range(n)] for k in range(steps + 1)])
    trues = np.array([_true_state(run, truth, k) for k in range(steps + 1)])
    nees = [0.0]
    loop.lose(truth)
    for step in range(1, steps + 1):
        while truth.flown < min(step + late, steps):
            truth.fly(loop.commands(truth))
        loop.follow(truth)
        trues[step] = _true_state(run, truth, step)
        states.append(loop.state)
        variances.append(np.diag(loop.P))
        moved.append(loop.moved.copy())
        nees.append(_nees(loop, trues[step], there[step]))
    return PlainFlight(
        truth,
        np.array(states),
        trues,
        np.array(variances),
        np.array(nees),
        _bounds(run, truth, trues),
        np.array(moved),
        loop.sought,
        there.astype(float),
    )


class PlainLoop:
    """The filter and its steering; `state` and `P` are after the sightings of step `at`."""

    def __init__(self, run: FlightRun) -> None:
        self.run, self.team = run, run.team.team
        self.setup = run.team.filter_setup()
        none = np.zeros(len(self.setup.states.variances))
        self.state = np.concatenate([planned(self.team).ravel(), none])
        self.P = covariance_at_start(self.setup)
        self.moved, self.sought = np.zeros((self.team.count, 2)), np.zeros(self.team.count)
        self.anchors: Anchors = anchors_of(self.team, run.team.windows, run.limits.separation)
        self.at = 0

    def follow(self, truth: PlainTruth) -> None:
        """Take in what a sample brought: readings, sightings, losses."""
        self._predict(truth)
        self._correct(truth.sightings[self.at])
        self.lose(truth)
        samples = self.team.orbits.period / self.team.sensors.sample_time
        every = max(1, round(samples / LOOKS_IN_PERIOD))
        if self.at % every == 0:
            self._move_circles(truth, every)

    def _predict(self, truth: PlainTruth) -> None:
        """Take in the motion readings of a sample."""
        speeds, turn_rates = truth.speeds[self.at], truth.turn_rates[self.at]
        self.state, self.P = predict_state(self.state, self.P, speeds, turn_rates, self.setup)
        self.read = speeds, turn_rates
        self.at += 1

    def _correct(self, sightings: list[Sighting]) -> None:
        """Take in sightings."""
        for one in sightings:
            setup = _with(self.setup, one, _variance(one, self.team))
            setup.variances[0] += beyond_tangent(self.state, self.P, 0, setup)
            self.state, self.P, *_ = update_state(
                self.state, self.P, 0, one.reading, setup, self.read
            )

    def lose(self, truth: PlainTruth) -> None:
        """Go on without what is lost now."""
        n, windows, step = self.team.count, self.run.team.windows, self.at
        time = self.team.sensors.sample_time
        now = [one for one in truth.lost(step) if steps_until(one.time, time) == step]
        if not now:
            return
        for vehicle in (vehicle for one in now for vehicle in one.loss.vehicles):
            own = slice(3 * vehicle, 3 * vehicle + 3)
            kept = self.P[own, own].copy()
            self.P[own], self.P[:, own] = 0.0, 0.0
            self.P[own, own] = kept
            # whatever is thought of it: nobody's estimate depends on it
            self.state[own] += 1000.0
        there = np.array([not truth.gone(b, step) for b in range(n + len(self.team.landmarks))])
        blind = {o for one in truth.lost(step) for o in one.loss.sensors}
        left = np.array(
            [
                there[o] and there[t] and o not in blind
                for o, t in zip(windows.observers, windows.targets, strict=True)
            ],
            dtype=bool,
        )
        self.anchors = anchors_of(self.team, windows, self.run.limits.separation, left, there)

    def commands(self, truth: PlainTruth) -> Array:
        """Return commands (n, 2) of the sample that truth is about to fly."""
        run, orbits, step = self.run, self.team.orbits, truth.flown
        if run.options.guidance == "none":
            return np.column_stack([orbits.speeds, orbits.turn_rates])
        state, n, time = self.state, self.team.count, self.team.sensors.sample_time
        for k in range(self.at, step):
            state = moved_state(state, truth.speeds[k], truth.turn_rates[k], self.setup)
        poses, columns = state[: 3 * n].reshape(n, 3).copy(), self.run.team.layout.columns
        errors = np.append(state, 0.0)  # -1 stands for none
        drifts = [errors[columns[name]] for name in ("wind", "gusts") if name in columns]
        winds = sum(drifts, np.zeros((n, 2)))
        # a circle that is moved is as a vehicle that is moved the other way
        poses[:, :2] -= self.moved
        gains = tracking_gains(orbits, run.limits, time + (run.plan.scenario.motion.lag_s or 0.0))
        endless = np.full(n, np.inf)
        free = FlightLimits(-endless, endless, endless, 0.0)
        return tracking_commands(orbits, free, gains, step * time, poses, winds)

    def _move_circles(self, truth: PlainTruth, every: int) -> None:
        """Move circles to their anchors by what is not known for sure, for so many steps."""
        if self.run.options.guidance == "none":
            return
        found, n, time = self.anchors, self.team.count, self.team.sensors.sample_time
        patience = steps_until(self.team.orbits.period, time)
        for i in found.order.tolist():
            anchor = int(found.bodies[i])
            self.moved[i] = self.moved[anchor] if 0 <= anchor < n else 0.0
            if anchor < 0:
                continue
            h = found.toward[i] @ (self._ahead(i) - (self._ahead(anchor) if anchor < n else 0.0))
            missing = SURE_SIGMAS * math.sqrt(max(float(h @ self.P @ h), 0.0)) - found.slacks[i]
            by = min(max(missing, 0.0), found.most[i])
            if self.at - truth.last_seen(i, self.at) > patience:
                by = found.furthest[i]
            self.moved[i] += by * found.toward[i]
            self.sought[i] += every * (by > 0.0)

    def _ahead(self, i: int) -> Array:
        """(2, 3n + e): how a place half a period ahead hangs on the states now."""
        lead, gust_time = LEAD_PERIODS * self.team.orbits.period, self.team.errors.gust_time
        rows, columns = np.zeros((2, len(self.state))), self.run.team.layout.columns
        for axis in range(2):
            rows[axis, 3 * i + axis] = 1.0
            ahead = {"wind": lead, "gusts": gust_time * (1.0 - math.exp(-lead / gust_time))}
            for name, time in ahead.items():
                if name in columns and columns[name][i, axis] >= 0:
                    rows[axis, columns[name][i, axis]] = time
        return rows


def _variance(one: Sighting, team: object) -> float:
    """Of a sighting, in its unit squared."""
    kind = list(SIGHTING_KINDS.values())[one.kind]
    return float(kind.sigmas(team.sensors)[one.observer] ** 2)  # type: ignore[attr-defined]


def _with(setup: FilterSetup, one: Sighting, variance: float) -> FilterSetup:
    """The set-up with this sighting as its only one."""
    return setup._replace(
        kinds=np.array([one.kind]),
        observers=np.array([one.observer]),
        targets=np.array([one.target]),
        variances=np.array([variance]),
    )


def _true_state(run: FlightRun, truth: PlainTruth, step: int) -> Array:
    """(3n + e,) poses and the errors that are states."""
    n = truth.team.count
    found = np.zeros(run.team.size)
    found[: 3 * n] = truth.path[step].ravel()
    for name, columns in run.team.layout.columns.items():
        of_run = np.asarray(truth.errors[name])
        own = of_run[step] if name in ("gusts", "bearing_walk") else of_run
        values = np.broadcast_to(own.reshape(-1, columns.shape[1]), columns.shape)
        found[columns[columns >= 0]] = values[columns >= 0]
    return found


def _nees(loop: PlainLoop, true: Array, there: Array) -> float:
    n = loop.team.count
    off = (loop.state - true)[: 3 * n]
    off[2::3] = wrap(off[2::3])
    kept = np.repeat(there, 3)
    off, P = off[kept], loop.P[: 3 * n, : 3 * n][np.ix_(kept, kept)]
    return float(off @ np.linalg.solve(P, off))


def _bounds(run: FlightRun, truth: PlainTruth, trues: Array) -> Array:
    """(steps + 1, n) m^2, of the covariance that is linearised at the truth."""
    setup, n = run.team.filter_setup(), run.team.team.count
    P = covariance_at_start(setup)
    variances = [P.diagonal()[: 3 * n]]
    for step in range(1, run.team.steps + 1):
        speeds, turn_rates = truth.speeds[step - 1], truth.turn_rates[step - 1]
        _, P = predict_state(trues[step - 1], P, speeds, turn_rates, setup)
        for one in truth.sightings[step]:
            read = speeds, turn_rates
            _, h = sighted(trues[step], one.kind, one.observer, one.target, setup, read)
            u = P @ h
            P = P - np.outer(u, u) / (h @ u + _variance(one, run.team.team))
        variances.append(P.diagonal()[: 3 * n])
    return np.asarray(np.array(variances).reshape(-1, n, 3)[..., :2].sum(axis=-1))
