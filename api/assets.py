"""What the web page is made of: its own files, the example scenarios, and Plotly's script."""

import gzip
import hashlib
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

__all__ = ["PAGE", "PLOTLY", "Asset", "find_asset"]

PAGE = "index.html"
PLOTLY = "plotly.min.js"

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


@lru_cache(maxsize=64)
def find_asset(name: str) -> Asset | None:
    """Return a file by its name, or None; examples are named examples/NAME.yaml.

    Kept once it was asked for: compressing Plotly's script takes a quarter of a second.
    """
    content = _content(name)
    if content is None:
        return None
    return Asset(
        content=content,
        compressed=gzip.compress(content, _LEVEL, mtime=0),
        media_type=_MEDIA[name.rpartition(".")[2]],
        etag=hashlib.sha256(content).hexdigest()[:32],
    )


def _content(name: str) -> bytes | None:
    if name == PLOTLY:
        return files("plotly").joinpath("package_data", PLOTLY).read_bytes()
    folder = files("api").joinpath("page")
    if name.startswith(f"{_EXAMPLES}/"):
        folder, name = folder.joinpath(_EXAMPLES), name.removeprefix(f"{_EXAMPLES}/")
    # by comparison, so that no name leads out of the folder
    for one in folder.iterdir():
        if one.name == name and one.is_file() and name.rpartition(".")[2] in _MEDIA:
            return one.read_bytes()
    return None
