"""Keys of a scenario that hold a number, by dotted name: unit, meaning and limits.

They are read from the scenario's own models, so a key added there appears here too.
"""

import difflib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from math import isclose
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from syncplan.errors import InputError
from syncplan.phrases import name_and_unit

ALTERNATIVES = (
    ("orbit.angular_rate_rad_s", "orbit.speed_mps"),
    ("formation.spacing_m", "formation.gap_m"),
    ("motion.position_random_walk_m_sqrt_s", "motion.speed_sigma_mps"),
    ("motion.angle_random_walk_rad_sqrt_s", "motion.turn_rate_sigma_rad_s"),
)
"""Pairs of keys of which a scenario gives one."""

IN_FLIGHT_ALONE = ("motion.lag_s",)
"""Keys that matter in flight only: in plans and validations, vehicles follow their circles."""

IN_NO_FIGURE = ("refine.", "purpose.", "altitude_m")
"""Beginnings of keys on which no figure of a sweep depends."""

IN_TRUTH = "truth."
"""Prefix of keys of the simulated world."""


@dataclass(frozen=True, slots=True)
class NumericKey:
    """A key of the scenario that holds a number, or one for each vehicle.

    Attributes
    ----------
    key : dotted name, such as sensor.range_sigma_m
    unit : symbol; empty if the number has no unit
    meaning : description in words
    allowed : limits in words
    whole : whether the number is an integer
    """

    key: str
    unit: str
    meaning: str
    allowed: str
    whole: bool

    @property
    def name(self) -> str:
        """Name in figures: the key in words, without its unit."""
        return name_and_unit(self.key)[0].replace(".", " ")


@cache
def all_numeric_keys() -> Mapping[str, NumericKey]:
    """Return all keys that hold a number, in the scenario's order."""
    from syncplan.scenario.specification import Scenario

    schema = Scenario.model_json_schema()
    return MappingProxyType({key.key: key for key in _within(schema, schema["$defs"], "")})


@cache
def numeric_keys() -> Mapping[str, NumericKey]:
    """Return the keys that a sweep may vary: without those IN_NO_FIGURE and IN_FLIGHT_ALONE."""
    return MappingProxyType(
        {
            name: key
            for name, key in all_numeric_keys().items()
            if not name.startswith(IN_NO_FIGURE) and name not in IN_FLIGHT_ALONE
        }
    )


def nearest_keys(name: str) -> list[str]:
    """Return the numeric keys that resemble a wrong name; empty if none does."""
    known = numeric_keys()
    same = [one for one in known if one.rpartition(".")[2] == name.rpartition(".")[2]]
    return same or difflib.get_close_matches(name, known, n=1, cutoff=0.5)


def with_number(document: Mapping[str, Any], key: str, value: float) -> dict[str, Any]:
    """Return the values of a scenario with a number set, without checks.

    A missing section is added; in a list of sections, the number is set in each. The alternative of
    the key is removed, such as a random walk where the sigma of each reading is set.
    """
    number = int(value) if numeric_keys()[key].whole and float(value).is_integer() else value
    own = key.removeprefix(IN_TRUTH)
    others = {other.rpartition(".")[2] for pair in ALTERNATIVES if own in pair for other in pair}
    found: dict[str, Any] = _with(document, key.split("."), number, others)
    return found


def _with(present: Any, path: list[str], number: float, others: set[str]) -> Any:
    """A section, or each section of a list, with the number at a path and without `others`."""
    if isinstance(present, list):
        return [_with(one, path, number, others) for one in present]
    section, (name, *further) = present or {}, path
    if further:
        return {**section, name: _with(section.get(name), further, number, others)}
    return {**{key: one for key, one in section.items() if key not in others}, name: number}


def _within(
    schema: Mapping[str, Any], definitions: Mapping[str, Any], prefix: str
) -> Iterator[NumericKey]:
    for name, field in schema.get("properties", {}).items():
        for one in _alternatives(field, definitions):
            if one.get("type") in ("number", "integer"):
                yield _key_of(prefix + name, field, one)
                break
            if "properties" in one:
                yield from _within(one, definitions, f"{prefix}{name}.")
                break


def _alternatives(
    schema: Mapping[str, Any], definitions: Mapping[str, Any]
) -> Iterator[Mapping[str, Any]]:
    """Alternatives in the schema of a value, with references resolved."""
    if "$ref" in schema:
        yield definitions[schema["$ref"].rpartition("/")[2]]
    for inner in (*schema.get("anyOf", ()), *schema.get("oneOf", ())):
        yield from _alternatives(inner, definitions)
    if "type" in schema:
        yield schema


def _key_of(key: str, field: Mapping[str, Any], number: Mapping[str, Any]) -> NumericKey:
    return NumericKey(
        key=key,
        unit=name_and_unit(key)[1],
        meaning=field.get("description", ""),
        allowed=_allowed(number),
        whole=number["type"] == "integer",
    )


def _allowed(number: Mapping[str, Any]) -> str:
    limits = [
        f"{words} {number[limit]:g}"
        for limit, words in (
            ("minimum", "at least"),
            ("exclusiveMinimum", "more than"),
            ("maximum", "at most"),
            ("exclusiveMaximum", "less than"),
        )
        if limit in number
    ]
    return ", ".join(limits)


# --- keys of a sweep ------------------------------------------------------------------------------
#
# A key is spelt as in the scenario, `sensor.range_m`. Keys of the table have further spellings
# derived from it: the service uses the last part, `range_m`, the library drops its unit, `range`,
# and the command line adds dashes, `--range`.


if TYPE_CHECKING:
    from syncplan.scenario.specification import Scenario


@dataclass(frozen=True, slots=True)
class SweptKey:
    """A key of the scenario that a sweep may vary.

    Attributes
    ----------
    key : dotted name in the scenario, which ends with the unit
    unit : symbol; empty if the number has no unit
    one, many : words for a value and for a list of values
    """

    key: str
    unit: str
    one: str
    many: str

    @property
    def name(self) -> str:
        """Name in the library."""
        return self.key

    @property
    def heading(self) -> str:
        """Heading of the column in tables."""
        return self.key

    def varied(self, scenario: "Scenario", value: float) -> "Scenario":
        """Return the scenario with this key changed, checked again; raises InputError."""
        from syncplan.scenario.loading import scenario_from
        from syncplan.scenario.models import MAX_VEHICLES

        if self.key == "formation.spacing_m" and scenario.formation.shape is None:
            raise InputError(
                "the formation lists its centres; only a shape has a spacing to sweep", key=self.key
            )
        document: dict[str, Any] = scenario.model_dump(exclude_none=True)
        if scenario.window_s is not None and isclose(
            scenario.window_s, scenario.period, rel_tol=1e-5, abs_tol=1e-8
        ):
            # a window of one period remains one period
            document.pop("window_s")
        varied = with_number(document, self.key, value)
        return scenario_from(varied, max_vehicles=max(scenario.size, MAX_VEHICLES))


@dataclass(frozen=True, slots=True)
class SweptOption(SweptKey):
    """A key with its own option on the command line and its own list in requests.

    Attributes
    ----------
    example : a list of values worth sweeping
    """

    example: tuple[float, ...] = ()

    @property
    def request(self) -> str:
        """Name in requests to the service: the last part of the key."""
        return self.key.rpartition(".")[2]

    @property
    def name(self) -> str:
        """Name in the library, without the unit."""
        return self.request.removesuffix("_" + self.unit.replace("/", "_"))

    @property
    def option(self) -> str:
        """Option on the command line."""
        return "--" + self.name.replace("_", "-")

    @property
    def heading(self) -> str:
        """Heading of the column in tables."""
        return self.name.replace("_", " ")


_KEYS = (
    SweptOption(
        "orbit.angular_rate_rad_s",
        "rad/s",
        "angular rate",
        "Common angular rates",
        example=(0.2, 0.4, 0.6),
    ),
    SweptOption("sensor.range_m", "m", "sensor range", "Sensor ranges"),
    SweptOption("orbit.radius_m", "m", "radius", "Radii of all circles"),
    SweptOption("formation.spacing_m", "m", "spacing", "Spacings of the shape"),
)

SWEPT_KEYS: Mapping[str, SweptOption] = MappingProxyType({one.name: one for one in _KEYS})
"""Keys with their own options and requests, by their name in the library."""


_MOST_NEAR = 3


def swept_key(name: str) -> SweptKey:
    """Return a key by any of its spellings; raises InputError if it can't be swept."""
    for one in _KEYS:
        if name in (one.name, one.request, one.key):
            return one

    if name.removeprefix(IN_TRUTH) in IN_FLIGHT_ALONE:
        problem = f"{name!r} can't be swept: it matters in flight alone"
        raise InputError(f"{problem}; change it in the scenario and run 'syncplan fly'", key="name")
    if name.startswith(IN_NO_FIGURE) and name in all_numeric_keys():
        raise InputError(f"{name!r} can't be swept: no figure of a sweep depends on it", key="name")
    found = numeric_keys().get(name)
    if found is None:
        near = " or ".join(nearest_keys(name)[:_MOST_NEAR])
        hint = f"did you mean {near}?" if near else "'syncplan schema' lists all keys"
        raise InputError(f"{name!r} can't be swept: no such key holds a number; {hint}", key="name")
    return SweptKey(found.key, found.unit, found.name, found.meaning)
