"""Figures as images, by kaleido and a Chrome or Chromium that is installed, started once."""

import importlib.util
import re
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from syncplan.errors import InputError, SyncplanError
from syncplan.plotting.canvas import Spec
from syncplan.plotting.figure_style import PAPER, PLAIN, FigureStyle

_TIMEOUT_S = 90
_PDF_DATE = re.compile(rb"D:\d{14}")
_SVG_KEY = re.compile(r"\b(?:clip|defs-|topdefs-|legend)([0-9a-f]{6})")


def figure_images(
    specs: Mapping[str, Spec], image_format: str, style: FigureStyle = PLAIN
) -> dict[str, bytes]:
    """Return figures as PNG, SVG or PDF by name, the same ones as the same bytes.

    Each is as wide and high as it was laid out, on its theme's background; a PNG has the style's
    dots for each px. One browser draws them all. Raises InputError where kaleido or the browser is
    missing, SyncplanError where drawing fails.
    """
    missing = [n for n in ("plotly", "kaleido") if importlib.util.find_spec(n) is None]
    if missing:
        raise InputError(
            f"needs {' and '.join(missing)}: pip install 'syncplan[plot]'; a .html page needs no "
            "browser",
            source=f"an image (.{image_format})",
        )
    jobs = [_job(spec, image_format, style) for spec in specs.values()]
    images = zip(specs, _drawn(jobs, image_format), strict=True)
    return {name: _constant(image, image_format) for name, image in images}


def _job(spec: Spec, image_format: str, style: FigureStyle) -> Spec:
    """A figure on paper, with kaleido's options."""
    layout = {**spec["layout"], "paper_bgcolor": PAPER[style.theme]}
    # what a page is operated by has no place on paper
    if layout.pop("sliders", None):
        room = layout["meta"]["controls_px"]
        layout["height"] -= room
        layout["margin"] = {**layout["margin"], "b": layout["margin"]["b"] - room}
    layout.pop("updatemenus", None)
    options = {
        "format": image_format,
        "width": style.page_px,
        "height": layout["height"],
        "scale": style.pixel_ratio if image_format == "png" else 1.0,
    }
    return {"fig": {"data": spec["data"], "layout": layout}, "opts": options}


def _drawn(jobs: Sequence[Spec], image_format: str) -> list[bytes]:
    import logging

    from kaleido.errors import ChromeNotFoundError

    # what fails raises; a browser's goodbye that comes with its last answer is logged as an error
    for library in ("choreographer", "kaleido"):
        logging.getLogger(library).setLevel(logging.CRITICAL)
    try:
        # a thread of its own: a notebook's has an event loop that runs already
        with ThreadPoolExecutor(1) as pool:
            return pool.submit(_by_one_browser, jobs).result()
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


def _by_one_browser(jobs: Sequence[Spec]) -> list[bytes]:
    import asyncio

    import kaleido

    async def drawn() -> list[Any]:
        # without mathjax=False a script would be fetched
        async with kaleido.Kaleido(n=1, mathjax=False, timeout=_TIMEOUT_S) as browser:
            return [await browser.calc_fig(job["fig"], opts=job["opts"]) for job in jobs]

    return [bytes(image) for image in asyncio.run(drawn())]


def _constant(image: bytes, image_format: str) -> bytes:
    """An image without what changes from one drawing to the next."""
    if image_format == "svg":
        return _without_random_keys(image.decode("utf-8")).encode("utf-8")
    return _PDF_DATE.sub(b"D:20000101000000", image) if image_format == "pdf" else image


def _without_random_keys(svg: str) -> str:
    """Plotly draws a random key for the names of an image's clips; here it is always the same."""
    for key in dict.fromkeys(_SVG_KEY.findall(svg)):
        svg = svg.replace(key, "000000")
    return svg
