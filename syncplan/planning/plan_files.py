"""Plan files read back: the orbits they state, judged afresh."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from syncplan.errors import InputError
from syncplan.orbits.circles import Orbits
from syncplan.planning.derived_keys import check_derived
from syncplan.planning.judged_plan import Plan
from syncplan.planning.judgement import BoundChoice, judge
from syncplan.planning.planner import plan
from syncplan.planning.written_records import WrittenRecord, with_record, written_record
from syncplan.scenario.chunked_validation import Many
from syncplan.scenario.faults import validation_fault
from syncplan.scenario.loading import (
    is_plan,
    parse_document,
    read_text,
    scenario_from,
)
from syncplan.scenario.models import MAX_VEHICLES
from syncplan.scenario.quantities import Angle, Length, Name, Point
from syncplan.scenario.rules import check_shared_circles
from syncplan.scenario.specification import Scenario


class StatedOrbit(BaseModel):
    """What a plan must state of a vehicle; keys that follow from these may be left out."""

    model_config = ConfigDict(extra="ignore", strict=True, allow_inf_nan=False)

    name: Name = Field(description="The vehicle's name in the scenario", examples=["v1"])
    center_m: Point = Field(description="Centre [x, y] of its circle", examples=[[70.0, 0.0]])
    radius_m: Length = Field(description="Radius of its circle", examples=[20.0])
    direction: Literal["ccw", "cw"] = Field(description="Sense of turning")
    phase_rad: Angle = Field(
        description="Angle from +x about the centre at time 0", examples=[3.1416]
    )


class PlanFile(BaseModel):
    """A plan given: its orbits are judged as they are.

    Keys that follow from others may be left out, but must not contradict them. What was found of
    the plan is found again, and not read.
    """

    model_config = ConfigDict(extra="ignore", strict=True)

    scenario: Scenario
    vehicles: Many[StatedOrbit] = Field(
        description="The orbits, one for each vehicle of the scenario, in its order"
    )

    @model_validator(mode="before")
    @classmethod
    def _without_a_separation_that_was_none(cls, document: Any) -> Any:
        """Plans written before there were verdicts state 0 where no separation was given."""
        if not isinstance(document, dict) or "version" not in document or "verdict" in document:
            return document
        scenario = document.get("scenario")
        if not isinstance(scenario, dict) or scenario.get("min_separation_m") != 0:
            return document
        kept = {key: value for key, value in scenario.items() if key != "min_separation_m"}
        return {**document, "scenario": kept}


@dataclass(frozen=True, slots=True)
class Loaded:
    """A scenario file, or a plan file with the orbits it states and how it says they were found."""

    scenario: Scenario
    orbits: Orbits | None
    record: WrittenRecord | None = None


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
    try:
        given = PlanFile.model_validate(dict(document), context={"max_vehicles": max_vehicles})
    except ValidationError as error:
        validation_fault(error, PlanFile, source)
    except RecursionError:
        raise InputError("is nested too deeply", source=source) from None
    orbits = _orbits(given, source)
    check_derived(document, orbits, source)
    return Loaded(given.scenario, orbits, written_record(document))


def plan_of(
    loaded: Loaded,
    *,
    bound: BoundChoice = "auto",
    steady: bool = False,
    margin_bound: bool = True,
    pilot: bool = True,
    single_points: bool = True,
) -> Plan:
    """Return the plan of a scenario, or of the orbits a plan file states, judged afresh.

    The options are those of syncplan.plan; given phases have no bound on their margin. A plan file
    keeps its record of how the orbits were found, unless they have been changed since.
    """
    if loaded.orbits is None:
        return plan(
            loaded.scenario,
            bound=bound,
            steady=steady,
            margin_bound=margin_bound,
            pilot=pilot,
            single_points=single_points,
        )
    judged = judge(
        loaded.scenario,
        loaded.orbits,
        bound=bound,
        steady=steady,
        pilot=pilot,
        single_points=single_points,
    )
    return with_record(judged, loaded.record)


def stated(scenario: Scenario, orbits: Orbits) -> dict[str, Any]:
    """Return of a plan, as JSON values, just what is read of a plan file."""
    return {
        "scenario": scenario.model_dump(mode="json", exclude_none=True),
        "vehicles": [
            {
                "name": name,
                "center_m": orbits.centers[k].tolist(),
                "radius_m": float(orbits.radii[k]),
                "direction": "ccw" if orbits.senses[k] > 0 else "cw",
                "phase_rad": float(orbits.phases[k]),
            }
            for k, name in enumerate(scenario.vehicle_names)
        ],
    }


def _orbits(given: PlanFile, source: str) -> Orbits:
    """The orbits stated, which must be those of the scenario's vehicles."""
    vehicles, scenario = given.vehicles, given.scenario
    if not scenario.formation.placed:
        raise InputError(
            "is missing: the scenario of a plan lists the centres",
            key="scenario.formation.centers_m",
            source=source,
        )
    names = [vehicle.name for vehicle in vehicles]
    if names != scenario.vehicle_names:
        raise InputError(
            f"{names[:6]} are not the vehicles of the plan's scenario, "
            f"{scenario.vehicle_names[:6]}; both must name the same, in the same order",
            key="vehicles",
            source=source,
        )
    _check_circles(vehicles, source)
    phases = np.array([vehicle.phase_rad for vehicle in vehicles], dtype=float)
    return Orbits(
        centers=np.array([vehicle.center_m for vehicle in vehicles], dtype=float),
        radii=np.array([vehicle.radius_m for vehicle in vehicles], dtype=float),
        senses=np.array([1.0 if vehicle.direction == "ccw" else -1.0 for vehicle in vehicles]),
        phases=phases % (2.0 * np.pi),
        rate=scenario.orbit.rate,
    )


def _check_circles(vehicles: list[StatedOrbit], source: str) -> None:
    """Refuse opposite senses on one circle, in a plan as in a scenario."""
    try:
        check_shared_circles(
            [vehicle.direction for vehicle in vehicles],
            [vehicle.name for vehicle in vehicles],
            [vehicle.center_m for vehicle in vehicles],
            [vehicle.radius_m for vehicle in vehicles],
        )
    except PydanticCustomError as error:
        raise InputError(error.message(), key="vehicles", source=source) from None
