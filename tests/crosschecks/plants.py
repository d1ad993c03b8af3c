"""What every plant offers: k vehicles that take commands, held for a sample, in moving air.

The k vehicles may be those of many trials, side by side. A pose is x, y in m and heading in rad,
continuous. The heading is the vehicle's yaw: sensors are fixed to the body, so bearings refer to
it. The unicycle of syncplan flies where it heads; how far another vehicle slips sideways is part
of what a cross-check finds. Its air speed is what a pitot tube reads, the velocity through the air
along the heading, and its turn rate the change of yaw in a sample over the sample's length.
"""

from dataclasses import dataclass
from typing import Protocol

from syncplan.arrays import Array


@dataclass(frozen=True, slots=True)
class Done:
    """What k vehicles did in a sample.

    Attributes
    ----------
    poses : (k, 3) m, m, rad at the sample's end
    means : (k, 2) m/s through the air and rad/s, over the sample
    """

    poses: Array
    means: Array


class Plant(Protocol):
    """k vehicles."""

    def fly(self, commands: Array, wind: Array, disturbance: Array) -> Done:
        """Return what they do in the next sample.

        `commands` (k, 2) are m/s, rad/s, `wind` (k, 2) is the air's velocity in m/s. They fly
        `disturbance` (k, 2) more than they are commanded to, the same through the sample.
        """


class MakePlant(Protocol):
    """What makes a plant."""

    def __call__(self, poses: Array, commands: Array, wind: Array, time: float) -> Plant:
        """Return k vehicles at `poses` (k, 3), which have flown `commands` (k, 2) in `wind` (k, 2).

        Their samples last `time` s.
        """
