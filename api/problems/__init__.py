"""Errors as RFC 9457 documents: what routes raise, and one table from exceptions to statuses."""

from api.problems.handling import install_handlers
from api.problems.openapi_problems import document_problems, problem_responses
from api.problems.problem_document import FaultEntry, Problem
from api.problems.service_errors import (
    Conflict,
    ForeignPage,
    KeyReused,
    KeysThrottled,
    NotFound,
    PreconditionFailed,
    ServiceError,
    StorageFull,
    TooManyRequests,
    TooMuchWork,
    Unauthorized,
    Unavailable,
    WrongHost,
)

__all__ = [
    "Conflict",
    "FaultEntry",
    "ForeignPage",
    "KeyReused",
    "KeysThrottled",
    "NotFound",
    "PreconditionFailed",
    "Problem",
    "ServiceError",
    "StorageFull",
    "TooManyRequests",
    "TooMuchWork",
    "Unauthorized",
    "Unavailable",
    "WrongHost",
    "document_problems",
    "install_handlers",
    "problem_responses",
]
