"""The tracking law in plain NumPy: commands from estimates, as syncplan.flight has it.

With p and V the place and velocity of the plan, p^ and psi^ the estimates, w^ the estimate of wind
and gust, and omega the rate of the plan:

    u = V + clip(kp (p - p^)) - w^                        velocity wanted through the air
    v = |u| cos(psi_u - psi^)                             air speed
    w = rate of turn of (V - w^) + k_psi (psi_u - psi^)   turn rate
    kp = a omega,  k_psi = 4 a omega

Places and headings then settle as s^2 + k_psi s + k_psi kp, critically damped.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.flight.flight_limits import FlightLimits
from syncplan.orbits.circles import Orbits, cross, dot, perpendicular, phase, position, unit, wrap

__all__ = ["TrackingLaw"]


@dataclass(frozen=True, slots=True)
class TrackingLaw:
    """How vehicles are brought back to their plan.

    Attributes
    ----------
    orbits : the plan
    limits : of the commands
    haste : a, in times the plan's rate
    pull : of the plan's speed, the most that a place error may ask for
    """

    orbits: Orbits
    limits: FlightLimits
    haste: float = 2.5
    pull: float = 0.5

    def commands(self, time: float, poses: Array, wind: Array) -> Array:
        """Return (trials, n, 2) m/s, rad/s from estimates (trials, n, 3) and (trials, n, 2)."""
        orbits, limits = self.orbits, self.limits
        gain = self.haste * orbits.rate
        velocity = (orbits.speeds * orbits.senses)[:, None] * perpendicular(
            unit(phase(orbits, time))
        )
        back = gain * (position(orbits, time) - poses[..., :2])
        most = self.pull * orbits.speeds
        back *= np.minimum(1.0, most / np.maximum(np.linalg.norm(back, axis=-1), 1e-12))[..., None]
        wanted, through_air = velocity + back - wind, velocity - wind
        off = wrap(np.arctan2(wanted[..., 1], wanted[..., 0]) - poses[..., 2])
        turning = perpendicular(velocity) * orbits.turn_rates[:, None]
        ahead = cross(through_air, turning) / np.maximum(dot(through_air, through_air), 1e-12)
        speeds = np.linalg.norm(wanted, axis=-1) * np.cos(off)
        turns = np.clip(ahead + 4.0 * gain * off, -limits.most_turn_rates, limits.most_turn_rates)
        speeds = np.clip(speeds, limits.least_speeds, limits.most_speeds)
        return np.stack([speeds, turns], axis=-1)
