"""The table of documents: their schemas, and how reports are recognised."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar

from syncplan.scenario.other_documents import other_document
from syncplan.studies.study import DocumentKind
from syncplan.studies.study_table import STUDIES

if TYPE_CHECKING:
    from pydantic import BaseModel

    from syncplan.results.stories import Report

Model = TypeVar("Model", bound="BaseModel")


DOCUMENTS: Mapping[str, DocumentKind] = MappingProxyType(
    {
        "scenario": DocumentKind("syncplan.scenario.specification", "Scenario", "validation"),
        "plan": DocumentKind("syncplan.reports.plan_report", "PlanDocument"),
        "sites": DocumentKind("syncplan.reports.sites_report", "SitesDocument"),
        "brief": DocumentKind("syncplan.scenario.brief", "Brief", "validation"),
        "what-if": DocumentKind("syncplan.planning.loss_study", "WhatIfDocument", title="What if"),
        **{name: study.document for name, study in STUDIES.items() if study.document is not None},
        "sync": DocumentKind("syncplan.exporting.sidecar", "SyncDocument"),
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
