"""The simple model of flight as a plant: unicycles that lag behind their commands.

The response r to a command c follows r' = (c - r) / lag. In a sample of length T a vehicle flies an
arc at the response's mean, over ground moved by T times the wind:

    mean = c + (r - c) (1 - e^(-T / lag)) lag / T
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.reference_filter import displacement
from tests.crosschecks.plants import Done, MakePlant, Plant


class Response:
    """What vehicles without noise make of commands (..., 2) m/s, rad/s; the first are obeyed."""

    def __init__(self, commands: Array, lag: float, time: float) -> None:
        self._now = commands.copy()
        self._left = math.exp(-time / lag) if lag > 0.0 else 0.0
        self._mean = (1.0 - self._left) * lag / time

    def follow(self, commands: Array) -> Array:
        """Return the mean response (..., 2) over a sample."""
        off = self._now - commands
        self._now = commands + self._left * off
        return np.asarray(commands + self._mean * off)


class UnicycleTeam:
    """k unicycles; see `tests.crosschecks.plants`."""

    def __init__(self, poses: Array, commands: Array, lag: float, time: float) -> None:
        self._poses = poses.copy()
        self._response = Response(commands, lag, time)
        self._time = time

    def fly(self, commands: Array, wind: Array, disturbance: Array) -> Done:
        """Return what they do in the next sample, as Plant has it."""
        mean = self._response.follow(commands) + disturbance
        way = displacement(self._poses[:, 2], mean[:, 0], mean[:, 1], self._time)
        self._poses[:, :2] += way + self._time * wind
        self._poses[:, 2] += self._time * mean[:, 1]
        return Done(self._poses.copy(), mean)


def unicycles(lag: float = 0.0) -> MakePlant:
    """Return what makes unicycles that lag so many s."""

    def made(poses: Array, commands: Array, wind: Array, time: float) -> Plant:
        return UnicycleTeam(poses, commands, lag, time)

    return made
