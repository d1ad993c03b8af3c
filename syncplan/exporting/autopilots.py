"""Autopilots and kinds of vehicles that missions are written for."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

AutopilotName = Literal["ardupilot", "px4"]
VehicleName = Literal["multicopter", "fixed_wing"]


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A kind of vehicle.

    Attributes
    ----------
    code : its MAV_TYPE
    holds_airspeed : whether its autopilot holds airspeed rather than ground speed
    """

    code: int
    holds_airspeed: bool


@dataclass(frozen=True, slots=True)
class Autopilot:
    """An autopilot.

    Attributes
    ----------
    code : its MAV_AUTOPILOT
    titles : what it is called on each kind of vehicle
    loiter_turns : whether its missions may hold loiter turns
    whole_metres : whether it stores acceptance radii in whole metres
    yaw : of a waypoint that the vehicle is to pass nose first; None where it must be left out
    """

    code: int
    titles: Mapping[VehicleName, str]
    loiter_turns: bool
    whole_metres: bool
    yaw: float | None


VEHICLES: Mapping[VehicleName, Vehicle] = MappingProxyType(
    {"multicopter": Vehicle(2, False), "fixed_wing": Vehicle(1, True)}
)
"""All kinds of vehicles by name."""

AUTOPILOTS: Mapping[AutopilotName, Autopilot] = MappingProxyType(
    {
        "ardupilot": Autopilot(
            code=3,
            titles={"multicopter": "ArduPilot Copter", "fixed_wing": "ArduPilot Plane"},
            loiter_turns=True,
            whole_metres=True,
            yaw=0.0,
        ),
        "px4": Autopilot(
            code=12,
            titles={"multicopter": "PX4 multicopter", "fixed_wing": "PX4 fixed wing"},
            loiter_turns=False,
            whole_metres=False,
            yaw=None,
        ),
    }
)
"""All autopilots by name."""
