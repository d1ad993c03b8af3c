"""What one kind of sighting measures, how well, and how it changes with the two poses.

With errors of the target's place relative to the observer, split into a along and b across the line
of sight at distance rho, what the slopes leave out of a sighting is a product to second order:

    bearing    -(a / rho) (b / rho)
    distance   rho / 2 (b / rho)^2
    compass    nothing
"""

from collections.abc import Callable
from dataclasses import dataclass

from syncplan.arrays import Array
from syncplan.orbits.sensors import Sensors

ALONG, ACROSS = 0, 1
"""Ways of an error, from the line of sight."""


@dataclass(frozen=True, slots=True)
class SecondOrder:
    """What the slopes of a sighting leave out: a product of two errors over the distance.

    Attributes
    ----------
    ways : of the two errors, ALONG or ACROSS the line of sight
    size : of distances (...) m, the product's factor, in the sighting's unit
    """

    ways: tuple[int, int]
    size: Callable[[Array], Array]


@dataclass(frozen=True, slots=True)
class OwnSensor:
    """What measures one kind of sighting and nothing else; a vehicle may be without, or lose it.

    Attributes
    ----------
    words : what it is called
    key : of the scenario, which gives its standard deviation; without it there is none
    """

    words: str
    key: str


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
        vehicle measures it of itself
    every_name : attribute of Sensors that holds from how many samples one is made, (n,)
    second_order : what the slopes leave out; None where nothing
    own_sensor : what measures it; None where every vehicle's sensor does
    """

    sigma_name: str
    unit: str
    measured: Callable[[Array, Array], Array]
    slopes: Callable[[Array, Array], Array]
    by_heading: float
    of_target: bool = True
    every_name: str = "every"
    second_order: SecondOrder | None = None
    own_sensor: OwnSensor | None = None

    def sigmas(self, sensors: Sensors) -> Array:
        """Return (n,) standard deviations by observer; infinite where there is no such sensor."""
        found: Array = getattr(sensors, self.sigma_name)
        return found
