"""The keys that a sweep may vary: every number of a scenario, and the table of those with options.

A key is spelt as in the scenario, `sensor.range_m`. Those of the table have further spellings,
which follow from it: the service's `range_m` is its last part, the library's `range` that without
its unit, and the command line's `--range` that with dashes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isclose
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from syncplan.errors import InputError

if TYPE_CHECKING:
    from syncplan.scenario.specification import Scenario


@dataclass(frozen=True, slots=True)
class SweptKey:
    """A key of the scenario that a sweep may vary.

    Attributes
    ----------
    key : where it stands in the scenario; its name ends with its unit
    unit : in symbols; empty where it has none
    one, many : a value and a list of values in words
    change : sets it in the values of a scenario, given that scenario
    """

    key: str
    unit: str
    one: str
    many: str
    change: Callable[[dict[str, Any], "Scenario", float], None]

    @property
    def name(self) -> str:
        """Its name in the library."""
        return self.key

    @property
    def heading(self) -> str:
        """What it is called above a column."""
        return self.key

    def varied(self, scenario: "Scenario", value: float) -> "Scenario":
        """Return the scenario with this key changed, checked anew; raises InputError."""
        from syncplan.scenario.loading import scenario_from
        from syncplan.scenario.models import MAX_VEHICLES

        document: dict[str, Any] = scenario.model_dump(exclude_none=True)
        self.change(document, scenario, value)
        return scenario_from(document, max_vehicles=max(scenario.size, MAX_VEHICLES))


@dataclass(frozen=True, slots=True)
class SweptOption(SweptKey):
    """A key with an option on the command line and a list of its own in requests.

    Attributes
    ----------
    example : a list of values worth sweeping
    """

    example: tuple[float, ...] = ()

    @property
    def request(self) -> str:
        """Its name in requests to the service: the last part of the key."""
        return self.key.rpartition(".")[2]

    @property
    def name(self) -> str:
        """Its name in the library: without the unit."""
        return self.request.removesuffix("_" + self.unit.replace("/", "_"))

    @property
    def option(self) -> str:
        """Its option on the command line."""
        return "--" + self.name.replace("_", "-")

    @property
    def heading(self) -> str:
        """What it is called above a column."""
        return self.name.replace("_", " ")


def _change_rate(document: dict[str, Any], scenario: "Scenario", value: float) -> None:
    """A speed gives way, and so does a window of one period."""
    document["orbit"].pop("speed_mps", None)
    document["orbit"]["angular_rate_rad_s"] = value
    _leave_out_usual_window(document, scenario)


def _leave_out_usual_window(document: dict[str, Any], scenario: "Scenario") -> None:
    window = scenario.window_s
    if window is not None and isclose(window, scenario.period, rel_tol=1e-5, abs_tol=1e-8):
        document.pop("window_s")


def _change_range(document: dict[str, Any], scenario: "Scenario", value: float) -> None:
    sensors = document["sensor"]
    for sensor in sensors if isinstance(sensors, list) else [sensors]:
        sensor["range_m"] = value


def _change_radius(document: dict[str, Any], scenario: "Scenario", value: float) -> None:
    document["orbit"]["radius_m"] = value


def _change_spacing(document: dict[str, Any], scenario: "Scenario", value: float) -> None:
    if scenario.formation.shape is None:
        raise InputError(
            "the formation lists its centres; only a shape has a spacing to sweep",
            key="formation.spacing_m",
        )
    document["formation"]["spacing_m"] = value


_KEYS = (
    SweptOption(
        "orbit.angular_rate_rad_s",
        "rad/s",
        "angular rate",
        "Common angular rates",
        _change_rate,
        example=(0.2, 0.4, 0.6),
    ),
    SweptOption("sensor.range_m", "m", "sensor range", "Sensor ranges", _change_range),
    SweptOption("orbit.radius_m", "m", "radius", "Radii of all circles", _change_radius),
    SweptOption("formation.spacing_m", "m", "spacing", "Spacings of the shape", _change_spacing),
)

SWEPT_KEYS: Mapping[str, SweptOption] = MappingProxyType({one.name: one for one in _KEYS})
"""Those with options and requests of their own, by the library's name."""


_MOST_NEAR = 3


def swept_key(name: str) -> SweptKey:
    """Return a key by any of its spellings; raises InputError for what can't be swept."""
    for one in _KEYS:
        if name in (one.name, one.request, one.key):
            return one
    from syncplan.scenario.dotted_keys import (
        IN_FLIGHT_ALONE,
        IN_TRUTH,
        nearest_keys,
        numeric_keys,
    )

    if name.removeprefix(IN_TRUTH) in IN_FLIGHT_ALONE:
        problem = f"{name!r} can't be swept: it matters in flight alone"
        raise InputError(f"{problem}; change it in the scenario and run 'syncplan fly'", key="name")
    found = numeric_keys().get(name)
    if found is None:
        near = " or ".join(nearest_keys(name)[:_MOST_NEAR])
        hint = f"did you mean {near}?" if near else "'syncplan schema' lists all keys"
        raise InputError(f"{name!r} can't be swept: no such key holds a number; {hint}", key="name")
    return SweptKey(found.key, found.unit, found.name, found.meaning, _change_of(found.key))


def _change_of(key: str) -> Callable[[dict[str, Any], "Scenario", float], None]:
    def change(document: dict[str, Any], scenario: "Scenario", value: float) -> None:
        from syncplan.scenario.dotted_keys import with_number

        if key != "window_s":
            _leave_out_usual_window(document, scenario)
        document.update(with_number(document, key, value))

    return change
