"""What an export may be asked for: how long and how high, and for which autopilot."""

from dataclasses import dataclass
from math import isfinite
from typing import get_args

from syncplan.errors import InputError
from syncplan.exporting.autopilots import AutopilotName, VehicleName

HIGHEST_M = 100_000.0
LONGEST_S = 1e7
MOST_TURNS = 20_000
"""Longest flown, in turns: as long as a scenario's run may be."""


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """What an export may be asked for; None stands for the default that the text names.

    Attributes
    ----------
    altitude_m : height flown above the origin, m; None: the format's, see
        syncplan.exporting.format_table.FORMATS
    altitude_step_m : each vehicle flies this much higher than the last, m
    duration : time flown, s; None: the scenario's duration_s
    turns : whole turns flown, instead of `duration`
    sample_time_s : time between poses, s; None: the scenario's sample time
    autopilot : that a mission is for; PX4 takes no loiter turns and gets waypoints
    vehicle : multicopter (ground speed) or fixed_wing (airspeed)
    waypoints : fly a polygon of waypoints where loiter turns would do
    sagitta_m : most that the arc is to stand off from the chord between waypoints, m
    snap_radius : fly the nearest radii that ArduPilot can store, at the same rate
    force : export a plan although its verdict stops it

    Raises InputError, with the name of the attribute, for a value out of range.
    """

    altitude_m: float | None = None
    altitude_step_m: float = 0.0
    duration: float | None = None
    turns: int | None = None
    sample_time_s: float | None = None
    autopilot: AutopilotName = "ardupilot"
    vehicle: VehicleName = "multicopter"
    waypoints: bool = False
    sagitta_m: float = 0.5
    snap_radius: bool = False
    force: bool = False

    def __post_init__(self) -> None:
        _check_range("altitude_m", self.altitude_m, -1000.0, HIGHEST_M)
        _check_range("altitude_step_m", self.altitude_step_m, 0.0, 1000.0)
        _check_range("duration", self.duration, 1e-3, LONGEST_S)
        _check_range("turns", self.turns, 1, MOST_TURNS)
        _check_range("sample_time_s", self.sample_time_s, 1e-4, LONGEST_S)
        _check_range("sagitta_m", self.sagitta_m, 1e-3, 1000.0)
        if self.duration is not None and self.turns is not None:
            raise InputError("goes without a duration; give one of the two", key="turns")
        _check_choice("autopilot", self.autopilot, get_args(AutopilotName))
        _check_choice("vehicle", self.vehicle, get_args(VehicleName))


def _check_range(key: str, value: float | None, least: float, most: float) -> None:
    if value is not None and not (isfinite(value) and least <= value <= most):
        raise InputError(f"{value:g}: must be from {least:g} to {most:g}", key=key)


def _check_choice(key: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise InputError(f"{value!r}: must be {' or '.join(known)}", key=key)
