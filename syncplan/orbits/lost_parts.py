"""Names of parts that can be lost (v3, sensor:v3, compass:v3, L1); the scenario after a loss."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any, TypeVar

import numpy as np

from syncplan.arrays import as_pairs
from syncplan.errors import InputError
from syncplan.orbits.contacts import circle_gaps
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS, SightingKind
from syncplan.orbits.sightings import BLIND_RANGE_M, Loss, single_losses
from syncplan.orbits.team import Team, sensors_of
from syncplan.scenario.disturbances import EstimableName
from syncplan.scenario.specification import Scenario, per_vehicle

SENSOR = "sensor:"
"""Prefix to the name of a vehicle whose sensor is lost."""

_KINDS = list(SIGHTING_KINDS.values())

_OF_KIND = {
    f"{name}:": place
    for place, (name, kind) in enumerate(SIGHTING_KINDS.items())
    if kind.own_sensor is not None
}
"""Prefix where the sensor of a single kind of sighting is lost, and that kind's index."""

_WORDS = {
    SENSOR: "sensor",
    **{
        before: own.words for before, place in _OF_KIND.items() if (own := _KINDS[place].own_sensor)
    },
}

_NAMED = 6

T = TypeVar("T")


def lost_together(names: Iterable[str], scenario: Scenario) -> Loss:
    """Return the loss of all named parts: vehicles, landmarks, and sensors as sensor:v3.

    Sensors of one kind of sighting are named compass:v3 and distance:v3. Raises InputError for an
    unknown name, for a repeated one, and if no vehicle would be left.
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
    for place, k in loss.repeats:
        vehicle = scenario.vehicle_names[k]
        with_it = vehicle if k in loss.vehicles else f"{SENSOR}{vehicle}"
        name = _name_of_kind(place, vehicle)
        raise InputError(f"{name}: is lost with {with_it}; name one of them", key="lose")
    if len(loss.vehicles) == scenario.size:
        raise InputError(f"{', '.join(given)}: leaves no vehicle; name fewer", key="lose")
    return loss


def possible_losses(team: Team, most: int) -> list[Loss]:
    """Return every loss of one, or of up to two, vehicles, sensors and landmarks.

    Losses that leave no vehicle, or take a vehicle or sensor with a part of it, are left out.
    """
    singles = single_losses(team)
    if most == 1:
        return singles
    pairs = (a.joined(b) for a, b in combinations(singles, 2))
    return singles + [
        loss
        for loss in pairs
        if len(loss.vehicles) < team.count
        and not set(loss.vehicles) & set(loss.sensors)
        and not loss.repeats
    ]


def names_of(loss: Loss, scenario: Scenario) -> tuple[str, ...]:
    """Return the names of the lost parts as `lost_together` reads them."""
    vehicles, landmarks = scenario.vehicle_names, scenario.landmark_names
    return (
        *(vehicles[k] for k in loss.vehicles),
        *(f"{SENSOR}{vehicles[k]}" for k in loss.sensors),
        *(_name_of_kind(place, vehicles[k]) for place, k in loss.kinds),
        *(landmarks[k] for k in loss.landmarks),
    )


def phrase_of(name: str) -> str:
    """Return the phrase for one of the names in a sentence."""
    before, colon, vehicle = name.partition(":")
    words = _WORDS.get(before + colon)
    return f"the {words} of {vehicle}" if words else name


def _name_of_kind(place: int, vehicle: str) -> str:
    return next(f"{before}{vehicle}" for before, kind in _OF_KIND.items() if kind == place)


def scenario_after(scenario: Scenario, loss: Loss) -> Scenario:
    """Return a resolved scenario without the lost parts.

    Names stay. Links to a lost vehicle are left out, as are those for which no remaining sensor
    reaches far enough. A lost sensor gets the smallest range there is; one of a single kind of
    sighting, no sigma. An error that no remaining vehicle has is no longer a state. The purpose is
    no longer asked for: a loss is judged by what the rest can localise.
    """
    values = scenario.model_dump(mode="json", exclude_none=True, exclude={"purpose"})
    kept = [k for k in range(scenario.size) if k not in loss.vehicles]
    for place, k in loss.kinds:
        values |= _without_sensor(values, _KINDS[place], k, scenario.size)
    listed = values.keys() & {"heading_sigma_rad", "altitude_m"}
    values |= {key: _only(values[key], kept) for key in listed}
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
    wanted = scenario.filter.estimate if scenario.filter else "auto"
    if isinstance(wanted, list):
        left = [name for name in wanted if name in _errors_after(scenario, kept)]
        values["filter"] = {"estimate": left}
    return Scenario.model_validate(values, context={"max_vehicles": scenario.size})


def _errors_after(scenario: Scenario, kept: list[int]) -> Mapping[EstimableName, float]:
    """Sigmas, by name, of the errors that the vehicles kept have."""
    sensors = [scenario.sensors[k] for k in kept]
    return scenario.following(sensor=sensors).error_sigmas


def _without_sensor(
    values: Mapping[str, Any], kind: SightingKind, vehicle: int, count: int
) -> dict[str, Any]:
    """Scenario values that change when a vehicle loses its sensor of one kind."""
    section, _, key = kind.own_sensor.key.rpartition(".") if kind.own_sensor else ("", "", "")
    each = per_vehicle(values[section or key], count)
    if not section:
        return {key: [None if k == vehicle else one for k, one in enumerate(each)]}
    without = {name: value for name, value in each[vehicle].items() if name != key}
    return {section: [without if k == vehicle else one for k, one in enumerate(each)]}


def _one(name: str, scenario: Scenario) -> Loss:
    vehicles, landmarks = scenario.vehicle_names, scenario.landmark_names
    if name in vehicles:
        return Loss(vehicles=(vehicles.index(name),))
    if name in landmarks:
        return Loss(landmarks=(landmarks.index(name),))
    if name.startswith(SENSOR) and name.removeprefix(SENSOR) in vehicles:
        return Loss(sensors=(vehicles.index(name.removeprefix(SENSOR)),))
    before, colon, vehicle = name.partition(":")
    if before + colon in _OF_KIND and vehicle in vehicles:
        return _loss_of_kind(_OF_KIND[before + colon], vehicles.index(vehicle), scenario)
    raise InputError(
        f"{name!r}: is neither a vehicle ({_listed(vehicles)}) nor a landmark "
        f"({_listed(landmarks) or 'none'}); a vehicle's sensor is named {SENSOR}{vehicles[0]}",
        key="lose",
    )


def _loss_of_kind(place: int, vehicle: int, scenario: Scenario) -> Loss:
    own = _KINDS[place].own_sensor
    if own is not None and np.isinf(_KINDS[place].sigmas(sensors_of(scenario))[vehicle]):
        raise InputError(
            f"{scenario.vehicle_names[vehicle]}: has no {own.words} to lose; {own.key} gives one",
            key="lose",
        )
    return Loss(kinds=((place, vehicle),))


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
