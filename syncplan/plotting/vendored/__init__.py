"""Files of others that pages and images bring along, so that they need no network.

plotly-basic.min.js           Plotly's smallest bundle that draws lines, marks and bars (MIT)
arimo-latin-400-normal.woff2  Arimo, as wide as Arial and Helvetica, letters of Latin-1 (OFL 1.1)

`make vendor` copies them from npm by vendor/package-lock.json and renews SHA256SUMS.
"""

from importlib.resources import files

FONT_NAME = "Arimo"


def plotly_script() -> str:
    """Return Plotly's script."""
    return _content("plotly-basic.min.js").decode("utf-8")


def font() -> bytes:
    """Return the font FONT_NAME in the format WOFF2."""
    return _content("arimo-latin-400-normal.woff2")


def _content(name: str) -> bytes:
    return files(__package__).joinpath(name).read_bytes()
