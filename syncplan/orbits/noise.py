"""Noise that the filter assumes, of motion readings and the initial pose, and errors that last.

Costs nothing to import: the options of commands refer to it.
"""

from dataclasses import dataclass


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
    """Standard deviations of the errors that last; those of bearings stand in Sensors.

    Attributes
    ----------
    wind : m/s, of each component of the common, constant wind
    gust : m/s, of each component of a vehicle's gusts
    gust_time : s, over which their correlation falls to 1/e
    speed_scale : of the share by which speed readings are wrong
    turn_rate_bias : rad/s
    clock_offset : s, of a vehicle's stamps
    estimated : names in syncplan.orbits.error_states.ERROR_STATES that are states of the filter
    """

    wind: float = 0.0
    gust: float = 0.0
    gust_time: float = 10.0
    speed_scale: float = 0.0
    turn_rate_bias: float = 0.0
    clock_offset: float = 0.0
    estimated: tuple[str, ...] = ()


NO_ERRORS = ErrorSigmas()
"""Of vehicles whose readings have noise alone."""
