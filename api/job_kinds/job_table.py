"""All kinds of jobs: routes, workflows, storage, documentation and the page read this table."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from api.job_kinds.job_kind import JobKind, JobRequest
from api.job_kinds.requests import (
    DesignRequest,
    FlightRequest,
    PlanRequest,
    RefinementRequest,
    ReplayRequest,
    request_for,
)
from api.job_kinds.sweep_request import SweepRequest
from syncplan.studies.job_contract import JobKindName
from syncplan.studies.study_table import STUDIES

_REQUESTS: Mapping[JobKindName, type[JobRequest]] = {
    "refinement": RefinementRequest,
    "flight": FlightRequest,
    "sweep": SweepRequest,
    "replay": ReplayRequest,
    "design": DesignRequest,
}
"""Requests that have limits or keys of their own."""

JOB_KINDS: Mapping[JobKindName, JobKind] = MappingProxyType(
    {
        name: JobKind(study, request_for(study, _REQUESTS.get(name, PlanRequest)))
        for name, study in STUDIES.items()
    }
)
"""Every kind of job by its name."""


def plurals(belongs: Callable[[JobKind], bool]) -> str:
    """Return the plurals of the kinds for which a condition holds, joined as in "a, b and c"."""
    *first, last = [kind.study.plural for kind in JOB_KINDS.values() if belongs(kind)]
    return f"{', '.join(first)} and {last}" if first else last
