"""What schemathesis sends: archives where the document asks for them, and edge cases once.

Loaded by schemathesis; see tests/searches/contract.py. Of itself it can send no archive. A
third are recordings, whole; a third are cut off; the others are any bytes.
"""

import itertools
import os
from typing import Any

import schemathesis
from hypothesis import strategies as st
from schemathesis.core.parameters import ParameterLocation
from schemathesis.generation.meta import CoveragePhaseData

from tests.tools.record_examples import RECORDED
from tests.tools.recordings import tarred, zipped

__all__ = ["ARCHIVES"]

_THIRD = int(os.environ["SYNCPLAN_CONTRACT_THIRD"])
"""Which third of the edge cases is sent: 0, 1 or 2."""

_edges = itertools.count()

_FILES = {f"hall/{name}": text.encode() for name, text in RECORDED.items()}


ARCHIVES = {
    "application/zip": zipped(_FILES),
    "application/x-tar": tarred(_FILES),
    "application/gzip": tarred(_FILES, "gz"),
    "application/x-xz": tarred(_FILES, "xz"),
    "application/x-bzip2": tarred(_FILES, "bz2"),
    "application/octet-stream": zipped(_FILES),
}
"""A small recording by media type."""


def _bodies(whole: bytes) -> st.SearchStrategy[bytes]:
    cut = st.integers(0, len(whole) - 1).map(lambda size: whole[:size])
    return st.just(whole) | cut | st.binary(max_size=200)


for _medium, _whole in ARCHIVES.items():
    schemathesis.openapi.media_type(_medium, _bodies(_whole))


@schemathesis.hook
def filter_case(_context: schemathesis.HookContext, case: schemathesis.Case[Any]) -> bool:
    """Return whether a case is sent: of edge cases a third, those of a body as JSON alone.

    Previews take the bodies of plans. Drawn cases have all media types.
    """
    edge = None if case.meta is None else case.meta.phase.data
    if not isinstance(edge, CoveragePhaseData):
        return True
    if edge.parameter_location == ParameterLocation.BODY and (
        case.media_type == "application/yaml" or case.path == "/v1/previews"
    ):
        return False
    return next(_edges) % 3 == _THIRD
