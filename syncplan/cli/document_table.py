"""The table of documents: their schemas, and the keys that identify reports."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from syncplan.scenario.other_documents import OTHER_DOCUMENTS

if TYPE_CHECKING:
    from pydantic import BaseModel

    from syncplan.results.stories import Report

Model = TypeVar("Model", bound="BaseModel")


@dataclass(frozen=True, slots=True)
class DocumentKind:
    """A kind of document.

    Attributes
    ----------
    module, name : module and name of its model, which is loaded on demand
    mode : Pydantic's mode: validation for documents read, serialization for documents written
    published : whether the command line prints its schema
    known_by : keys that identify a report of this kind; empty for other documents
    title : title of a report without a name
    """

    module: str
    name: str
    mode: Literal["validation", "serialization"] = "serialization"
    published: bool = True
    known_by: frozenset[str] = frozenset()
    title: str = ""

    @property
    def model(self) -> "type[BaseModel]":
        """Model of the document."""
        found: type[BaseModel] = getattr(import_module(self.module), self.name)
        return found


_RUNS = "syncplan.reports.validation_report"

DOCUMENTS: Mapping[str, DocumentKind] = MappingProxyType(
    {
        "scenario": DocumentKind("syncplan.scenario.specification", "Scenario", "validation"),
        "plan": DocumentKind(
            "syncplan.reports.plan_report",
            "PlanDocument",
        ),
        "sites": DocumentKind("syncplan.reports.sites_report", "SitesDocument"),
        "brief": DocumentKind("syncplan.scenario.brief", "Brief", "validation"),
        "design": DocumentKind(
            "syncplan.reports.design_report",
            "DesignDocument",
            known_by=OTHER_DOCUMENTS["design"].keys,
            title="Design",
        ),
        "what-if": DocumentKind(
            "syncplan.planning.loss_study",
            "WhatIfDocument",
            known_by=frozenset({"baseline", "losses"}),
            title="What if",
        ),
        "validation": DocumentKind(
            _RUNS,
            "ValidationDocument",
            known_by=OTHER_DOCUMENTS["validation"].keys,
            title="Validation",
        ),
        "flight": DocumentKind(
            "syncplan.reports.flight_report",
            "FlightDocument",
            known_by=OTHER_DOCUMENTS["flight"].keys,
            title="Flight",
        ),
        "replay": DocumentKind(
            "syncplan.reports.replay_report",
            "ReplayDocument",
            known_by=OTHER_DOCUMENTS["replay"].keys,
            title="Replay",
        ),
        "sync": DocumentKind("syncplan.exporting.sidecar", "SyncDocument"),
        "sweep": DocumentKind(
            _RUNS,
            "SweepReport",
            published=False,
            known_by=OTHER_DOCUMENTS["sweep"].keys,
            title="Sweep",
        ),
    }
)
"""All kinds of documents by name."""


def read_report(values: Mapping[str, Any], source: str) -> "tuple[Report, str] | None":
    """Return the report in a file's values and its title, None if they are not a report.

    Raises InputError, naming the source, for a report that does not fit its schema.
    """
    keys = set(values)
    fitting = [one for one in DOCUMENTS.values() if one.known_by and one.known_by <= keys]
    if not fitting:
        return None
    kind = max(fitting, key=lambda one: len(one.known_by))
    report: Any = checked(kind.model, values, source)
    return report, report.name or kind.title


def checked(model: type[Model], values: Any, source: str) -> Model:
    """Return values as a model; raises InputError, naming the source, if they don't fit."""
    from pydantic import ValidationError

    from syncplan.scenario.quantities import validation_fault

    try:
        return model.model_validate(values)
    except ValidationError as error:
        validation_fault(error, model, source)
