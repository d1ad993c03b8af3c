"""Bodies that schemathesis sends where the OpenAPI document asks for an archive.

Loaded by schemathesis; see tests/searches/search_contract.py. Of itself it can send none of these
types. A third are recordings, whole; a third are cut off; the others are any bytes.
"""

import bz2
import gzip
import io
import lzma
import tarfile

import schemathesis
from hypothesis import strategies as st

from tests.tools.record_examples import RECORDED
from tests.tools.recordings import zipped

__all__ = ["ARCHIVES"]

_FILES = {f"hall/{name}": text.encode() for name, text in RECORDED.items()}


def _tarred() -> bytes:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as archive:
        for name, content in _FILES.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            archive.addfile(entry, io.BytesIO(content))
    return stream.getvalue()


ARCHIVES = {
    "application/zip": zipped(_FILES),
    "application/x-tar": _tarred(),
    "application/gzip": gzip.compress(_tarred()),
    "application/x-xz": lzma.compress(_tarred()),
    "application/x-bzip2": bz2.compress(_tarred()),
    "application/octet-stream": zipped(_FILES),
}
"""A small recording by media type."""


def _bodies(whole: bytes) -> st.SearchStrategy[bytes]:
    cut = st.integers(0, len(whole) - 1).map(lambda size: whole[:size])
    return st.just(whole) | cut | st.binary(max_size=200)


for _medium, _whole in ARCHIVES.items():
    schemathesis.openapi.media_type(_medium, _bodies(_whole))
