"""Noise that the filter assumes: of the motion readings and of the initial pose."""

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
