"""RotorPy's multirotor for many vehicles at once in NumPy: the same equations, much faster.

`rotorpy.vehicles.multirotor.Multirotor` steps one vehicle by SciPy's adaptive RK45, 26 evaluations
and 2 ms for a step of 0.01 s. Here its control of attitude and its derivative are written for lanes
of vehicles, and a step is one of RK4 in which the rotors, a linear lag of their own, are exact: 60
vehicles take 0.7 ms. What a vehicle weighs and how it drags are read from a Multirotor.
tests.crosschecks.test_others holds both to each other: derivatives to rounding, flights of seconds
to 0.1 mm.

A state is a row of RotorPy's own order: place 0:3, velocity 3:6, attitude 6:10 as a quaternion
x, y, z, w, body rates 10:13, wind 13:16, rotor speeds 16:20; z is up.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from syncplan.arrays import Array

PLACE, VELOCITY, ATTITUDE = slice(0, 3), slice(3, 6), slice(6, 10)
RATES, WIND, ROTORS = slice(10, 13), slice(13, 16), slice(16, 20)


@dataclass(frozen=True, slots=True)
class Multirotors:
    """What is the same for all lanes, by RotorPy's names."""

    mass: float
    g: float
    inertia: Array
    inv_inertia: Array
    drag_matrix: Array
    rotor_drag_matrix: Array
    rotor_geometry: Array
    rotor_dir: Array
    rotor_speed_min: float
    rotor_speed_max: float
    k_eta: float
    k_m: float
    k_h: float
    tau_m: float
    kp_att: float
    kd_att: float
    TM_to_f: Array

    def rotors_for(self, state: Array, thrusts: Array, wanted: Array) -> Array:
        """Return the rotor speeds (k, 4) rad/s for thrusts (k,) N and attitudes (k, 3, 3).

        As `get_cmd_motor_speeds` of a vehicle under `cmd_ctatt`, clipped as `step` does.
        """
        product = np.swapaxes(wanted, 1, 2) @ attitude_of(state[:, ATTITUDE])
        skew = 0.5 * (product - np.swapaxes(product, 1, 2))
        error = np.stack([-skew[:, 1, 2], skew[:, 0, 2], -skew[:, 0, 1]], axis=1)
        rates = state[:, RATES]
        turning = -self.kp_att * error - self.kd_att * rates
        moments = turning @ self.inertia.T + _cross(rates, rates @ self.inertia.T)
        squares = np.column_stack([thrusts, moments]) @ self.TM_to_f.T / self.k_eta
        speeds = np.sign(squares) * np.sqrt(np.abs(squares))
        return np.asarray(np.clip(speeds, self.rotor_speed_min, self.rotor_speed_max))

    def slope(self, state: Array, rotors: Array) -> Array:
        """Return the derivative (k, 20) of states by time at rotor speeds (k, 4) rad/s.

        As `_s_dot_fn`, but for the rotors' own, which is left zero.
        """
        R, rates = attitude_of(state[:, ATTITUDE]), state[:, RATES]
        air = _by(np.swapaxes(R, 1, 2), state[:, VELOCITY] - state[:, WIND])
        force, moment = self._wrench(air, rates, rotors)
        found = np.zeros_like(state)
        found[:, PLACE] = state[:, VELOCITY]
        found[:, VELOCITY] = _by(R, force) / self.mass
        found[:, 5] -= self.g
        found[:, ATTITUDE] = _turning(state[:, ATTITUDE], rates)
        gyroscopic = _cross(rates, rates @ self.inertia.T)
        found[:, RATES] = (moment - gyroscopic) @ self.inv_inertia.T
        return found

    def step(self, state: Array, rotors: Array, time: float) -> Array:
        """Return the states `time` s later, with rotor speeds (k, 4) commanded all the while."""
        begun = state[:, ROTORS] - rotors
        at = [rotors + begun * np.exp(-share * time / self.tau_m) for share in (0.0, 0.5, 1.0)]
        a = self.slope(state, at[0])
        b = self.slope(state + 0.5 * time * a, at[1])
        c = self.slope(state + 0.5 * time * b, at[1])
        d = self.slope(state + time * c, at[2])
        after = state + time / 6.0 * (a + 2.0 * (b + c) + d)
        after[:, ATTITUDE] /= np.linalg.norm(after[:, ATTITUDE], axis=1, keepdims=True)
        after[:, ROTORS] = np.clip(at[2], self.rotor_speed_min, self.rotor_speed_max)
        return after

    def _wrench(self, air: Array, rates: Array, rotors: Array) -> tuple[Array, Array]:
        """Force and moment (k, 3) on the body, along its axes."""
        at_rotors = air[:, None] + _cross(rates[:, None], self.rotor_geometry)
        forces = -rotors[..., None] * (at_rotors @ self.rotor_drag_matrix.T)
        forces[..., 2] += self.k_eta * rotors**2
        forces[..., 2] += self.k_h * (at_rotors[..., 0] ** 2 + at_rotors[..., 1] ** 2)
        moment = _cross(self.rotor_geometry, forces).sum(axis=1)
        moment[:, 2] += self.k_m * (rotors**2 @ self.rotor_dir)
        drag = np.linalg.norm(air, axis=1, keepdims=True) * (air @ self.drag_matrix.T)
        return forces.sum(axis=1) - drag, moment


def multirotors_of(vehicle: Any) -> Multirotors:
    """Return what RotorPy's Multirotor is; raises ValueError for what is not written for lanes."""
    if vehicle.k_flap != 0.0 or vehicle.motor_noise != 0.0 or not vehicle.aero:
        raise ValueError("flapping rotors, motor noise and no aerodynamics are not in these lanes")
    return Multirotors(**{name: getattr(vehicle, name) for name in Multirotors.__slots__})


def attitude_of(quaternions: Array) -> Array:
    """Return the matrices (k, 3, 3) that turn body axes to the world's, of any norm."""
    return np.asarray(Rotation.from_quat(quaternions).as_matrix())


def _turning(quaternions: Array, rates: Array) -> Array:
    """(k, 4) the derivative of quaternions at body rates (k, 3)."""
    x, y, z, w = quaternions.T
    p, q, r = rates.T
    return 0.5 * np.column_stack(
        [
            w * p - z * q + y * r,
            z * p + w * q - x * r,
            -y * p + x * q + w * r,
            -x * p - y * q - z * r,
        ]
    )


def _by(matrices: Array, vectors: Array) -> Array:
    """(k, 3) each matrix times its vector."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def _cross(a: Array, b: Array) -> Array:
    """Cross products of vectors (..., 3), in a tenth of the time that NumPy's takes for so few."""
    return np.asarray(a[..., _NEXT] * b[..., _LAST] - a[..., _LAST] * b[..., _NEXT])


_NEXT, _LAST = [1, 2, 0], [2, 0, 1]
"""Axes beside each of x, y and z."""
