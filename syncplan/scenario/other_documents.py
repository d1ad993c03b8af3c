"""Documents that are neither scenarios nor plans: their names, and the keys that identify them."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from syncplan.errors import InputError


@dataclass(frozen=True, slots=True)
class OtherDocument:
    """A kind of document that is refused where a scenario or a plan is expected.

    Attributes
    ----------
    called : its name, with the article
    keys : keys that identify it
    instead : remedy: the document to give in its place
    """

    called: str
    keys: frozenset[str]
    instead: str


_PLAN_IT_CAME_FROM = "give the plan it came from, or its scenario"

OTHER_DOCUMENTS: Mapping[str, OtherDocument] = MappingProxyType(
    {
        "validation": OtherDocument(
            "a validation report", frozenset({"anees", "trials"}), _PLAN_IT_CAME_FROM
        ),
        "flight": OtherDocument(
            "a report of a flight", frozenset({"anees", "guidance", "trials"}), _PLAN_IT_CAME_FROM
        ),
        "replay": OtherDocument(
            "a report of a replay", frozenset({"anees", "readings"}), "recordings have no plan"
        ),
        "sweep": OtherDocument(
            "a report of a sweep", frozenset({"swept"}), "give the scenario it came from"
        ),
        "sites": OtherDocument(
            "a choice of landmark sites",
            frozenset({"candidates", "chosen"}),
            "give its 'plan' section, or the scenario that landmarks --scenario-out writes",
        ),
        "brief": OtherDocument(
            "a brief", frozenset({"purpose", "need", "team"}), "give it to syncplan design"
        ),
        "design": OtherDocument(
            "a design",
            frozenset({"brief", "front", "purchases"}),
            "give its 'plan' section, or the plan that design --plan-out writes",
        ),
        "what-if": OtherDocument(
            "a report of losses", frozenset({"baseline", "losses"}), _PLAN_IT_CAME_FROM
        ),
        "sync": OtherDocument(
            "the sidecar of an export", frozenset({"procedure", "meetings"}), _PLAN_IT_CAME_FROM
        ),
        "geojson": OtherDocument(
            "GeoJSON", frozenset({"type", "features"}), "give the plan it was exported from"
        ),
        "qgc": OtherDocument(
            "a QGroundControl plan",
            frozenset({"fileType", "mission"}),
            "give the plan it was exported from",
        ),
        "schema": OtherDocument(
            "a JSON Schema", frozenset({"$schema"}), "give a scenario that it describes"
        ),
        "problem": OtherDocument(
            "a problem that the service answered with",
            frozenset({"detail", "status", "title"}),
            "give what was sent",
        ),
    }
)
"""The kinds by name."""


def other_document(keys: Mapping[str, Any]) -> str | None:
    """Return the kind of a document by its keys, the most specific that fits; None if none does."""
    fitting = [name for name, one in OTHER_DOCUMENTS.items() if one.keys <= keys.keys()]
    return max(fitting, key=lambda name: len(OTHER_DOCUMENTS[name].keys), default=None)


def refuse_other_documents(document: Mapping[str, Any], source: str) -> None:
    """Raise InputError for a known document that is neither a scenario nor a plan."""
    name = None if "orbit" in document else other_document(document)
    if name is not None:
        one = OTHER_DOCUMENTS[name]
        raise InputError(
            f"is {one.called} where a scenario or a plan is wanted; {one.instead}", source=source
        )
