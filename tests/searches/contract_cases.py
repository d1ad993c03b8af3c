"""What schemathesis sends: archives where the document asks for them, and edge cases once.

Loaded by schemathesis; see tests/searches/contract.py. Of itself it can send no archive. A
third are recordings, whole; a third are cut off; the others are any bytes.
"""

from typing import Any

import schemathesis
from hypothesis import strategies as st
from schemathesis.core.parameters import ParameterLocation
from schemathesis.generation.meta import CoveragePhaseData

from tests.tools.record_examples import RECORDED
from tests.tools.recordings import tarred, zipped

__all__ = ["ARCHIVES"]

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
    """Return whether a case is sent: edge cases of a body are, once and as JSON.

    Previews take the bodies of plans. Drawn cases have all media types.
    """
    edge = None if case.meta is None else case.meta.phase.data
    if not isinstance(edge, CoveragePhaseData) or edge.parameter_location != ParameterLocation.BODY:
        return True
    return case.media_type != "application/yaml" and case.path != "/v1/previews"
