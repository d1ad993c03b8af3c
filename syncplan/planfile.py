"""Plan files read back: the orbits they state, judged afresh."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import PydanticCustomError

from syncplan.checks import check_shared_circles
from syncplan.errors import InputError
from syncplan.loading import is_plan, parse_document, read_text, scenario_from, validation_fault
from syncplan.orbits import Orbits
from syncplan.planner import Plan, judge, plan
from syncplan.quantities import Angle, Length, Point
from syncplan.scenario import Scenario
from syncplan.sections import MAX_VEHICLES

__all__ = ["Loaded", "load", "loaded_from", "orbits_from", "plan_of"]


class _Vehicle(BaseModel):
    """What a plan must state of a vehicle; other keys are derived and not read."""

    model_config = ConfigDict(extra="ignore", strict=True, allow_inf_nan=False)

    name: str
    center_m: Point
    radius_m: Length
    direction: Literal["ccw", "cw"]
    phase_rad: Angle


class _PlanFile(BaseModel):
    model_config = ConfigDict(extra="ignore", strict=True)

    vehicles: list[_Vehicle]


@dataclass(frozen=True, slots=True)
class Loaded:
    """A scenario file, or a plan file with the orbits it states."""

    scenario: Scenario
    orbits: Orbits | None


def load(path: str | Path, *, max_vehicles: int = MAX_VEHICLES) -> Loaded:
    """Return what a scenario or plan file holds; "-" reads standard input.

    A plan is known by its keys `scenario` and `vehicles`. Raises InputError.
    """
    name, text = read_text(path)
    return loaded_from(parse_document(text, name), source=name, max_vehicles=max_vehicles)


def loaded_from(
    document: Mapping[str, Any], *, source: str = "", max_vehicles: int = MAX_VEHICLES
) -> Loaded:
    """Return what the document of a scenario or a plan holds; `source` names it in messages."""
    if not is_plan(document):
        return Loaded(scenario_from(document, source=source, max_vehicles=max_vehicles), None)
    inner = document["scenario"]
    if not isinstance(inner, dict):
        raise InputError(
            "must be a mapping: the scenario of the plan", key="scenario", source=source
        )
    within = f"{source}: scenario" if source else "scenario"
    scenario = scenario_from(inner, source=within, max_vehicles=max_vehicles)
    return Loaded(scenario, orbits_from(document, scenario, source=source))


def plan_of(loaded: Loaded) -> Plan:
    """Return the plan of a scenario, or of the orbits a plan file states, judged afresh."""
    if loaded.orbits is None:
        return plan(loaded.scenario)
    return judge(loaded.scenario, loaded.orbits)


def orbits_from(document: Mapping[str, Any], scenario: Scenario, *, source: str = "") -> Orbits:
    """Return the orbits a plan document states for the vehicles of its scenario."""
    try:
        stated = _PlanFile.model_validate(dict(document)).vehicles
    except ValidationError as error:
        validation_fault(error, _PlanFile, source)
    names = [vehicle.name for vehicle in stated]
    if names != scenario.vehicle_names:
        raise InputError(
            f"{names[:6]} are not the vehicles of the plan's scenario, "
            f"{scenario.vehicle_names[:6]}; both must name the same, in the same order",
            key="vehicles",
            source=source,
        )
    _check_circles(stated, source)
    return Orbits(
        centers=np.array([vehicle.center_m for vehicle in stated], dtype=float),
        radii=np.array([vehicle.radius_m for vehicle in stated]),
        senses=np.array([1.0 if vehicle.direction == "ccw" else -1.0 for vehicle in stated]),
        phases=np.array([vehicle.phase_rad for vehicle in stated]),
        rate=scenario.orbit.rate,
    )


def _check_circles(stated: list[_Vehicle], source: str) -> None:
    """Refuse opposite senses on one circle, in a plan as in a scenario."""
    try:
        check_shared_circles(
            [vehicle.direction for vehicle in stated],
            [vehicle.name for vehicle in stated],
            [vehicle.center_m for vehicle in stated],
            [vehicle.radius_m for vehicle in stated],
        )
    except PydanticCustomError as error:
        raise InputError(error.message(), key="vehicles", source=source) from None
