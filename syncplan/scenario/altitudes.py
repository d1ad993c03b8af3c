"""Altitudes of vehicles: those allowed, and the range that a difference of altitude leaves.

Sensors' ranges count in the plane, as everything does. Across a difference of altitude d, a sensor
that reaches R along the line of sight reaches less far in it:

        o
        | \\
      d |   \\  R
        |     \\
        +-------o
      sqrt(R^2 - d^2)
"""

import math

LOWEST_M, HIGHEST_M = -1000.0, 100_000.0
"""Lowest and highest altitude that scenarios and exports accept."""


def horizontal_reach(reach: float, difference: float) -> float:
    """Return the reach in the plane, in m, across a difference of altitude in m; 0 for none."""
    return math.sqrt(max(reach**2 - difference**2, 0.0))
