"""Somebody else's multirotors: AscTec Hummingbirds of RotorPy with its aerodynamics and wind.

RotorPy (pypi.org/project/rotorpy; Folk, Paulos, Kumar, "RotorPy: A Python-based multirotor
simulator with aerodynamics for education and research", 2023). They are commanded under
`cmd_ctatt` by `velocity_loop`, a hundred times a second. By default they move by
`multirotor_lanes`; `own_steps` has RotorPy step each one itself.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.circles import dot, unit
from tests.crosschecks.multirotor_lanes import (
    ATTITUDE,
    PLACE,
    ROTORS,
    VELOCITY,
    WIND,
    Multirotors,
    attitude_of,
    multirotors_of,
)
from tests.crosschecks.plants import Done, MakePlant, Plant
from tests.crosschecks.velocity_loop import ALIGNED, LoopGains, VelocityLoop, yaw_of

STEP = 0.01
"""s, for which rotors are commanded."""

HEIGHT = 10.0

Mover = Callable[[Array, Array, Array], Array]
"""From states (k, 20), thrusts (k,) and attitudes (k, 3, 3): the states a STEP later."""


def hummingbird(**integrator: Any) -> Any:
    """Return a Hummingbird of RotorPy; `integrator` has further arguments of SciPy's solve_ivp."""
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    settings = {"method": "RK45", **integrator}
    return Multirotor(quad_params, control_abstraction="cmd_ctatt", integrator_kwargs=settings)


def own_steps(vehicle: Any) -> Mover:
    """Return what moves states by `vehicle.step`, one after the other."""
    from scipy.spatial.transform import Rotation

    def moved(states: Array, thrusts: Array, attitudes: Array) -> Array:
        wanted = Rotation.from_matrix(attitudes).as_quat()
        rows = []
        for state, thrust, quaternion in zip(states, thrusts, wanted, strict=True):
            control = {"cmd_thrust": thrust, "cmd_q": quaternion}
            after = vehicle.step(vehicle._unpack_state(state.copy()), control, STEP)
            rows.append(vehicle._pack_state(after))
        return np.array(rows)

    return moved


class RotorPyTeam:
    """k Hummingbirds; see `tests.crosschecks.plants`."""

    def __init__(
        self,
        vehicles: Multirotors,
        poses: Array,
        commands: Array,
        wind: Array,
        time: float,
        *,
        gains: LoopGains = ALIGNED,
        mover: Mover | None = None,
    ) -> None:
        k = len(poses)
        self.state = np.zeros((k, 20))
        self.state[:, :2], self.state[:, 2] = poses[:, :2], HEIGHT
        self.state[:, 3:5] = commands[:, :1] * unit(poses[:, 2]) + wind
        self.state[:, 8], self.state[:, 9] = np.sin(0.5 * poses[:, 2]), np.cos(0.5 * poses[:, 2])
        self.state[:, ROTORS] = np.sqrt(vehicles.mass * vehicles.g / (4.0 * vehicles.k_eta))
        self._loop = VelocityLoop(vehicles, gains, np.full(k, HEIGHT), poses[:, 2])
        self._yaw, self._steps = poses[:, 2].copy(), round(time / STEP)
        if abs(self._steps * STEP - time) > 1e-9:
            raise ValueError(f"a sample of {time} s is not a whole number of steps of {STEP} s")

        def in_lanes(states: Array, thrusts: Array, attitudes: Array) -> Array:
            return vehicles.step(states, vehicles.rotors_for(states, thrusts, attitudes), STEP)

        self._mover: Mover = mover or in_lanes

    def fly(self, commands: Array, wind: Array, disturbance: Array) -> Done:
        """Return what they do in the next sample, as Plant has it."""
        asked = commands + disturbance
        self.state[:, WIND][:, :2] = wind
        begun, flown = self._yaw, np.zeros(len(commands))
        before = self._air_speed()
        for _ in range(self._steps):
            demanded = self._loop.demand(self.state, self._yaw, asked, STEP)
            self.state = self._mover(self.state, *demanded)
            self._yaw = yaw_of(attitude_of(self.state[:, ATTITUDE]), self._yaw)
            after = self._air_speed()
            flown += 0.5 * (before + after) / self._steps
            before = after
        poses = np.column_stack([self.state[:, PLACE][:, :2], self._yaw])
        turned = (self._yaw - begun) / (self._steps * STEP)
        return Done(poses, np.column_stack([flown, turned]))

    def _air_speed(self) -> Array:
        """(k,) m/s, velocity through the air along the heading."""
        return dot((self.state[:, VELOCITY] - self.state[:, WIND])[:, :2], unit(self._yaw))


def hummingbirds(gains: LoopGains = ALIGNED) -> MakePlant:
    """Return what makes Hummingbirds."""
    vehicles = multirotors_of(hummingbird())

    def made(poses: Array, commands: Array, wind: Array, time: float) -> Plant:
        return RotorPyTeam(vehicles, poses, commands, wind, time, gains=gains)

    return made
