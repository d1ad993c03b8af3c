"""How a plant answers commands: systematic errors on circles, and the lag of a first-order model.

A plant flies a straight or a circle until it is steady, then the command of speed or turn rate
takes a step. The lag is that with which a first-order response comes nearest, by least squares of
the means over samples.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from syncplan.arrays import Array
from tests.crosschecks.plants import MakePlant

SPEED, TURN_RATE = 0, 1
"""Columns of commands."""


@dataclass(frozen=True, slots=True)
class Step:
    """A step of commands: (speed m/s, turn rate rad/s) before and after, and how long each is held.

    `settle` and `watched` are in s.
    """

    before: tuple[float, float]
    after: tuple[float, float]
    settle: float
    watched: float

    @property
    def column(self) -> int:
        """Which command takes the step."""
        return SPEED if self.before[SPEED] != self.after[SPEED] else TURN_RATE


@dataclass(frozen=True, slots=True)
class Steady:
    """Mean errors of a steady flight: m/s, rad/s; and the rms velocity across the heading, m/s."""

    speed: float
    turn_rate: float
    slip: float


def flown(make: MakePlant, commands: Array, wind: Array, time: float) -> tuple[Array, Array]:
    """Return speeds and turn rates (steps, 2) that one vehicle flies, and its poses (steps, 3).

    `commands` is (steps, 2), `wind` (2,) m/s; samples last `time` s.
    """
    plant = make(np.zeros((1, 3)), commands[:1], wind[None], time)
    done, poses, none = [], [], np.zeros((1, 2))
    for command in commands:
        one = plant.fly(command[None], wind[None], none)
        done.append(one.means[0])
        poses.append(one.poses[0])
    return np.array(done), np.array(poses)


def lag_of(make: MakePlant, step: Step, time: float) -> float:
    """Return the lag in s of the first-order response nearest to a plant's, in still air.

    The mean over sample k of a response to a step of 1 is 1 - (1 - e^(-T / lag)) e^(-k T / lag)
    lag / T.
    """
    settle, watched = round(step.settle / time), round(step.watched / time)
    commands = np.repeat([step.before, step.after], [settle, watched], axis=0)
    found = flown(make, commands, np.zeros(2), time)[0][settle:, step.column]
    low, high = step.before[step.column], step.after[step.column]
    share = (found - low) / (high - low)

    def misfit(lag: float) -> float:
        left = np.exp(-time / lag)
        shares = 1.0 - (1.0 - left) * lag / time * left ** np.arange(watched)
        return float(np.sqrt(np.mean(np.square(share - shares))))

    return float(minimize_scalar(misfit, bounds=(1e-3, step.watched), method="bounded").x)


def steady_errors(
    make: MakePlant, command: tuple[float, float], wind: Array, time: float, settled: float
) -> Steady:
    """Return the mean errors of a circle in `wind` (2,) m/s, of which `settled` s are left out.

    It is looked at for as long again.
    """
    settle = watched = round(settled / time)
    done, poses = flown(make, np.tile(command, (settle + watched, 1)), wind, time)
    error = (done - command)[settle:].mean(axis=0)
    way = np.diff(poses[settle - 1 :], axis=0)[:, :2] / time - wind
    middle = 0.5 * (poses[settle - 1 : -1, 2] + poses[settle:, 2])
    across = np.cos(middle) * way[:, 1] - np.sin(middle) * way[:, 0]
    return Steady(float(error[0]), float(error[1]), float(np.sqrt(np.mean(across**2))))
