"""Every key of a scenario that holds a number, by its dotted name: unit, limits and words.

All of it is read from the scenario's own models, so a key that is added there is here too.
"""

import difflib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

from syncplan.scenario.specification import Scenario

_UNITS = {
    "m_sqrt_s": "m/√s",
    "rad_sqrt_s": "rad/√s",
    "rad_s": "rad/s",
    "mps": "m/s",
    "rad": "rad",
    "deg": "°",
    "m": "m",
    "s": "s",
}
"""Endings of keys, the longer first, and the units that they state."""

ALTERNATIVES = (
    ("orbit.angular_rate_rad_s", "orbit.speed_mps"),
    ("formation.spacing_m", "formation.gap_m"),
    ("motion.position_random_walk_m_sqrt_s", "motion.speed_sigma_mps"),
    ("motion.angle_random_walk_rad_sqrt_s", "motion.turn_rate_sigma_rad_s"),
)
"""Pairs of which a scenario gives one."""

IN_FLIGHT_ALONE = ("motion.lag_s",)
"""Keys of which plans and validations, whose vehicles follow their circles, know nothing."""

IN_TRUTH = "truth."
"""Before keys of the simulated world."""


@dataclass(frozen=True, slots=True)
class NumericKey:
    """A key of the scenario that holds a number, or one for each vehicle.

    Attributes
    ----------
    key : where it stands, such as sensor.range_sigma_m
    unit : in symbols; empty where it has none
    meaning : in words
    allowed : its limits in words
    whole : whether the number is an integer
    """

    key: str
    unit: str
    meaning: str
    allowed: str
    whole: bool

    @property
    def name(self) -> str:
        """What it is called in figures: the key in words, without its unit."""
        ending = _ending(self.key)
        words = self.key.removesuffix(f"_{ending}") if ending else self.key
        return words.replace(".", " ").replace("_", " ")


@cache
def numeric_keys() -> Mapping[str, NumericKey]:
    """Return all keys that hold a number, in the scenario's order.

    Left out are those of `refine`, which say how a plan is improved, not what it is, and those
    IN_FLIGHT_ALONE.
    """
    schema = Scenario.model_json_schema()
    found = {
        one.key: one
        for one in _within(schema, schema["$defs"], "")
        if not one.key.startswith("refine.") and one.key not in IN_FLIGHT_ALONE
    }
    return MappingProxyType(found)


def nearest_keys(name: str) -> list[str]:
    """Return the numeric keys that a wrong name may have meant; empty if it is like none."""
    known = numeric_keys()
    same = [one for one in known if one.rpartition(".")[2] == name.rpartition(".")[2]]
    return same or difflib.get_close_matches(name, known, n=1, cutoff=0.5)


def with_number(document: Mapping[str, Any], key: str, value: float) -> dict[str, Any]:
    """Return the values of a scenario with a number set, nothing checked.

    A section that is missing is added; of a list of sections the number is set in each. What the
    scenario gives instead of the key is left out: a random walk or the sigma of each reading.
    """
    number = int(value) if numeric_keys()[key].whole and float(value).is_integer() else value
    own = key.removeprefix(IN_TRUTH)
    others = {other.rpartition(".")[2] for pair in ALTERNATIVES if own in pair for other in pair}
    found: dict[str, Any] = _with(document, key.split("."), number, others)
    return found


def _with(present: Any, path: list[str], number: float, others: set[str]) -> Any:
    """A section, or each of a list of them, with the number at a path and without `others`."""
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
    """What a value may be, references followed."""
    if "$ref" in schema:
        yield definitions[schema["$ref"].rpartition("/")[2]]
    for inner in (*schema.get("anyOf", ()), *schema.get("oneOf", ())):
        yield from _alternatives(inner, definitions)
    if "type" in schema:
        yield schema


def _key_of(key: str, field: Mapping[str, Any], number: Mapping[str, Any]) -> NumericKey:
    return NumericKey(
        key=key,
        unit=_UNITS.get(_ending(key), ""),
        meaning=field.get("description", ""),
        allowed=_allowed(number),
        whole=number["type"] == "integer",
    )


def _ending(key: str) -> str:
    found = re.search(rf"(?<=_)({'|'.join(_UNITS)})$", key)
    return found[0] if found else ""


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
