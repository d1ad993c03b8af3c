"""Candidate landmark sites as a user gives them: a list or a mapping of names, checked."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, ValidationError
from pydantic_core import PydanticCustomError

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.scenario.loading import parse_values, read_text
from syncplan.scenario.quantities import ListedOrNamed, Point, Section, validation_fault
from syncplan.scenario.rules import check_landmarks, check_names
from syncplan.scenario.specification import Scenario


class CandidateSites(Section):
    """Sites that landmarks could be set at."""

    candidates_m: ListedOrNamed = Field(
        description="Positions [x, y]: a list (S1, S2, ...) or a mapping of names",
        examples=[[[190.0, 0.0], [190.0, 70.0]]],
    )


def load_candidates(path: str | Path) -> dict[str, Point]:
    """Return the candidates of a YAML or JSON file by name, in m; "-" reads standard input.

    The file holds a list of [x, y], a mapping of names, or either under the key `candidates_m`.
    Raises InputError naming the file, the key, its value and what is allowed.
    """
    name, text = read_text(path)
    return named_candidates(parse_values(text, name), source=name)


def named_candidates(values: Any, *, source: str = "") -> dict[str, Point]:
    """Return candidates by name, in m, from a list or array (S, 2) or a mapping of names.

    Those without names are called S1, S2, ... Raises InputError.
    """
    wrapped = isinstance(values, Mapping) and set(values) == {"candidates_m"}
    document = {"candidates_m": _plain(values["candidates_m"] if wrapped else values)}
    try:
        sites = CandidateSites.model_validate(document).candidates_m
    except ValidationError as error:
        validation_fault(error, CandidateSites, source)
    if not sites:
        raise InputError("holds no sites; give at least one", key="candidates_m", source=source)
    if isinstance(sites, dict):
        return dict(sites)
    return {f"S{k + 1}": site for k, site in enumerate(sites)}


def _plain(values: Any) -> Any:
    """Arrays and tuples, by themselves or as values of a mapping, as lists."""
    if isinstance(values, Mapping):
        return {name: _plain(value) for name, value in values.items()}
    if isinstance(values, np.ndarray):
        return values.tolist()
    return list(values) if isinstance(values, tuple) else values


def new_sites(
    scenario: Scenario, candidates: Array | Mapping[str, Point], *, source: str = ""
) -> dict[str, Point]:
    """Return the candidates by name, checked against a scenario's names and landmarks.

    Raises InputError where a name is taken, or two sites, or a site and a landmark, coincide.
    """
    sites = named_candidates(candidates, source=source)
    names = [*scenario.landmark_names, *sites]
    try:
        check_names(scenario.vehicle_names, names)
        check_landmarks(names, [*scenario.landmarks, *sites.values()])
    except PydanticCustomError as error:
        (value,) = (error.context or {}).get("value", (None,))
        shown = "" if value is None else f"{value!r}: "
        raise InputError(f"{shown}{error.message()}", key="candidates_m", source=source) from None
    return sites
