"""The tracking law in plain NumPy: commands from estimates, as syncplan.flight has it.

With p and V the plan's place and velocity, p^ and psi^ the estimates, w^ that of wind and gust:

    u = V + clip(kp (p - p^)) - w^                        velocity wanted through the air
    v = |u| cos(psi_u - psi^)                             air speed
    w = rate of turn of (V - w^) + k_psi (psi_u - psi^)   turn rate

within the vehicles' limits. A circle moves to its anchor by what some standard deviations of the
distance between them, `lead` s from now, are over the slack of their meeting; and further where the
vehicle has been in no sighting for a period.
"""

import math
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.flight.flight_setup import Contact
from syncplan.orbits.circles import Orbits, cross, dot, perpendicular, phase, position, unit, wrap
from syncplan.orbits.error_states import StateLayout

__all__ = ["TrackingLaw", "moved_circles"]


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

    def commands(self, time: float, poses: Array, wind: Array, moved: Array) -> Array:
        """Return (trials, n, 2) m/s, rad/s from estimates (trials, n, 3) and (trials, n, 2).

        `moved` (trials, n, 2) m is by how much circles are moved.
        """
        orbits = self.orbits
        ahead = perpendicular(unit(phase(orbits, time)))
        velocity = (orbits.senses * orbits.speeds)[:, None] * ahead
        back = self.place_gain * (position(orbits, time) + moved - poses[..., :2])
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


def moved_circles(contact: Contact, layout: StateLayout, P: Array, unseen: Index) -> Array:
    """Return (n, 2) m, by how much circles are moved at a covariance P of the state.

    `unseen` (n,) is the number of steps since each vehicle's last sighting, of it or by it.
    """
    n, moved, anchors = layout.count, np.zeros((layout.count, 2)), contact.anchors
    wind, gusts = (layout.columns.get(name, np.full((n, 2), -1)) for name in ("wind", "gusts"))
    for i in anchors.order.tolist():
        anchor, toward = int(anchors.bodies[i]), anchors.toward[i]
        if anchor < 0:
            continue
        h = np.zeros(len(P))
        for k, sign in ((i, 1.0), (anchor, -1.0)):
            if k < n:
                h[3 * k : 3 * k + 2] = sign * toward
                if gusts[k, 0] >= 0:
                    h[gusts[k]] = sign * contact.gust_lead * toward
        # two vehicles drift alike with the wind, a landmark does not
        if anchor >= n and wind[i, 0] >= 0:
            h[wind[i]] = contact.lead * toward
        missing = contact.sigmas * math.sqrt(max(float(h @ P @ h), 0.0)) - anchors.slacks[i]
        by = min(max(missing, 0.0), anchors.most[i])
        if unseen[i] > contact.patience:
            by = anchors.furthest[i]
        moved[i] = by * toward + (moved[anchor] if anchor < n else 0.0)
    return moved
