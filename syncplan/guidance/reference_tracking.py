"""Reference of guidance `track` in plain NumPy: a pose-tracking law with saturation.

With the plan's present place p and velocity V over ground, estimates marked ^, e = p - p^:

    u   = V + e kp, at most `closing` m/s of it, - w^        wanted velocity through the air
    v   = |u| cos(turn), not below 0                         turn = direction of u - psi^, wrapped
    w   = k_psi turn + rate at which V - w^ turns

all within limits. In steady wind the circle is kept over ground. Near the plan, errors a along and
c across follow a' = -kp a and c'' + k_psi c' + k_psi kp c = 0, critically damped at k_psi = 4 kp.
Linearised, it is the law of Kanayama with K_x = kp, K_theta = k_psi / v, K_y = k_psi kp / v^2.

Gains are rates, so they scale with the plan's rate alone: kp = 2 rate forgets an error along the
track in a twelfth of a period. Commands that act late, by a sample and the lag of the response,
lower both: turning towards a heading then takes at least twice that delay. The limit to closing
scales with the radius, as the speed does: it is the largest speed less the plan's own, at most the
plan's own.

Source: Kanayama, Kimura, Miyazaki, Noguchi (1990), A stable tracking control method for an
autonomous mobile robot, equation 8.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, short_repr
from syncplan.guidance.flight_setup import FlightLimits
from syncplan.orbits.circles import Orbits, cross, dot, perpendicular, phase, unit, wrap

TRACKING_RATE = 2.0
"""Gain kp as a multiple of the plan's rate, where commands act at once."""

DELAYS_OF_GAIN = 2.0
"""Least time to turn towards a heading, as a multiple of the delay of commands."""

LEAST_CLOSING = 0.25
"""Closing speed, as a share of the plan's, that is kept even where limits leave less."""

STILL = 0.05
"""Share of the plan's speed below which the direction of V - w^ is meaningless."""


@dataclass(frozen=True, slots=True, repr=False)
class TrackingGains:
    """Gains of the law.

    Attributes
    ----------
    place : 1/s, kp
    heading : 1/s, k_psi
    closing_speeds : (n,) m/s, largest speed at which a vehicle closes in on its place
    """

    place: float
    heading: float
    closing_speeds: Array

    __repr__ = short_repr


def tracking_gains(orbits: Orbits, limits: FlightLimits, delay: float = 0.0) -> TrackingGains:
    """Return the gains that follow from the plan's rate and speeds; commands act `delay` s late."""
    heading = 4.0 * TRACKING_RATE * orbits.rate
    if delay > 0.0:
        heading = min(heading, 1.0 / (DELAYS_OF_GAIN * delay))
    left = np.maximum(limits.most_speeds - orbits.speeds, LEAST_CLOSING * orbits.speeds)
    return TrackingGains(0.25 * heading, heading, np.minimum(left, orbits.speeds))


def tracking_commands(
    orbits: Orbits,
    limits: FlightLimits,
    gains: TrackingGains,
    time: float,
    poses: Array,
    winds: Array,
) -> Array:
    """Return commands (n, 2), speed through the air in m/s and turn rate in rad/s, at `time` s.

    `poses` (n, 3) m, m, rad and `winds` (n, 2) m/s are estimates.
    """
    outward, turning = unit(phase(orbits, time)), orbits.senses * orbits.rate
    ahead = (turning * orbits.radii)[:, None] * perpendicular(outward)
    bent = -(orbits.rate**2 * orbits.radii)[:, None] * outward
    near = gains.place * (orbits.centers + orbits.radii[:, None] * outward - poses[:, :2])
    near *= np.minimum(1.0, gains.closing_speeds / np.maximum(np.hypot(*near.T), 1e-12))[:, None]
    free = ahead - winds
    wanted = free + near
    turn = wrap(np.arctan2(wanted[:, 1], wanted[:, 0]) - poses[:, 2])
    still = dot(free, free) <= (STILL * orbits.speeds) ** 2
    feed = np.where(still, turning, cross(free, bent) / np.where(still, 1.0, dot(free, free)))
    speeds = np.hypot(*wanted.T) * np.maximum(np.cos(turn), 0.0)
    turn_rates = feed + gains.heading * turn
    return np.stack(
        [
            np.clip(speeds, limits.least_speeds, limits.most_speeds),
            np.clip(turn_rates, -limits.most_turn_rates, limits.most_turn_rates),
        ],
        axis=-1,
    )
