"""Scenarios, plans and recordings in the forms in which they are sent and stored."""

import io
import json
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Literal

from pydantic import Field

from api.limits import RequestLimits, check_size
from syncplan.documents import finite_or_none
from syncplan.errors import InputError
from syncplan.planning.plan_files import Loaded, loaded_from
from syncplan.planning.plans import Plan
from syncplan.recordings.log import Overview, overview_of, pack_log
from syncplan.recordings.recording_formats import Stamps
from syncplan.reports.plan_report import plan_document
from syncplan.runtime.files import as_text
from syncplan.scenario.loading import decoded, parse_document
from syncplan.scenario.quantities import Name, Section, Title

Syntax = Literal["json", "yaml"]

_MOST_OUTLINED = 200
"""Most circles, and most landmarks, of an outline."""


@dataclass(frozen=True, slots=True)
class PlanText:
    """Text of a plan's file, and the values that lists show; `outline` is JSON."""

    text: str
    name: str | None
    vehicles: int
    observable: bool
    predicted_rms_m: float | None
    worst_predicted_rms_m: float | None = None
    outline: str | None = None


def loaded_body(body: bytes, syntax: Syntax, limits: RequestLimits) -> Loaded:
    """Return the scenario in a body, or the plan: a scenario with its orbits.

    Raises InputError, also for a scenario beyond the limits.
    """
    document = parse_document(decoded(body, ""), "", syntax)
    loaded = loaded_from(document, max_vehicles=limits.vehicles)
    try:
        check_size(loaded.scenario, limits)
    except InputError as error:
        raise (error if loaded.orbits is None else error.within("scenario")) from None
    return loaded


def loaded_plan(text: str) -> Loaded:
    """Return the scenario and the orbits of a stored plan."""
    document = parse_document(text, "", "json")
    # its size was allowed when it was stored
    return loaded_from(document, max_vehicles=len(document["vehicles"]))


def as_plan_text(plan: Plan) -> PlanText:
    """Return a plan in its stored form."""
    document = plan_document(plan)
    predicted, rms = document.predicted_rms_m, plan.prediction.rms
    return PlanText(
        text=as_text(document.as_json()),
        name=plan.scenario.name,
        vehicles=plan.orbits.count,
        observable=plan.observable,
        predicted_rms_m=None if predicted is None else predicted.overall,
        worst_predicted_rms_m=None if rms is None else finite_or_none(float(rms.max())),
        outline=json.dumps(_outline(plan), separators=(",", ":")),
    )


def _outline(plan: Plan) -> dict[str, list[list[float]] | None]:
    """Return circles (x, y, radius), landmarks and area of a plan in m, as a small map needs them.

    They are rounded to three significant digits of their extent.
    """
    orbits, area = plan.orbits, plan.scenario.area_m or []
    circles = [(x, y, radius) for (x, y), radius in zip(orbits.centers, orbits.radii, strict=True)]
    circles, landmarks = circles[:_MOST_OUTLINED], plan.scenario.landmarks[:_MOST_OUTLINED]
    reached = [(x + r, y + r) for x, y, size in circles for r in (-size, size)]
    extent = max(max(axis) - min(axis) for axis in zip(*reached, *landmarks, *area, strict=True))
    decimals = 2 - math.floor(math.log10(extent))

    def rounded(places: Iterable[tuple[float, ...]]) -> list[list[float]]:
        # no negative zeros
        return [[round(float(value), decimals) + 0.0 for value in place] for place in places]

    return {
        "circles": rounded(circles),
        "landmarks": rounded(landmarks),
        "area": rounded(area) or None,
    }


class PlanRenaming(Section):
    """Another name for a plan."""

    name: Title = Field(description="The scenario's title", examples=["survey"])


def renamed_text(text: str, name: str) -> str:
    """Return the text of a plan whose scenario has another name."""
    document = json.loads(text)
    document["scenario"]["name"] = name
    return as_text(document)


# --- recordings -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class PackedRecording:
    """A recording packed by syncplan.recordings.log, and its overview as JSON."""

    data: bytes
    overview: str


def packed_recording(body: bytes, name: str | None, stamps: Stamps) -> PackedRecording:
    """Return the recording in an archive, with times by `stamps`, renamed if a name is given.

    Raises InputError, whose key is the file at fault.
    """
    from syncplan.recordings.recording_formats import read_archive

    try:
        log = read_archive(io.BytesIO(body), stamps=stamps)
    except InputError as error:
        raise InputError(error.problem, key=error.source or error.key) from None
    named = log if name is None else replace(log, name=name)
    return PackedRecording(pack_log(named), json.dumps(asdict(overview_of(named))))


class RecordingRenaming(Section):
    """Another name for a recording."""

    name: Name = Field(description="Its name in further reports", examples=["hall"])


def overview_of_text(text: str) -> Overview:
    """Return the overview of a recording from its stored JSON."""
    values = json.loads(text)
    lists = {key: tuple(one) for key, one in values.items() if isinstance(one, list)}
    return Overview(**{**values, **lists})
