"""Choice of the k candidate sites that minimise the window bound of the worst vehicle.

relax     shares and a bound that no choice can beat         syncplan.landmarks.site_search
search    round the shares, swap sites, prove if possible    syncplan.landmarks.site_search
judge     the chosen sites by the exact code that judges every plan
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, ValidationError
from pydantic_core import PydanticCustomError

from syncplan.arrays import Array, Index
from syncplan.errors import InputError, NoSolutionError
from syncplan.landmarks.site_information import candidate_information, evaluate
from syncplan.landmarks.site_search import best_sites, relax
from syncplan.planning.plan_files import PlanSubject, planned
from syncplan.planning.planner import BoundChoice, Pilot, judge, with_flights
from syncplan.planning.plans import Plan
from syncplan.results.result import Result
from syncplan.runtime.machine import single_threaded_blas
from syncplan.scenario.lat_lon_keys import PlacedSection
from syncplan.scenario.loading import parse_values, read_text, scenario_from
from syncplan.scenario.models import GeoOrigin
from syncplan.scenario.quantities import (
    ListedOrNamed,
    ListedOrNamedPlaces,
    Point,
    instead_of,
    validation_fault,
)
from syncplan.scenario.rules import check_landmarks, check_names
from syncplan.scenario.specification import Scenario

METRES, DEGREES = KEYS = "candidates_m", "candidates_lat_lon_deg"
"""Keys of candidates."""


class CandidateSites(PlacedSection):
    """Candidate sites for landmarks."""

    candidates_m: ListedOrNamed = Field(
        description="Positions [x, y]: a list (S1, S2, ...) or a mapping of names",
        examples=[[[190.0, 0.0], [190.0, 70.0]]],
    )
    candidates_lat_lon_deg: ListedOrNamedPlaces | None = instead_of("candidates_m")
    geo_origin: GeoOrigin | None = Field(default=None, description="That of the scenario")


def load_candidates(path: str | Path, origin: GeoOrigin | None = None) -> dict[str, Point]:
    """Return the candidates of a YAML or JSON file by name, in m; "-" reads standard input.

    The file holds a list of [x, y], a mapping of names, or either under the key `candidates_m`; or
    latitudes and longitudes under `candidates_lat_lon_deg`, which need the scenario's `origin`.
    Raises InputError naming the file, the key, its value and what is allowed.
    """
    name, text = read_text(path)
    return named_candidates(parse_values(text, name), origin, source=name)


def named_candidates(
    values: Any, origin: GeoOrigin | None = None, *, source: str = ""
) -> dict[str, Point]:
    """Return candidates by name, in m, from a list or array (S, 2) or a mapping of names.

    Sites without names are called S1, S2, ... Raises InputError.
    """
    keyed = isinstance(values, Mapping) and 0 < len(values) == len({*values} & {*KEYS})
    given = dict(values) if keyed else {METRES: values}
    if origin is None and DEGREES in given:
        raise InputError(
            "is missing in the scenario, and the sites are in degrees", key="geo_origin"
        )
    document = {key: _plain(sites) for key, sites in given.items()} | {"geo_origin": origin}
    try:
        sites = CandidateSites.model_validate(document).candidates_m
    except ValidationError as error:
        validation_fault(error, CandidateSites, source)
    if not sites:
        raise InputError("holds no sites; give at least one", key=METRES, source=source)
    if isinstance(sites, dict):
        return dict(sites)
    return {f"S{k + 1}": site for k, site in enumerate(sites)}


def _plain(values: Any) -> Any:
    """Convert arrays and tuples to lists, also as values of a mapping."""
    if isinstance(values, Mapping):
        return {name: _plain(value) for name, value in values.items()}
    if isinstance(values, np.ndarray):
        return values.tolist()
    return list(values) if isinstance(values, tuple) else values


def new_sites(scenario: Scenario, candidates: Any, *, source: str = "") -> dict[str, Point]:
    """Return the candidates by name, checked against a scenario's names and landmarks.

    Raises InputError where a name is taken, or two sites, or a site and a landmark, coincide.
    """
    sites = named_candidates(candidates, scenario.geo_origin, source=source)
    names = [*scenario.landmark_names, *sites]
    try:
        check_names(scenario.vehicle_names, names)
        check_landmarks(names, [*scenario.landmarks, *sites.values()])
    except PydanticCustomError as error:
        (value,) = (error.context or {}).get("value", (None,))
        shown = "" if value is None else f"{value!r}: "
        raise InputError(f"{shown}{error.message()}", key=METRES, source=source) from None
    return sites


# --- the choice ---------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, repr=False)
class SiteChoice(Result):
    """Chosen sites, their window bound, and a lower bound for every choice.

    Attributes
    ----------
    chosen : indices into the candidates, ascending
    value : m, window bound of the worst vehicle with the chosen sites, by the exact code
    bound : m, lower bound on the value of any choice of as many sites; from the convex relaxation
    gap : value / bound - 1
    proven : whether every other choice was tried or ruled out: none is better
    shares : (S,) of the relaxation, in [0, 1]
    seen_by : (S,) number of vehicles that see each candidate
    names, candidates : of all S candidates; (S, 2) m
    before : (n,) m, window bound of each vehicle without the sites; NaN where not determined
    plan : judged with the scenario's landmarks and the chosen sites
    """

    chosen: tuple[int, ...]
    value: float
    bound: float
    gap: float
    proven: bool
    shares: Array
    seen_by: Index
    names: tuple[str, ...]
    candidates: Array
    before: Array
    plan: Plan

    def __repr__(self) -> str:
        """Return one line: the sites, their value and the lower bound."""
        sites = ", ".join(self.names[k] for k in self.chosen[:8])
        more = f" and {len(self.chosen) - 8} more" if len(self.chosen) > 8 else ""
        return (
            f"<{type(self).__name__} {sites}{more} of {len(self.names)} candidates: worst vehicle "
            f"{self.value:.4g} m, no choice below {self.bound:.4g} m"
            f"{', proven best' if self.proven else ''}>"
        )


@single_threaded_blas
def choose_landmarks(
    subject: PlanSubject,
    candidates: Array | Mapping[str, Point] | Sequence[str],
    choose: int,
    *,
    seed: int = 0,
    exhaustive: bool = True,
    bound: BoundChoice = "auto",
    pilot: Pilot = True,
) -> SiteChoice:
    """Return the `choose` candidates (S, 2) m that minimise the worst vehicle's window bound.

    Candidates given by name are landmarks of the subject; those not chosen are left out. Phases do
    not depend on landmarks: a plan keeps its own. `exhaustive` allows a proof that tries all
    choices not ruled out, where they are few. `bound` says whether to compute the posterior bound,
    and `pilot` whether to fly the chosen plan, see syncplan.plan. Raises InputError for unusable
    candidates, NoSolutionError where no choice found determines every vehicle.
    """
    before, sites = _without_candidates(planned(subject, bound="never"), candidates)
    if not 1 <= choose <= len(sites):
        raise InputError(
            f"{choose}: must be from 1 to the number of candidates, {len(sites)}", key="choose"
        )
    if seed < 0:
        raise InputError(f"{seed}: must not be negative", key="seed")
    places = np.array(list(sites.values()), dtype=float)
    information = candidate_information(before, places)
    whole = evaluate(information, np.ones(len(sites)))
    if not whole.least > 0.0:
        everything = _judged(before, sites, "never")
        raise NoSolutionError(_lacking(everything, f"even all {len(sites)} candidates leave"))
    relaxation = relax(information, choose)
    generator = np.random.default_rng(seed)
    found, proven = best_sites(information, relaxation, choose, generator, exhaustive=exhaustive)
    chosen = tuple(found.tolist())
    names = list(sites)
    made = _judged(before, {names[k]: sites[names[k]] for k in chosen}, bound)
    value = float(np.max(made.prediction.window))
    if not np.isfinite(value):
        which = "any" if proven else "the best found"
        raise NoSolutionError(_lacking(made, f"{which} {choose} of {len(sites)} candidates leave"))
    floor = min(information.scale / float(np.sqrt(relaxation.ceiling)), value)
    return SiteChoice(
        chosen=chosen,
        value=value,
        bound=floor,
        gap=value / floor - 1.0,
        proven=proven,
        shares=relaxation.shares,
        seen_by=information.seen_by,
        names=tuple(sites),
        candidates=places,
        before=before.prediction.window,
        plan=with_flights(made, pilot),
    )


# --- judgement --------------------------------------------------------------------------------


def _without_candidates(
    plan: Plan, candidates: Array | Mapping[str, Point] | Sequence[str]
) -> tuple[Plan, dict[str, Point]]:
    """Plan without the candidates, which names take from its landmarks, and the candidates."""
    if not isinstance(candidates, Sequence) or not all(isinstance(one, str) for one in candidates):
        return plan, new_sites(plan.scenario, candidates)
    given = _landmarks(plan)
    for name in candidates:
        if name not in given:
            known = ", ".join(given) or "none"
            raise InputError(
                f"{name!r}: there is no such landmark; landmarks are {known}", key="candidates"
            )
    sites = {name: given.pop(name) for name in dict.fromkeys(candidates)}
    return _with_landmarks(plan, given, "never"), sites


def _landmarks(plan: Plan) -> dict[str, Point]:
    return dict(zip(plan.scenario.landmark_names, plan.scenario.landmarks, strict=True))


def _judged(before: Plan, sites: Mapping[str, Point], bound: BoundChoice) -> Plan:
    """Plan with the sites as further landmarks, on the same orbits."""
    return _with_landmarks(before, {**_landmarks(before), **sites}, bound)


def _with_landmarks(before: Plan, landmarks: Mapping[str, Point], bound: BoundChoice) -> Plan:
    """Plan with these landmarks, on the same orbits."""
    document = before.scenario.model_dump(mode="json", exclude_none=True)
    scenario = scenario_from(
        {**document, "landmarks_m": dict(landmarks)}, max_vehicles=before.scenario.size
    )
    judged = judge(scenario, before.orbits, bound=bound, found=before.synchronisation)
    return replace(
        judged,
        synchronisation=before.synchronisation,
        alternating_proven=before.alternating_proven,
        placement=before.placement,
        centres_placed=before.centres_placed,
    )


def _lacking(judged: Plan, which: str) -> str:
    """Sentence on the states that stay undetermined, with a remedy."""
    motion = judged.unobservable[0]
    rank, size = judged.observability.rank, judged.observability.state_dim
    return (
        f"no choice of sites determines every vehicle: {which} rank {rank} of {size}: "
        f"{motion.description}; cure: {motion.cure}"
    )
