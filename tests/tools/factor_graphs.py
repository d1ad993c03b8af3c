"""The batch problem of one trial as a factor graph, and its solution by GTSAM.

Variables are the poses of all vehicles at all samples, constant errors and gusts. A step's factor
has three rows: the speed and the turn rate that two poses imply, less those read, and what must be
zero, as a step is an arc: the place across the chord's direction. Priors and compasses are GTSAM's
own factors, bearings and distances those of its poses. Gauss-Newton steps from the truth solve the
linear systems that GTSAM makes as sparse, symmetric ones of least squares under constraints: it
would eliminate constraints itself with up to 1e-4 sigma of rounding. Nothing is shared with
`estimation.batch_solution` but the readings.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gtsam
import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.filter_setup import (
    COMPASS_KIND,
    DISTANCE_KIND,
    DRIFT,
    SHIFT,
    SPEED,
    TURN,
)
from tests.tools.filter_scenes import Scene, true_state
from tests.tools.linear_systems import CONSTANT, GUST, POSE, WALK, LinearSystem

__all__ = ["GraphSolution", "TrialGraph"]

Factor = Callable[[gtsam.Values], tuple[Array, list[Array]]]
"""Of values: errors, and their derivatives by each of the factor's variables."""

MOVING = {DRIFT: ("wind x", "wind y"), SPEED: ("scale",), TURN: ("turn-rate bias",)}
"""What constants are that move a vehicle, of each act by axis."""

SAME, MOST_STEPS = 1e-12, 100
"""m and rad that the last step moves at most; steps."""


@dataclass(frozen=True, slots=True)
class GraphSolution:
    """The most likely trajectory.

    Attributes
    ----------
    start, end : (3n + e,) state at the first and the last sample
    start_sigmas, end_sigmas : (3n + e,) their standard deviations
    cost : twice the negative log-likelihood, less a constant
    """

    start: Array
    end: Array
    start_sigmas: Array
    end_sigmas: Array
    cost: float


class TrialGraph:
    """A factor graph of the first samples of a trial, and values of its variables."""

    def __init__(self, given: Scene, lane: int, steps: int) -> None:
        self.given, self.lane, self.steps = given, lane, steps
        self.setup, self.readings, _ = given
        states = self.setup.states
        self.n, self.e = self.setup.vehicles, len(states.variances)
        self.constants = states.first_changing - 3 * self.n
        changing = states.columns >= states.first_changing
        self.gusts = int(np.sum(changing & (states.acts == DRIFT))) // 2
        self.walks = self.e - self.constants - 2 * self.gusts
        self.graph, self.values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        self._add_errors()
        for i in range(self.n):
            self._add_vehicle(i)
        self._add_sightings()

    def solved(self) -> GraphSolution:
        """Return the solution from the truth on, by Gauss-Newton steps until they are rounding."""
        values = self.values
        for _ in range(MOST_STEPS):
            system = LinearSystem.of(self.graph, values)
            delta = system.solution()
            values = values.retract(system.split(delta))
            if np.max(np.abs(delta)) < SAME:
                break
        return GraphSolution(
            start=self._state(values, 0),
            end=self._state(values, self.steps),
            start_sigmas=self._sigmas(system, values, 0),
            end_sigmas=self._sigmas(system, values, self.steps),
            cost=2.0 * self.graph.error(values),
        )

    def _keys(self, step: int) -> list[int]:
        poses = [self._key(POSE, i, step) for i in range(self.n)]
        gusts = [self._key(GUST, g, step) for g in range(self.gusts)]
        return poses + gusts + [self._key(WALK, w, step) for w in range(self.walks)]

    def _key(self, letter: str, place: int, step: int = 0) -> int:
        return int(gtsam.symbol(letter, step * 1000 + place))

    def _state(self, values: gtsam.Values, step: int) -> Array:
        poses = [values.atPose2(self._key(POSE, i, step)) for i in range(self.n)]
        state = [value for pose in poses for value in (pose.x(), pose.y(), pose.theta())]
        state += [float(values.atVector(self._key(CONSTANT, c))[0]) for c in range(self.constants)]
        for key in self._keys(step)[self.n :]:
            state += values.atVector(key).tolist()
        return np.array(state)

    def _sigmas(self, system: "LinearSystem", values: gtsam.Values, step: int) -> Array:
        """(3n + e,) standard deviations at the first or the last sample."""
        keys = self._keys(step)
        keys[self.n : self.n] = [self._key(CONSTANT, c) for c in range(self.constants)]
        covariance = system.covariance(keys)
        for i in range(self.n):
            own, R = slice(3 * i, 3 * i + 3), _turned(values.atPose2(keys[i]))
            covariance[own, own] = R @ covariance[own, own] @ R.T
        return np.sqrt(np.diag(covariance))

    def _add(self, keys: list[int], sigmas: list[float], factor: Factor) -> None:
        """Add a factor of our own; a sigma of 0 is a constraint."""

        def error(_: Any, values: gtsam.Values, jacobians: Any) -> Array:
            errors, slopes = factor(values)
            if jacobians is not None:
                for place, slope in enumerate(slopes):
                    jacobians[place] = np.asfortranarray(slope)
            return errors

        noise = _noise(sigmas)
        self.graph.add(gtsam.CustomFactor(noise, keys, error))

    def _add_errors(self) -> None:
        """Constants and gusts, their priors, and how gusts go on."""
        states, truth, lane = self.setup.states, self.given.truth, self.lane
        sigmas = np.sqrt(states.variances)
        for c in range(self.constants):
            key = self._key(CONSTANT, c)
            self.values.insert(key, truth.constants[c : c + 1, lane])
            self.graph.add(gtsam.PriorFactorVector(key, np.zeros(1), _noise([sigmas[c]])))
        begin = 0
        each = [(GUST, g, 2) for g in range(self.gusts)] + [(WALK, w, 1) for w in range(self.walks)]
        for letter, place, size in each:
            own = slice(begin, begin + size)
            for k in range(self.steps + 1):
                self.values.insert(self._key(letter, place, k), truth.changing[k, own, lane])
            prior = sigmas[self.constants :][own]
            key = self._key(letter, place)
            self.graph.add(gtsam.PriorFactorVector(key, np.zeros(size), _noise(prior.tolist())))
            decay = float(states.decays[self.constants :][begin])
            for k in range(self.steps):
                keys = [self._key(letter, place, step) for step in (k, k + 1)]
                self._add_decay(keys, decay, prior * np.sqrt(1.0 - decay**2))
            begin += size

    def _add_decay(self, keys: list[int], decay: float, noise: Array) -> None:
        def error(values: gtsam.Values) -> tuple[Array, list[Array]]:
            before, after = (values.atVector(key) for key in keys)
            one = np.eye(len(noise))
            return after - decay * before, [-decay * one, one]

        self._add(keys, noise.tolist(), error)

    def _add_vehicle(self, i: int) -> None:
        """The poses of a vehicle, their prior, and its steps."""
        for k in range(self.steps + 1):
            x, y, ahead = true_state(self.given.truth, k, self.lane)[3 * i : 3 * i + 3].tolist()
            self.values.insert(self._key(POSE, i, k), gtsam.Pose2(x, y, ahead))
        x, y, heading = self.readings.initial[i, :, self.lane].tolist()
        east, north, about = np.sqrt(self.setup.initial_variances[3 * i : 3 * i + 3]).tolist()
        # translation's noise is along the axes of the pose: the same where both sigmas are
        assert east == north
        key = self._key(POSE, i)
        pose = gtsam.Pose2(x, y, heading)
        self.graph.add(gtsam.PoseTranslationPrior2D(key, pose, _noise([east, north])))
        self.graph.add(gtsam.PoseRotationPrior2D(key, pose, _noise([about])))
        for k in range(self.steps):
            self._add_step(i, k)

    def _add_step(self, i: int, k: int) -> None:
        """Add that two poses imply the speed and turn rate read, and lie on an arc."""
        motion = self.setup.motion
        step = _Step(
            time=motion.time,
            speed=float(self.readings.speeds[k, i, self.lane]),
            turn_rate=float(self.readings.turn_rates[k, i, self.lane]),
        )
        keys, names = [self._key(POSE, i, k), self._key(POSE, i, k + 1)], []
        for act, c, axis, _ in self._acts_on(i):
            if c < self.constants and act in MOVING:
                keys.append(self._key(CONSTANT, c))
                names.append(MOVING[act][axis if act == DRIFT else 0])
            elif act == DRIFT and axis == 0:
                keys.append(self._key(GUST, (c - self.constants) // 2, k))
                names.append("gust")

        def error(values: gtsam.Values) -> tuple[Array, list[Array]]:
            a, b = values.atPose2(keys[0]), values.atPose2(keys[1])
            known = {name: values.atVector(key) for name, key in zip(names, keys[2:], strict=True)}
            errors, slopes = step.errors(a, b, known)
            return errors, [slopes[name] for name in ("before", "after", *names)]

        sigmas = np.sqrt([motion.speed_variance, motion.turn_rate_variance]).tolist()
        self._add(keys, [*sigmas, 0.0], error)

    def _acts_on(self, i: int) -> list[tuple[int, int, int, int]]:
        """Act, place among the bias states, first axis and kind of each of vehicle i."""
        states = self.setup.states
        own = slice(states.first[i] + 1, states.first[i + 1])
        columns = states.columns[own] - 3 * self.n
        each = states.acts[own], columns, states.axes[own, 0], states.kinds[own]
        return list(zip(*(one.tolist() for one in each), strict=True))

    def _add_sightings(self) -> None:
        first = self.setup.first
        for k in range(1, self.steps + 1):
            for s in range(int(first[k]), int(first[k + 1])):
                reading = float(self.readings.sightings[s, self.lane])
                if not np.isnan(reading):
                    self._add_sighting(s, k, reading)

    def _add_sighting(self, s: int, k: int, reading: float) -> None:
        setup, n = self.setup, self.n
        o, t, kind = int(setup.observers[s]), int(setup.targets[s]), int(setup.kinds[s])
        keys, sigma = [self._key(POSE, o, k)], float(np.sqrt(setup.variances[s]))
        if kind == COMPASS_KIND:
            pose = gtsam.Pose2(0.0, 0.0, reading)
            self.graph.add(gtsam.PoseRotationPrior2D(keys[0], pose, _noise([sigma])))
            return
        landmark = setup.landmarks[t - n] if t >= n else None
        if landmark is None:
            keys.append(self._key(POSE, t, k))
        if kind == DISTANCE_KIND:
            self._add(keys, [sigma], _distance(keys, landmark, reading))
            return
        shifts = []
        for act, c, _, shifted in self._acts_on(o):
            if act == SHIFT and shifted == kind:
                walk = c - self.constants - 2 * self.gusts
                shifts.append(self._key(CONSTANT, c) if walk < 0 else self._key(WALK, walk, k))
        keys += shifts
        made = _bearing(keys, landmark, shifts, gtsam.Rot2(reading))
        self._add(keys, [sigma], made)


def _place(keys: list[int], landmark: Array | None, values: gtsam.Values) -> tuple[Array, Array]:
    """Where the target is, and its derivative by what GTSAM moves a pose by."""
    if landmark is not None:
        return landmark, np.zeros((2, 0))
    pose = values.atPose2(keys[1])
    return pose.translation(), _turned(pose)[:2]


def _distance(keys: list[int], landmark: Array | None, reading: float) -> Factor:
    """A distance as GTSAM's Pose2 has it."""

    def error(values: gtsam.Values) -> tuple[Array, list[Array]]:
        by_observer, by_place = np.zeros((1, 3), order="F"), np.zeros((1, 2), order="F")
        place, by_target = _place(keys, landmark, values)
        distance = values.atPose2(keys[0]).range(place, by_observer, by_place)
        return np.array([distance - reading]), [by_observer, by_place @ by_target][: len(keys)]

    return error


def _bearing(
    keys: list[int], landmark: Array | None, shifts: list[int], reading: gtsam.Rot2
) -> Factor:
    """A bearing as GTSAM's Pose2 has it; the last keys are those of what shifts it."""

    def error(values: gtsam.Values) -> tuple[Array, list[Array]]:
        by_observer, by_place = np.zeros((1, 3), order="F"), np.zeros((1, 2), order="F")
        place, by_target = _place(keys, landmark, values)
        bearing = values.atPose2(keys[0]).bearing(place, by_observer, by_place)
        bias = sum(float(values.atVector(key)[0]) for key in shifts)
        off = reading.between(bearing.compose(gtsam.Rot2(bias))).theta()
        slopes = [by_observer] + ([by_place @ by_target] if landmark is None else [])
        return np.array([off]), slopes + [np.ones((1, 1)) for _ in shifts]

    return error


def _turned(pose: gtsam.Pose2) -> Array:
    """(3, 3) derivative of x, y and heading by what GTSAM moves a pose by."""
    R = np.eye(3)
    R[:2, :2] = pose.rotation().matrix()
    return R


def _noise(sigmas: list[float]) -> Any:
    if all(one > 0.0 for one in sigmas):
        return gtsam.noiseModel.Diagonal.Sigmas(np.array(sigmas))
    return gtsam.noiseModel.Constrained.MixedSigmas(1.0, np.array(sigmas))


@dataclass(frozen=True, slots=True)
class _Step:
    """What a vehicle reads in a step of some length: s, m/s, rad/s."""

    time: float
    speed: float
    turn_rate: float

    def errors(
        self, a: gtsam.Pose2, b: gtsam.Pose2, known: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        """Errors (3,) of a step from a to b, and their derivatives by poses and errors known.

        With u along the chord's direction, half a turn h from the heading at a, and s = sin(h) / h,
        the vehicle has flown u . chord = (1 + scale) v T s through the air, and nothing across.
        """
        T, none = self.time, np.zeros(1)
        drift = np.concatenate([known.get("wind x", none), known.get("wind y", none)])
        grown = 1.0 + float(known.get("scale", none)[0])
        bias = float(known.get("turn-rate bias", none)[0])
        chord = b.translation() - a.translation() - T * (drift + known.get("gust", np.zeros(2)))
        turn = a.rotation().between(b.rotation()).theta()
        half = 0.5 * turn
        s = float(np.sinc(half / np.pi))
        by_half = (np.cos(half) - s) / half if abs(half) > 1e-4 else -half / 3.0
        direction = a.theta() + half
        u = np.array([np.cos(direction), np.sin(direction)])
        p = np.array([-u[1], u[0]])
        along, across, length = float(u @ chord), float(p @ chord), T * s * grown
        errors = np.array([along / length - self.speed, turn / T - bias - self.turn_rate, across])
        place = np.stack([u / length, np.zeros(2), p])
        swung = 0.5 * np.array([across / length, 0.0, -along])
        bent = np.array([-0.5 * along / length * by_half / s, 1.0 / T, 0.0])
        return errors, {
            "before": np.column_stack([-place, swung - bent]) @ _turned(a),
            "after": np.column_stack([place, swung + bent]) @ _turned(b),
            "wind x": -T * place[:, :1],
            "wind y": -T * place[:, 1:],
            "scale": np.array([[-along / length / grown], [0.0], [0.0]]),
            "turn-rate bias": np.array([[0.0], [-1.0], [0.0]]),
            "gust": -T * place,
        }
