"""One figure as an image, by kaleido and a Chrome or Chromium that is installed."""

import importlib.util
import re
from typing import Any

from syncplan.errors import InputError, SyncplanError
from syncplan.plotting.canvas import Spec

__all__ = ["figure_image"]

WIDTH_PX = 1000

_SCALE = {"png": 2.0}
"""Pixels of the file for each of the layout; 200 dots an inch at 5 inches a 1000."""

_TIMEOUT_S = 90
_PDF_DATE = re.compile(rb"D:\d{14}")
_SVG_KEY = re.compile(r"\b(?:clip|defs-|topdefs-|legend)([0-9a-f]{6})")


def figure_image(spec: Spec, image_format: str) -> bytes:
    """Return a figure as PNG, SVG or PDF on white, WIDTH_PX wide; the same one as the same bytes.

    Raises InputError where kaleido or the browser is missing, SyncplanError where drawing fails.
    """
    missing = [n for n in ("plotly", "kaleido") if importlib.util.find_spec(n) is None]
    if missing:
        raise InputError(
            f"needs {' and '.join(missing)}: pip install 'syncplan[plot]'; a .html page needs no "
            "browser",
            source=f"an image (.{image_format})",
        )
    layout = {**spec["layout"], "paper_bgcolor": "#ffffff"}
    # what a page is operated by has no place on paper
    layout.pop("updatemenus", None)
    layout.pop("sliders", None)
    image = _drawn({"data": spec["data"], "layout": layout}, image_format)
    if image_format == "svg":
        return _without_random_keys(image.decode("utf-8")).encode("utf-8")
    return _PDF_DATE.sub(b"D:20000101000000", image) if image_format == "pdf" else image


def _drawn(values: Spec, image_format: str) -> bytes:
    import logging

    import kaleido
    from kaleido.errors import ChromeNotFoundError

    logging.getLogger("choreographer").setLevel(logging.ERROR)
    logging.getLogger("kaleido").setLevel(logging.ERROR)
    options: dict[str, Any] = {
        "format": image_format,
        "width": WIDTH_PX,
        "height": values["layout"]["height"],
        "scale": _SCALE.get(image_format, 1.0),
    }
    try:
        # without mathjax=False a script would be fetched
        image = kaleido.calc_fig_sync(
            values, opts=options, kopts={"mathjax": False, "timeout": _TIMEOUT_S}
        )
    except ChromeNotFoundError:
        raise InputError(
            "needs Chrome or Chromium: install one (kaleido_get_chrome fetches it), name it in "
            "BROWSER_PATH, or write a .html page instead",
            source=f"an image (.{image_format})",
        ) from None
    except Exception as error:
        what = " ".join(str(error).split())[:200] or type(error).__name__
        raise SyncplanError(
            f"the browser could not draw the image: {what}; a .html page needs none"
        ) from error
    return bytes(image)


def _without_random_keys(svg: str) -> str:
    """Plotly draws a random key for the names of an image's clips; here it is always the same."""
    for key in dict.fromkeys(_SVG_KEY.findall(svg)):
        svg = svg.replace(key, "000000")
    return svg
