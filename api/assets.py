"""What the web page is made of: its own files, the library's tables, examples, and Plotly."""

import gzip
import hashlib
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

from api.page_tables import tables_script

PAGE = "index.html"
PLOTLY = "plotly.min.js"
TABLES = "tables.js"
"""What the library lets people choose from, as a module that the page imports."""

_MEDIA = {
    "css": "text/css; charset=utf-8",
    "html": "text/html; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
    "yaml": "application/yaml",
}
_EXAMPLES = "examples"
_LEVEL = 6


@dataclass(frozen=True, slots=True)
class Asset:
    """A file as it is sent.

    Attributes
    ----------
    compressed : its content by gzip, for those who take that
    etag : a digest of the content
    """

    content: bytes
    compressed: bytes
    media_type: str
    etag: str


def find_asset(name: str) -> Asset | None:
    """Return a file by its name, or None; examples are named examples/NAME.yaml."""
    return _asset(name) if name in _names() else None


@lru_cache
def _names() -> frozenset[str]:
    """Every name there is: no other leads anywhere."""
    folder = files("api").joinpath("page")
    own = [one.name for one in folder.iterdir() if one.is_file()]
    examples = [f"{_EXAMPLES}/{one.name}" for one in folder.joinpath(_EXAMPLES).iterdir()]
    known = [name for name in (*own, *examples) if name.rpartition(".")[2] in _MEDIA]
    return frozenset((*known, PLOTLY, TABLES))


@lru_cache
def _asset(name: str) -> Asset:
    """Kept once it was asked for: compressing Plotly's script takes a quarter of a second."""
    content = _content(name)
    return Asset(
        content=content,
        compressed=gzip.compress(content, _LEVEL, mtime=0),
        media_type=_MEDIA[name.rpartition(".")[2]],
        etag=hashlib.sha256(content).hexdigest()[:32],
    )


def _content(name: str) -> bytes:
    if name == PLOTLY:
        return files("plotly").joinpath("package_data", PLOTLY).read_bytes()
    if name == TABLES:
        return tables_script().encode()
    return files("api").joinpath("page", *name.split("/")).read_bytes()
