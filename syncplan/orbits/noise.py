"""Standard deviations of motion readings, of the initial pose and of lasting errors.

Importing it costs nothing, as the options of commands refer to it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations of the motion readings (per sample) and of the initial pose.

    Attributes
    ----------
    speed_sigma : m/s, of each speed reading
    turn_rate_sigma : rad/s, of each turn-rate reading
    position_sigma : m, of each initial coordinate
    heading_sigma : rad, of each initial heading
    """

    speed_sigma: float
    turn_rate_sigma: float
    position_sigma: float
    heading_sigma: float


@dataclass(frozen=True, slots=True)
class ErrorSigmas:
    """Standard deviations of lasting errors; those of bearings are in Sensors.

    Attributes
    ----------
    sigmas : by name and in the unit of syncplan.orbits.error_states.ERROR_STATES, of each component
        of an error; an error that vehicles do not have is absent
    gust_time : s, time over which the correlation of gusts falls to 1/e
    estimated : names of the errors that are states of the filter
    """

    sigmas: Mapping[str, float] = field(default_factory=dict)
    gust_time: float = 10.0
    estimated: tuple[str, ...] = ()

    def of(self, name: str) -> float:
        """Return the standard deviation of an error; 0 where vehicles do not have it."""
        return self.sigmas.get(name, 0.0)


NO_ERRORS = ErrorSigmas()
"""No lasting errors: readings have noise alone."""
