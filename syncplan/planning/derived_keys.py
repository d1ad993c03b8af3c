"""Keys of a plan file that follow from others: where they stand, they have to agree with them."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import Fault, InputError
from syncplan.orbits.circles import Orbits, heading, position

ROUNDING = 1e-4
"""Difference that rounding explains, of a radius, a radian, a speed or a period."""

COORDINATE_ROUNDING = 1e-6
"""The same, of a coordinate."""


@dataclass(frozen=True, slots=True)
class DerivedKey:
    """A key of a vehicle that follows from others.

    Attributes
    ----------
    follows_from : the other keys, in words
    values : (n,) or (n, 2) as they follow from the orbits
    apart : difference of two such values
    tolerance : (n,) difference that rounding explains
    """

    follows_from: str
    values: Callable[[Orbits], Array]
    apart: Callable[[Array, Array], float]
    tolerance: Callable[[Orbits], Array]


def _distance(one: Array, other: Array) -> float:
    return float(np.max(np.abs(one - other)))


def _angle(one: Array, other: Array) -> float:
    return abs(float((one - other + np.pi) % (2.0 * np.pi) - np.pi))


VEHICLE_KEYS: Mapping[str, DerivedKey] = MappingProxyType(
    {
        "speed_mps": DerivedKey(
            "radius_m and the angular rate of scenario.orbit",
            lambda orbits: orbits.speeds,
            _distance,
            lambda orbits: ROUNDING * orbits.speeds,
        ),
        "position_m": DerivedKey(
            "center_m, radius_m and phase_rad",
            lambda orbits: position(orbits, 0.0),
            _distance,
            lambda orbits: (
                ROUNDING * orbits.radii + COORDINATE_ROUNDING * np.abs(orbits.centers).max(axis=1)
            ),
        ),
        "heading_rad": DerivedKey(
            "phase_rad and direction",
            lambda orbits: heading(orbits, 0.0) % (2.0 * np.pi),
            _angle,
            lambda orbits: np.full(orbits.count, ROUNDING),
        ),
    }
)
"""The keys of a vehicle that follow from others."""


def check_derived(document: Mapping[str, Any], orbits: Orbits, source: str) -> None:
    """Raise InputError naming each derived key of a plan file that contradicts its orbits.

    Keys that are left out contradict nothing.
    """
    faults = [*_period_fault(document, orbits), *_vehicle_faults(document["vehicles"], orbits)]
    if faults:
        first, more = faults[0], len(faults) - 1
        problem = f"{first.value}: {first.problem}" + (f" (and {more} more)" if more else "")
        raise InputError(problem, key=first.key, source=source, faults=tuple(faults))


def _period_fault(document: Mapping[str, Any], orbits: Orbits) -> Iterator[Fault]:
    if "period_s" in document:
        given, period = document["period_s"], orbits.period
        if not _agrees(given, np.array(period), _distance, ROUNDING * period):
            rate = "the angular rate of scenario.orbit"
            yield Fault("period_s", _contradiction(rate, np.array(period)), _shown(given))


def _vehicle_faults(vehicles: list[Mapping[str, Any]], orbits: Orbits) -> Iterator[Fault]:
    for key, one in VEHICLE_KEYS.items():
        values, tolerance = one.values(orbits), one.tolerance(orbits)
        for k, vehicle in enumerate(vehicles):
            if key not in vehicle:
                continue
            if not _agrees(vehicle[key], values[k], one.apart, float(tolerance[k])):
                problem = _contradiction(one.follows_from, values[k])
                yield Fault(f"vehicles[{k}].{key}", problem, _shown(vehicle[key]))


def _agrees(
    given: Any, value: Array, apart: Callable[[Array, Array], float], tolerance: float
) -> bool:
    try:
        stated = np.array(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return False
    if stated.shape != value.shape or not np.isfinite(stated).all():
        return False
    return apart(stated, value) <= tolerance


def _contradiction(follows_from: str, value: Array) -> str:
    return f"follows from {follows_from}, which give {_shown(value.tolist())}; change those, or \
leave this key out"


def _shown(value: Any) -> str:
    if isinstance(value, list) and value and all(isinstance(one, int | float) for one in value):
        return f"[{', '.join(f'{one:.6g}' for one in value[:3])}{', ...' if value[3:] else ''}]"
    text = f"{value:.6g}" if isinstance(value, float) else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
