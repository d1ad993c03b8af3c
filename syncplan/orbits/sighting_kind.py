"""What one kind of sighting measures, how well, and how it changes with the two poses."""

from collections.abc import Callable
from dataclasses import dataclass

from syncplan.arrays import Array
from syncplan.orbits.sensors import Sensors

__all__ = ["SightingKind"]


@dataclass(frozen=True, slots=True)
class SightingKind:
    """What one kind of sighting measures.

    Attributes
    ----------
    sigma_name : attribute of Sensors that holds its standard deviations, (n,) by observer;
        infinite where a vehicle's sensor does not measure this kind
    unit : of the sighting and its standard deviation
    measured : of q (2, ...) m and psi (...) rad, the noiseless sighting; angles are not wrapped
    slopes : of q (2, ...) m and weights (...), each weight times dz / dq, (2, ...); 0 at q = 0
    by_heading : dz / dpsi
    of_target : whether it measures something that must be within range and view; otherwise a
        vehicle measures it of itself, at every sample
    """

    sigma_name: str
    unit: str
    measured: Callable[[Array, Array], Array]
    slopes: Callable[[Array, Array], Array]
    by_heading: float
    of_target: bool = True

    def sigmas(self, sensors: Sensors) -> Array:
        """Return (n,) standard deviations by observer; infinite where there is no such sensor."""
        found: Array = getattr(sensors, self.sigma_name)
        return found
