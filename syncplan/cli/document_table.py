"""The table of documents: their schemas, and how reports are recognised."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from syncplan.scenario.other_documents import other_document

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
    title : title of a report without a name; empty for documents that are no reports
    """

    module: str
    name: str
    mode: Literal["validation", "serialization"] = "serialization"
    published: bool = True
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
        "plan": DocumentKind("syncplan.reports.plan_report", "PlanDocument"),
        "sites": DocumentKind("syncplan.reports.sites_report", "SitesDocument"),
        "brief": DocumentKind("syncplan.scenario.brief", "Brief", "validation"),
        "design": DocumentKind("syncplan.reports.design_report", "DesignDocument", title="Design"),
        "what-if": DocumentKind("syncplan.planning.loss_study", "WhatIfDocument", title="What if"),
        "validation": DocumentKind(_RUNS, "ValidationDocument", title="Validation"),
        "flight": DocumentKind("syncplan.reports.flight_report", "FlightDocument", title="Flight"),
        "replay": DocumentKind("syncplan.reports.replay_report", "ReplayDocument", title="Replay"),
        "sync": DocumentKind("syncplan.exporting.sidecar", "SyncDocument"),
        "sweep": DocumentKind(_RUNS, "SweepReport", published=False, title="Sweep"),
    }
)
"""All kinds of documents by name."""


def read_report(values: Mapping[str, Any], source: str) -> "tuple[Report, str] | None":
    """Return the report in a file's values and its title, None if they are not a report.

    Raises InputError, naming the source, for a report that does not fit its schema.
    """
    kind = DOCUMENTS.get(other_document(values) or "")
    if kind is None or not kind.title:
        return None
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
