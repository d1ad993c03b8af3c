"""Plan files and other sources of a plan: their orbits, read and judged afresh."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from syncplan.arrays import Array
from syncplan.errors import Fault, InputError
from syncplan.orbits.circles import Orbits, heading, position, wrap
from syncplan.planning.planner import (
    BoundChoice,
    JudgementOptions,
    Pilot,
    judge,
    plan,
    with_flights,
)
from syncplan.planning.plans import Plan
from syncplan.scenario.loading import (
    is_plan,
    parse_document,
    read_text,
    scenario_from,
)
from syncplan.scenario.models import MAX_VEHICLES
from syncplan.scenario.quantities import Angle, Length, Many, Name, Point, validation_fault
from syncplan.scenario.rules import check_shared_circles
from syncplan.scenario.specification import Scenario
from syncplan.scenario.truths import with_truth

if TYPE_CHECKING:
    from syncplan.planning.written_records import WrittenRecord

# --- keys that follow from others -----------------------------------------------------------------


ROUNDING = 1e-4
"""Difference explained by rounding, as a share of a radius, a radian, a speed or a period."""

COORDINATE_ROUNDING = 1e-6
"""Difference explained by rounding, as a share of a coordinate."""


def check_derived(document: Mapping[str, Any], orbits: Orbits, source: str) -> None:
    """Raise InputError naming each derived key of a plan file that contradicts its orbits.

    Keys that are left out contradict nothing.
    """
    vehicles, faults = document["vehicles"], []
    for key, follows_from, values, tolerance in _derived(orbits):
        places = [("", document)] if values.ndim == 0 else _numbered(vehicles)
        for (place, keys), value, least in zip(
            places, np.atleast_1d(values), np.atleast_1d(tolerance), strict=True
        ):
            if key in keys and not _agrees(keys[key], value, least, angle=key == "heading_rad"):
                problem = (
                    f"follows from {follows_from}, which give {_shown(value.tolist())}; change "
                    "those, or leave this key out"
                )
                faults.append(Fault(f"{place}{key}", problem, _shown(keys[key])))
    if faults:
        raise InputError.of(faults, source=source)


def _derived(orbits: Orbits) -> list[tuple[str, str, Array, Array]]:
    """Derived keys with their sources in words, values, and differences explained by rounding.

    Each key has one value for the team, or one for each vehicle.
    """
    far = COORDINATE_ROUNDING * np.abs(orbits.centers).max(axis=1)
    speed = "the angular rate of scenario.orbit"
    return [
        ("period_s", speed, np.array(orbits.period), np.array(ROUNDING * orbits.period)),
        ("speed_mps", f"radius_m and {speed}", orbits.speeds, ROUNDING * orbits.speeds),
        (
            "position_m",
            "center_m, radius_m and phase_rad",
            position(orbits, 0.0),
            ROUNDING * orbits.radii + far,
        ),
        (
            "heading_rad",
            "phase_rad and direction",
            heading(orbits, 0.0) % (2.0 * np.pi),
            np.full(orbits.count, ROUNDING),
        ),
    ]


def _numbered(vehicles: list[Mapping[str, Any]]) -> list[tuple[str, Mapping[str, Any]]]:
    return [(f"vehicles[{k}].", vehicle) for k, vehicle in enumerate(vehicles)]


def _agrees(given: Any, value: Array, tolerance: float, *, angle: bool) -> bool:
    try:
        stated = np.array(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return False
    if stated.shape != value.shape or not np.isfinite(stated).all():
        return False
    off = wrap(stated - value) if angle else stated - value
    return bool(np.max(np.abs(off)) <= tolerance)


def _shown(value: Any) -> str:
    if isinstance(value, list) and value and all(isinstance(one, int | float) for one in value):
        return f"[{', '.join(f'{one:.6g}' for one in value[:3])}{', ...' if value[3:] else ''}]"
    text = f"{value:.6g}" if isinstance(value, float) else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


# --- plan files -----------------------------------------------------------------------------------


class StatedOrbit(BaseModel):
    """Keys that a plan must state for a vehicle; keys that follow from them may be left out."""

    model_config = ConfigDict(extra="ignore", strict=True, allow_inf_nan=False)

    name: Name = Field(description="The vehicle's name in the scenario", examples=["v1"])
    center_m: Point = Field(description="Centre [x, y] of its circle", examples=[[70.0, 0.0]])
    radius_m: Length = Field(description="Radius of its circle", examples=[20.0])
    direction: Literal["ccw", "cw"] = Field(description="Sense of turning")
    phase_rad: Angle = Field(
        description="Angle from +x about the centre at time 0", examples=[3.1416]
    )


class PlanFile(BaseModel):
    """Plan given by its orbits, which are judged as they are.

    Keys that follow from others may be left out, but must not contradict them. Results in the file
    are computed again, not read.
    """

    model_config = ConfigDict(extra="ignore", strict=True)

    scenario: Scenario
    vehicles: Many[StatedOrbit] = Field(
        description="The orbits, one for each vehicle of the scenario, in its order"
    )

    @model_validator(mode="before")
    @classmethod
    def _without_a_separation_that_was_none(cls, document: Any) -> Any:
        """Drop the separation of 0 that plans older than verdicts state if none was given."""
        if not isinstance(document, dict) or "version" not in document or "verdict" in document:
            return document
        scenario = document.get("scenario")
        if not isinstance(scenario, dict) or scenario.get("min_separation_m") != 0:
            return document
        kept = {key: value for key, value in scenario.items() if key != "min_separation_m"}
        return {**document, "scenario": kept}


@dataclass(frozen=True, slots=True)
class Loaded:
    """Content of a scenario file, or of a plan file with its orbits and how they were found."""

    scenario: Scenario
    orbits: Orbits | None
    record: "WrittenRecord | None" = None


def load(path: str | Path, *, max_vehicles: int = MAX_VEHICLES) -> Loaded:
    """Return the content of a scenario or plan file; "-" reads standard input.

    A plan is recognised by its keys `scenario` and `vehicles`. Raises InputError.
    """
    name, text = read_text(path)
    return loaded_from(parse_document(text, name), source=name, max_vehicles=max_vehicles)


def loaded_from(
    document: Mapping[str, Any], *, source: str = "", max_vehicles: int = MAX_VEHICLES
) -> Loaded:
    """Return the content of a scenario or plan document; `source` names it in messages."""
    if not is_plan(document):
        return Loaded(scenario_from(document, source=source, max_vehicles=max_vehicles), None)
    from syncplan.planning.written_records import written_record

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
    margin_bound: bool = True,
    pilot: Pilot = False,
    **options: Unpack[JudgementOptions],
) -> Plan:
    """Return the plan of a scenario, or of the orbits a plan file states, judged afresh.

    The options are those of syncplan.plan; given phases have no bound on their margin. A plan file
    keeps its record of how the orbits were found, and its flights, unless what they describe has
    been changed since; with `pilot`, a plan without flights is flown.
    """
    if loaded.orbits is None:
        return plan(loaded.scenario, margin_bound=margin_bound, pilot=pilot, **options)
    from syncplan.planning.written_records import with_record

    judged = with_record(judge(loaded.scenario, loaded.orbits, **options), loaded.record)
    return with_flights(judged, pilot)


def stated(scenario: Scenario, orbits: Orbits) -> dict[str, Any]:
    """Return a plan's scenario and orbits, the parts read from a plan file, as JSON values."""
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
    """Orbits stated in a plan file, which must be those of the scenario's vehicles."""
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


# --- subjects that functions take as a plan -------------------------------------------------------


PlanSubject = Plan | Scenario | str | Path | Mapping[str, Any]
"""A plan, a scenario to be planned, or a file or mapping that holds either."""


def planned(subject: PlanSubject, *, bound: BoundChoice = "auto") -> Plan:
    """Return the plan of a subject, on paper or with the flights of its file; a plan as it is.

    `bound` is that of syncplan.plan. Raises InputError for a file or mapping that
    holds neither a plan nor a scenario.
    """
    if isinstance(subject, Plan):
        return subject
    return plan_of(loaded_of(subject), bound=bound)


def loaded_of(subject: Scenario | str | Path | Mapping[str, Any]) -> Loaded:
    """Return the content of a scenario, or of a file or mapping that holds one or a plan.

    Raises InputError for anything else.
    """
    if isinstance(subject, Scenario):
        return Loaded(subject, None)
    if isinstance(subject, str | Path):
        return load(subject)
    if isinstance(subject, Mapping):
        return loaded_from(subject)
    raise InputError(
        f"is a {type(subject).__name__}; give a Plan, a Scenario, the path of a file or a mapping",
        key="subject",
    )


def in_world(plan: Plan, truth: Mapping[str, Any] | None) -> Plan:
    """Return a plan whose simulated world has these keys in addition to its scenario's truth.

    Its flights, which were in another world, do not count there: the filter that they chose is that
    of the given plan. Raises InputError naming the key at fault.
    """
    if not truth:
        return plan
    dropped = "they were in another world" if plan.flight is not None else plan.dropped_flights
    elsewhere = with_truth(plan.scenario, truth)
    return replace(plan, scenario=elsewhere, flight=None, dropped_flights=dropped)


def load_plan(
    path: str | Path,
    *,
    bound: BoundChoice = "auto",
    steady: bool = False,
    max_vehicles: int = MAX_VEHICLES,
) -> Plan:
    """Return the plan that `Plan.save` or `syncplan plan -o` wrote; "-" reads standard input.

    Its orbits are taken as they are and judged afresh. `bound` and `steady` are those of
    syncplan.plan. Raises InputError naming the file, the key, its value and what is allowed, and
    for a scenario, which syncplan.load_scenario reads.
    """
    loaded = load(path, max_vehicles=max_vehicles)
    if loaded.orbits is None:
        raise InputError(
            "is a scenario, not a plan; syncplan.plan makes one of it", source=str(path)
        )
    return plan_of(loaded, bound=bound, steady=steady)
