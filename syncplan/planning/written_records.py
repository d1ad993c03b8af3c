"""A plan file's record of how its orbits were found, kept while the orbits are unchanged."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from syncplan.arrays import as_pairs
from syncplan.documents import Words
from syncplan.orbits.team import Team
from syncplan.planning.plan_records import (
    FlownPlan,
    RefinementRecord,
    StartResult,
    flight_digest,
)
from syncplan.planning.plans import Plan
from syncplan.planning.verdict_checks import CENTRES_PLACED, CLEARED, PLACED
from syncplan.scenario.objectives import FIGURES, OBJECTIVES, Figures
from syncplan.scenario.quantities import Many
from syncplan.synchronisation.phases import Synchronisation
from syncplan.synchronisation.sighted_phases import attainable_contact

SAME_ORBITS = 1e-4
"""Share of the mean radius by which the links' least distances may differ from the file's."""


class _Read(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, strict=True, allow_inf_nan=False)


class _WrittenLink(_Read):
    a: str
    b: str
    min_distance_m: float
    contact_share: float | None = None


class _WrittenLoss(_Read):
    a: str
    b: str
    reason: Words


class _WrittenPhases(_Read):
    method: Words
    smallest_margin_m: float | None
    bound_m: float | None
    bound_note: Words
    odd_cycle: list[str]
    alternating_proven_largest: bool | None


class _WrittenRefinement(_Read):
    objective: str
    improved: bool
    reason: Words
    cut_short: bool
    before: dict[str, bool | float | None]
    after: dict[str, bool | float | None]
    active_constraints: list[Words]
    starts: list[StartResult]
    expected_rms_before_m: float | None = None


class _WrittenFinding(_Read):
    code: str


class _WrittenVerdict(_Read):
    findings: Many[_WrittenFinding]


class WrittenRecord(_Read):
    """Parts of a plan file that record how its orbits were found."""

    links: Many[_WrittenLink]
    dropped_links: Many[_WrittenLoss]
    synchronisation: _WrittenPhases
    refinement: _WrittenRefinement | None = None
    verdict: _WrittenVerdict | None = None
    flight: Any = None
    notes: Many[Words] = Field(default_factory=list)


def written_record(document: Mapping[str, Any]) -> WrittenRecord | None:
    """Return the record of a plan file; None if it has no readable one."""
    try:
        return WrittenRecord.model_validate(dict(document), extra="ignore")
    except (ValidationError, RecursionError):
        return None


def with_record(judged: Plan, record: WrittenRecord | None) -> Plan:
    """Return a plan that was judged afresh, with the record of its file.

    Its flights count only where their digest fits. The rest is left out if the links or their least
    distances differ from the file's: the orbits are then no longer those that it describes.
    """
    if record is None:
        return judged
    judged = _with_flight(judged, record.flight)
    if not _same_links(judged, record):
        return judged
    names = judged.scenario.vehicle_names
    reasons = {(one.a, one.b): one.reason for one in record.dropped_links}
    codes = [] if record.verdict is None else [one.code for one in record.verdict.findings]
    return replace(
        judged,
        synchronisation=_synchronisation(record, judged.team, names),
        alternating_proven=record.synchronisation.alternating_proven_largest,
        dropped_links=tuple(
            replace(one, reason=reasons[names[one.a], names[one.b]]) for one in judged.dropped_links
        ),
        refinement=_refinement(record.refinement, cleared=CLEARED in codes),
        centres_placed=CENTRES_PLACED in codes or PLACED in record.notes,
    )


def _with_flight(judged: Plan, values: Any) -> Plan:
    """Plan with the flights of its file, or with the reason why they do not count."""
    if values is None:
        return judged
    try:
        flight = FlownPlan.model_validate(values)
    except (ValidationError, RecursionError):
        return replace(judged, dropped_flights="their record cannot be read")
    if flight.digest is None:
        reason = "they are of an earlier version, whose files have no digest"
    elif flight.digest != flight_digest(judged.scenario, judged.orbits, flight):
        reason = "scenario, orbits, figures or version of syncplan have changed since"
    elif not flight.bears_out(judged.scenario):
        reason = "they were disturbed, in open loop or of another duration"
    else:
        return replace(judged, flight=flight)
    return replace(judged, dropped_flights=reason)


def _same_links(judged: Plan, record: WrittenRecord) -> bool:
    names, orbits = judged.scenario.vehicle_names, judged.orbits
    stated = {(one.a, one.b): one.min_distance_m for one in record.links}
    found = {(names[one.a], names[one.b]): one.min_distance for one in judged.links}
    lost = {(names[one.a], names[one.b]) for one in judged.dropped_links}
    if stated.keys() != found.keys() or lost != {(one.a, one.b) for one in record.dropped_links}:
        return False
    allowed = SAME_ORBITS * float(orbits.radii.mean())
    return all(abs(found[pair] - distance) <= allowed for pair, distance in stated.items())


def _synchronisation(record: WrittenRecord, team: Team, names: list[str]) -> Synchronisation | None:
    """Recorded synchronisation; None if the phases were given or refined."""
    given, index = record.synchronisation, {name: k for k, name in enumerate(names)}
    if given.method in ("given", "refined") or not set(given.odd_cycle) <= index.keys():
        return None
    attainable = None
    if any(one.contact_share is not None for one in record.links):
        pairs = [(index[one.a], index[one.b]) for one in record.links]
        pairs += [(index[one.a], index[one.b]) for one in record.dropped_links]
        attainable = attainable_contact(team, as_pairs(pairs))
    return Synchronisation(
        phases=team.orbits.phases,
        method=given.method,
        margin=given.smallest_margin_m,
        bound=given.bound_m,
        bound_note=given.bound_note,
        dropped=(),
        odd_cycle=tuple(index[name] for name in given.odd_cycle),
        attainable=attainable,
    )


def _refinement(given: _WrittenRefinement | None, *, cleared: bool) -> RefinementRecord | None:
    if given is None or given.objective not in OBJECTIVES:
        return None
    return RefinementRecord(
        options=None,
        objective=given.objective,
        improved=given.improved,
        reason=given.reason,
        cut_short=given.cut_short,
        before=_figures(given.before),
        after=_figures(given.after),
        active=tuple(given.active_constraints),
        starts=tuple(given.starts),
        expected_before=given.expected_rms_before_m,
        cleared=cleared,
    )


def _figures(values: Mapping[str, bool | float | None]) -> Figures:
    """Figures of merit; those that were not finite, or are missing, are NaN."""
    known = {one.name: _number(values.get(one.key)) for one in FIGURES}
    objectives = {name: known.pop(name) for name in OBJECTIVES}
    rank, certified = known.pop("rank"), known.pop("certified")
    return Figures(
        rank=0 if math.isnan(rank) else int(rank),
        certified=certified == 1.0,
        objectives=objectives,
        **known,
    )


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)
