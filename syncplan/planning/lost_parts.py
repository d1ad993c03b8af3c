"""What can be lost, by name: v3, sensor:v3, L1; and the scenario of what is left."""

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any, TypeVar

import numpy as np

from syncplan.arrays import as_pairs
from syncplan.errors import InputError
from syncplan.orbits.losses import BLIND_RANGE_M, Loss, single_losses
from syncplan.orbits.separation import circle_gaps
from syncplan.orbits.team import Team
from syncplan.scenario.specification import Scenario, per_vehicle

__all__ = ["SENSOR", "lost_together", "names_of", "phrase_of", "possible_losses", "scenario_after"]

SENSOR = "sensor:"
"""Stands before the name of the vehicle whose sensor is lost."""

_NAMED = 6

T = TypeVar("T")


def lost_together(names: Iterable[str], scenario: Scenario) -> Loss:
    """Return the loss of all that is named: vehicles, landmarks, and sensors as sensor:v3.

    Raises InputError for a name that nothing has, for one that stands twice and where no vehicle
    would be left.
    """
    given = list(names)
    loss = Loss()
    for name in given:
        if given.count(name) > 1:
            raise InputError(f"{name}: stands twice; name it once", key="lose")
        loss = loss.joined(_one(name, scenario))
    for k in loss.sensors:
        if k in loss.vehicles:
            name = scenario.vehicle_names[k]
            raise InputError(f"{SENSOR}{name}: is lost with {name}; name one of them", key="lose")
    if len(loss.vehicles) == scenario.size:
        raise InputError(f"{', '.join(given)}: leaves no vehicle; name fewer", key="lose")
    return loss


def possible_losses(team: Team, most: int) -> list[Loss]:
    """Return every loss of one, or of up to two, vehicles, sensors and landmarks.

    Left out is what leaves no vehicle, and a vehicle together with its own sensor.
    """
    singles = single_losses(team)
    if most == 1:
        return singles
    pairs = (a.joined(b) for a, b in combinations(singles, 2))
    return singles + [
        loss
        for loss in pairs
        if len(loss.vehicles) < team.count and not set(loss.vehicles) & set(loss.sensors)
    ]


def names_of(loss: Loss, scenario: Scenario) -> tuple[str, ...]:
    """Return what is lost as `lost_together` reads it."""
    vehicles, landmarks = scenario.vehicle_names, scenario.landmark_names
    return (
        *(vehicles[k] for k in loss.vehicles),
        *(f"{SENSOR}{vehicles[k]}" for k in loss.sensors),
        *(landmarks[k] for k in loss.landmarks),
    )


def phrase_of(name: str) -> str:
    """Return one of the names as a sentence has it."""
    return f"the sensor of {name.removeprefix(SENSOR)}" if name.startswith(SENSOR) else name


def scenario_after(scenario: Scenario, loss: Loss) -> Scenario:
    """Return a resolved scenario without what is lost.

    Names stay. Links that ended at what is lost are left out, as are those for which no sensor
    reaches far enough any more. A sensor that is lost has the smallest range there is.
    """
    values = scenario.model_dump(mode="json", exclude_none=True)
    kept = [k for k in range(scenario.size) if k not in loss.vehicles]
    values["orbit"] = _orbit_after(scenario, kept)
    values["sensor"] = _sensors_after(values["sensor"], scenario.size, loss, kept)
    values["formation"] = _formation_after(scenario, values["sensor"], kept)
    values["landmarks_m"] = {
        name: place
        for k, (name, place) in enumerate(
            zip(scenario.landmark_names, scenario.landmarks, strict=True)
        )
        if k not in loss.landmarks
    }
    return Scenario.model_validate(values, context={"max_vehicles": scenario.size})


def _one(name: str, scenario: Scenario) -> Loss:
    vehicles, landmarks = scenario.vehicle_names, scenario.landmark_names
    if name in vehicles:
        return Loss(vehicles=(vehicles.index(name),))
    if name in landmarks:
        return Loss(landmarks=(landmarks.index(name),))
    if name.startswith(SENSOR) and name.removeprefix(SENSOR) in vehicles:
        return Loss(sensors=(vehicles.index(name.removeprefix(SENSOR)),))
    raise InputError(
        f"{name!r}: is neither a vehicle ({_listed(vehicles)}) nor a landmark "
        f"({_listed(landmarks) or 'none'}); a vehicle's sensor is named {SENSOR}{vehicles[0]}",
        key="lose",
    )


def _listed(names: Sequence[str]) -> str:
    rest = f", ... {names[-1]}" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + rest


def _orbit_after(scenario: Scenario, kept: list[int]) -> dict[str, Any]:
    values = scenario.orbit.model_dump(mode="json", exclude_none=True)
    values.pop("speed_mps", None)
    left = {key: _only(value, kept) for key, value in values.items()}
    return {**left, "angular_rate_rad_s": scenario.orbit.rate}


def _sensors_after(sensor: Any, size: int, loss: Loss, kept: list[int]) -> Any:
    if loss.sensors and not isinstance(sensor, list):
        sensor = [sensor] * size
    if not isinstance(sensor, list):
        return sensor
    return [
        {**sensor[k], "range_m": BLIND_RANGE_M} if k in loss.sensors else sensor[k] for k in kept
    ]


def _formation_after(scenario: Scenario, sensor: Any, kept: list[int]) -> dict[str, Any]:
    names, centers = scenario.vehicle_names, scenario.centers
    values: dict[str, Any] = {
        "centers_m": [centers[k] for k in kept],
        "names": [names[k] for k in kept],
    }
    if scenario.formation.links is not None:
        ranges = [one["range_m"] for one in per_vehicle(sensor, len(kept))]
        radii = per_vehicle(scenario.orbit.radius_m, scenario.size)
        number = {k: place for place, k in enumerate(kept)}
        pairs = [(a, b) for a, b in scenario.linked if a in number and b in number]
        circles = np.array(centers), np.array(radii, dtype=float)
        gaps = circle_gaps(*circles, as_pairs(pairs)).tolist()
        values["links"] = [
            [names[a], names[b]]
            for (a, b), gap in zip(pairs, gaps, strict=True)
            if max(ranges[number[a]], ranges[number[b]]) >= gap
        ]
    return values


def _only(value: T, kept: list[int]) -> T | list[Any]:
    return [value[k] for k in kept] if isinstance(value, list) else value
