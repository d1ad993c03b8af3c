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

__all__ = ["Done", "MakePlant", "MissingPlantError", "Plant", "needed"]


@dataclass(frozen=True, slots=True)
class Done:
    """What k vehicles did in a sample.

    Attributes
    ----------
    poses : (k, 3) m, m, rad at the sample's end
    speeds, turn_rates : (k,) m/s through the air and rad/s, means over the sample
    """

    poses: Array
    speeds: Array
    turn_rates: Array


class Plant(Protocol):
    """k vehicles."""

    def fly(self, speeds: Array, turn_rates: Array, wind: Array, disturbance: Array) -> Done:
        """Return what they do in the next sample.

        `speeds` (k,) m/s and `turn_rates` (k,) rad/s are commands, `wind` (k, 2) the air's velocity
        in m/s. They fly `disturbance` (k, 2) m/s, rad/s more than they are commanded to, the same
        through the sample.
        """


class MakePlant(Protocol):
    """What makes a plant."""

    def __call__(self, poses: Array, speeds: Array, wind: Array, time: float) -> Plant:
        """Return k vehicles at `poses` (k, 3), through the air at `speeds` (k,), for samples of
        `time` s."""


class MissingPlantError(Exception):
    """Someone else's vehicles are not installed."""


def needed(package: str, error: ImportError) -> MissingPlantError:
    """Return the error to raise where a package of the cross-checks is missing."""
    return MissingPlantError(
        f"{package} is not installed ({error}); the cross-checks need: "
        "pip install --no-deps --requirement tests/crosschecks/requirements.txt"
    )
