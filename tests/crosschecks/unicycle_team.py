"""The simple model of flight as a loop in plain NumPy: unicycles that lag behind their commands.

The response r to a command c follows r' = (c - r) / lag. In a sample of length T a vehicle flies an
arc at the response's mean, over ground moved by T times the wind:

    mean = c + (r - c) (1 - e^(-T / lag)) lag / T
"""

import math
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.reference_filter import displacement
from tests.crosschecks.plants import Done, Plant

__all__ = ["STILL", "Lag", "Response", "UnicycleTeam", "unicycles"]


@dataclass(frozen=True, slots=True)
class Lag:
    """Time constants in s of a vehicle's response in speed and in turn rate; 0 is at once."""

    speed: float = 0.0
    turn_rate: float = 0.0


STILL = Lag()


class Response:
    """What k vehicles without noise make of their commands."""

    def __init__(self, speeds: Array, lag: Lag, time: float) -> None:
        self._now = np.column_stack([speeds, np.zeros_like(speeds)])
        lags = np.array([lag.speed, lag.turn_rate])
        self._left = np.array([math.exp(-time / one) if one > 0.0 else 0.0 for one in lags])
        self._mean = (1.0 - self._left) * lags / time

    def follow(self, commands: Array) -> Array:
        """Return the mean response (k, 2) m/s, rad/s over a sample of commands (k, 2)."""
        off = self._now - commands
        self._now = commands + self._left * off
        return np.asarray(commands + self._mean * off)


class UnicycleTeam:
    """k unicycles; see `tests.crosschecks.plants`."""

    def __init__(self, poses: Array, speeds: Array, lag: Lag, time: float) -> None:
        self._poses = poses.copy()
        self._response = Response(speeds, lag, time)
        self._time = time

    def fly(self, speeds: Array, turn_rates: Array, wind: Array, disturbance: Array) -> Done:
        """Return what they do in the next sample, as Plant has it."""
        mean = self._response.follow(np.column_stack([speeds, turn_rates])) + disturbance
        done, turned = mean[:, 0], mean[:, 1]
        way = displacement(self._poses[:, 2], done, turned, self._time)
        self._poses[:, :2] += way + self._time * wind
        self._poses[:, 2] += self._time * turned
        return Done(self._poses.copy(), done, turned)


def unicycles(lag: Lag = STILL) -> "_Unicycles":
    """Return what makes unicycles of a lag."""
    return _Unicycles(lag)


@dataclass(frozen=True, slots=True)
class _Unicycles:
    lag: Lag

    def __call__(self, poses: Array, speeds: Array, wind: Array, time: float) -> Plant:
        return UnicycleTeam(poses, speeds, self.lag, time)
