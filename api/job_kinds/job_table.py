"""All kinds of jobs: routes, workflows, storage, documentation and the page read this table."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from api.job_kinds.design_jobs import DESIGN
from api.job_kinds.job_kind import JobKind
from api.job_kinds.refinement_jobs import REFINEMENT
from api.job_kinds.replay_jobs import REPLAY
from api.job_kinds.sweep_jobs import SWEEP
from api.job_kinds.trial_jobs import FLIGHT, VALIDATION
from syncplan.reports.job_contract import JobKindName

JOB_KINDS: Mapping[JobKindName, JobKind] = MappingProxyType(
    {kind.name: kind for kind in (REFINEMENT, VALIDATION, FLIGHT, SWEEP, REPLAY, DESIGN)}
)
"""Every kind of job by its name."""


def plurals(belongs: Callable[[JobKind], bool]) -> str:
    """Return the plurals of the kinds for which a condition holds, joined as in "a, b and c"."""
    *first, last = [kind.plural for kind in JOB_KINDS.values() if belongs(kind)]
    return f"{', '.join(first)} and {last}" if first else last
