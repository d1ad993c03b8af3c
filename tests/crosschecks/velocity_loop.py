"""The inner loop of a multirotor: from air speed and turn rate to thrust and attitude.

With psi the actual yaw and u the horizontal velocity through the air, the acceleration asked for is

    a = gain (v e(psi) - u) + integral + v w J e(psi) + drag_share D u / m

The third term turns the velocity with the yaw, the last one holds against what RotorPy's drag would
be in level flight. Height is held by a spring, a damper and its own integral. The reference of yaw
is the integral of the turn rates commanded, so that a mean turn rate has no error. Everything is
relative to the air: a loop on the ground's velocity would be a hidden GPS.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.circles import dot, perpendicular, unit
from tests.crosschecks.multirotor_lanes import (
    ATTITUDE,
    PLACE,
    VELOCITY,
    WIND,
    Multirotors,
    attitude_of,
)

HEIGHT_GAINS = (4.0, 4.0, 1.0)
"""1/s^2, 1/s, 1/s^3: of height, of climb, of height's integral."""

MOST = 6.0
"""m/s^2 of horizontal acceleration, drag included: beyond 31 degrees of tilt yaw gets lost."""


@dataclass(frozen=True, slots=True)
class LoopGains:
    """How a velocity loop is set.

    Attributes
    ----------
    gain : 1/s, of velocity
    integral : 1/s^2, of velocity
    drag_share : of the drag in level flight that is held against
    """

    gain: float
    integral: float
    drag_share: float


ALIGNED = LoopGains(gain=6.0, integral=0.5, drag_share=1.0)
"""A vehicle that flies as it is commanded to."""

DROOPING = LoopGains(gain=10.0, integral=0.0, drag_share=0.0)
"""One that nobody aligned: at 4 m/s drag keeps it 0.18 m/s below what it is commanded."""


class VelocityLoop:
    """Loops of k vehicles at heights, with references of yaw (k,) rad."""

    def __init__(self, vehicles: Multirotors, gains: LoopGains, heights: Array, yaw: Array) -> None:
        self._vehicles, self._gains, self._heights = vehicles, gains, heights
        self._yaw = yaw.copy()
        self._integral = np.zeros((len(yaw), 2))
        self._climb = np.zeros(len(yaw))
        hover = np.sqrt(vehicles.mass * vehicles.g / (4.0 * vehicles.k_eta))
        self._rotor_drag = 4.0 * hover * float(vehicles.rotor_drag_matrix[0, 0])
        self._body_drag = float(vehicles.drag_matrix[0, 0])

    def demand(self, state: Array, yaw: Array, commands: Array, time: float) -> tuple[Array, Array]:
        """Return thrusts (k,) N and attitudes (k, 3, 3) to be held for `time` s.

        `yaw` (k,) rad is that of `state`; `commands` (k, 2) are m/s, rad/s.
        """
        speeds, turn_rates = commands.T
        gains, mass = self._gains, self._vehicles.mass
        ahead, air = unit(yaw), (state[:, VELOCITY] - state[:, WIND])[:, :2]
        off = speeds[:, None] * ahead - air
        left = perpendicular(ahead)
        # what is integrated turns with the vehicle: along its heading, and across
        held = self._integral[:, :1] * ahead + self._integral[:, 1:] * left
        pace = np.linalg.norm(air, axis=1, keepdims=True)
        drag = gains.drag_share * (self._rotor_drag + self._body_drag * pace) * air / mass
        centripetal = (speeds * turn_rates)[:, None] * left
        level = gains.gain * off + held + centripetal + drag
        share = np.minimum(1.0, MOST / np.maximum(np.linalg.norm(level, axis=1), MOST))[:, None]
        growth = gains.integral * time * np.column_stack([dot(off, ahead), dot(off, left)])
        self._integral += np.where(share < 1.0, 0.0, growth)
        self._yaw += time * turn_rates
        upwards = self._vehicles.g + self._lift(state, time)
        return self._thrust_and_attitude(state, mass * np.column_stack([share * level, upwards]))

    def _lift(self, state: Array, time: float) -> Array:
        """(k,) m/s^2 that bring the vehicles back to their heights."""
        low = self._heights - state[:, PLACE][:, 2]
        spring, damper, integral = HEIGHT_GAINS
        self._climb += integral * time * low
        return np.asarray(spring * low - damper * state[:, VELOCITY][:, 2] + self._climb)

    def _thrust_and_attitude(self, state: Array, force: Array) -> tuple[Array, Array]:
        """The force's part along the rotors' axis, and the attitude with the force and the yaw."""
        thrust = np.sum(force * attitude_of(state[:, ATTITUDE])[:, :, 2], axis=1)
        up = force / np.linalg.norm(force, axis=1, keepdims=True)
        heading = np.column_stack([unit(self._yaw), np.zeros(len(force))])
        left = np.cross(up, heading)
        left /= np.linalg.norm(left, axis=1, keepdims=True)
        return thrust, np.stack([np.cross(left, up), left, up], axis=2)


def yaw_of(attitudes: Array, before: Array) -> Array:
    """Return the yaw (k,) rad of attitudes (k, 3, 3), continuous from what it was `before`."""
    yaw = np.arctan2(attitudes[:, 1, 0], attitudes[:, 0, 0])
    return np.asarray(before + (yaw - before + np.pi) % (2.0 * np.pi) - np.pi)
