"""Bodies that schemathesis sends where the OpenAPI document asks for an archive.

Loaded by schemathesis; see tests/searches/search_contract.py. Of itself it can send none of these
types. A third are recordings, whole; a third are cut off; the others are any bytes.
"""

import schemathesis
from hypothesis import strategies as st

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
