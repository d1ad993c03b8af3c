"""The tracking law in plain NumPy: commands from estimates, as syncplan.flight has it.

With p and V the plan's place and velocity, p^ and psi^ the estimates, w^ that of wind and gust:

    u = V + clip(kp (p - p^)) - w^                        velocity wanted through the air
    v = |u| cos(psi_u - psi^)                             air speed
    w = rate of turn of (V - w^) + k_psi (psi_u - psi^)   turn rate

within the vehicles' limits. Circles stay where the plan has them.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.circles import Orbits, cross, dot, perpendicular, phase, position, unit, wrap

__all__ = ["TrackingLaw"]


@dataclass(frozen=True, slots=True)
class TrackingLaw:
    """How vehicles are brought back to their plan.

    Attributes
    ----------
    orbits : the plan
    place_gain, heading_gain : kp, k_psi, 1/s
    closing : (n,) m/s, the most that a place error may ask for
    least, most : (n, 2) m/s, rad/s, of commands
    """

    orbits: Orbits
    place_gain: float
    heading_gain: float
    closing: Array
    least: Array
    most: Array

    def commands(self, time: float, poses: Array, wind: Array) -> Array:
        """Return (trials, n, 2) m/s, rad/s from estimates (trials, n, 3) and (trials, n, 2)."""
        orbits = self.orbits
        ahead = perpendicular(unit(phase(orbits, time)))
        velocity = (orbits.senses * orbits.speeds)[:, None] * ahead
        back = self.place_gain * (position(orbits, time) - poses[..., :2])
        size = np.maximum(np.linalg.norm(back, axis=-1), 1e-12)
        back *= np.minimum(1.0, self.closing / size)[..., None]
        free = velocity - wind
        wanted, bent = free + back, orbits.turn_rates[:, None] * perpendicular(velocity)
        turn = wrap(np.arctan2(wanted[..., 1], wanted[..., 0]) - poses[..., 2])
        speeds = np.linalg.norm(wanted, axis=-1) * np.maximum(np.cos(turn), 0.0)
        turning = cross(free, bent) / np.maximum(dot(free, free), 1e-12)
        turn_rates = turning + self.heading_gain * turn
        commands = np.stack([speeds, turn_rates], axis=-1)
        return np.asarray(np.clip(commands, self.least, self.most))
