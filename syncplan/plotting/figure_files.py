"""Figures as files: a page that works offline, and images.

The page is self-contained and works in light and dark, in print and by keyboard. Kaleido draws
images with an installed Chrome or Chromium, which it starts once.
"""

import base64
import html
import importlib.util
import json
import re
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from importlib.resources import files
from threading import Thread
from typing import Any

from syncplan.errors import InputError, SyncplanError
from syncplan.planning.judged_team import PlanVerdict
from syncplan.plotting.canvas import CONFIG, Spec
from syncplan.plotting.figure_style import DARK, PAPER, PLAIN, FigureStyle, Theme
from syncplan.plotting.figure_table import FIGURES
from syncplan.plotting.vendored import FONT_NAME, font, plotly_script

_PAGE_SIDES_PX = 48

_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:"
)
"""Content security policy of pages: the browser refuses to fetch anything."""


def figure_page(
    title: str,
    specs: Mapping[str, Spec],
    verdicts: Mapping[str, PlanVerdict] | None = None,
    *,
    columns: Mapping[str, Spec] | None = None,
    sheets: Mapping[str, Spec] | None = None,
    theme: Theme | None = None,
) -> str:
    """Return a self-contained HTML page of figures, given by name, under a heading.

    Verdicts on the plans shown, by label (empty for a single plan), stand above the figures with
    their findings. Figures have the colours of a light page; the script swaps them for those of
    `theme` or, without it, of the reader's system. `columns` and `sheets` are the same figures
    laid out for COLUMN_PX, shown where the page is narrow, and for SHEET_PX, shown where it is
    printed or of middle width. The page takes the largest width that a figure's layout states, if
    any. The same figures give the same bytes.
    """
    sections = "\n".join(_section(name) for name in specs)
    parts = {f"values-{name}": _fluid(spec) for name, spec in specs.items()}
    for layout, figures in (("column", columns), ("sheet", sheets)):
        for name, one in (figures or {}).items():
            parts[f"{layout}-{name}"] = _changed(specs[name], one)
    values = "\n".join(embedded(name, part) for name, part in parts.items())
    widths = [spec["layout"]["width"] for spec in specs.values() if "width" in spec["layout"]]
    width = f"body {{ max-width: {max(widths) + _PAGE_SIDES_PX}px; }}\n" if widths else ""
    scheme, chosen = (theme, f' data-theme="{theme}"') if theme else ("light dark", "")
    links = " ".join(f'<a href="#{name}">{html.escape(FIGURES[name].title)}</a>' for name in specs)
    heading = html.escape(title)
    judged = "".join(_verdict_lines(*one) for one in (verdicts or {}).items())
    return f"""<!DOCTYPE html>
<html lang="en"{chosen}>
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="{scheme}">
<title>{heading}</title>
<style>
{_beside("figure_page.css")}{width}</style>
</head>
<body>
<header><h1>{heading}</h1>
{judged}<nav aria-label="Figures">{links}</nav></header>
<main>
<noscript><p>The figures are drawn by a script; allow scripts for this page.</p></noscript>
{sections}
</main>
{values}
{embedded("dark-colors", dict(DARK))}
{embedded("plotly-config", dict(CONFIG))}
<script>{plotly_script()}</script>
<script>
{_beside("figure_page.js")}</script>
</body>
</html>
"""


def _verdict_lines(which: str, verdict: PlanVerdict) -> str:
    """HTML of a verdict: its headline, with the findings below."""
    items = "".join(
        f'<li data-code="{one.code}"><strong>{one.level.capitalize()}, '
        f"{one.code.replace('-', ' ')}</strong>: {html.escape(one.message)}</li>\n"
        for one in verdict.findings
    )
    listed = f'<ul class="findings">\n{items}</ul>\n' if items else ""
    headline = f"{which}: {verdict.headline}" if which else verdict.headline
    return f'<p class="verdict"><strong>{headline}</strong></p>\n{listed}'


def _fluid(spec: Spec) -> Spec:
    """Remove a figure's width, so that it takes the width of its page."""
    return {**spec, "layout": {key: v for key, v in spec["layout"].items() if key != "width"}}


def _changed(spec: Spec, column: Spec) -> Spec:
    """Parts of a figure that change in a narrow column; of an animation, the layout alone."""
    other = _fluid(column)
    keys = {"layout"} if spec["data"] == column["data"] or "frames" in spec else {"layout", "data"}
    return {key: other[key] for key in sorted(keys)}


def _section(name: str) -> str:
    entry = FIGURES[name]
    title, sentence = html.escape(entry.title), html.escape(entry.sentence)
    return (
        f'<section id="{name}" aria-labelledby="title-{name}">\n'
        f'<h2 id="title-{name}">{title}</h2>\n<p id="about-{name}">{sentence}</p>\n'
        f'<div class="plot" id="plot-{name}" role="img" aria-labelledby="title-{name}" '
        f'aria-describedby="about-{name}"></div>\n</section>'
    )


def embedded(name: str, values: Spec) -> str:
    """Return JSON inside a script element with id `name`, each < escaped."""
    text = json.dumps(values, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    safe = text.replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{safe}</script>'


def _beside(name: str) -> str:
    """Text of a file beside this module."""
    return files(__package__).joinpath(name).read_text("utf-8")


# --- images -------------------------------------------------------------------------------------

_TIMEOUT_S = 90
_FONTS = f"{FONT_NAME}, Arial, 'Liberation Sans', Helvetica, sans-serif"
"""Fonts of an SVG: the one it holds and, for viewers that do not read it, others as wide."""

_ADD_FONT = (
    f'document.fonts.add(new FontFace("{FONT_NAME}", '
    'Uint8Array.from(atob("%s"), (one) => one.charCodeAt(0))))'
)
_PDF_DATE = re.compile(rb"D:\d{14}")
_SVG_KEY = re.compile(r"\b(?:clip|defs-|topdefs-|legend)([0-9a-f]{6})")


def figure_images(
    specs: Mapping[str, Spec], image_format: str, style: FigureStyle = PLAIN
) -> dict[str, bytes]:
    """Return figures as PNG, SVG or PDF by name; the same figures give the same bytes.

    Each has the size of its layout and the background of the style's theme; a PNG has the style's
    dots per px, an SVG holds its font. One browser draws them all. Raises InputError if kaleido or
    the browser is missing, SyncplanError if drawing fails.
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
    """Figure on an opaque background, an SVG in the font that it holds, with kaleido's options."""
    layout = {**spec["layout"], "paper_bgcolor": PAPER[style.theme]}
    if image_format == "svg":
        layout["font"] = {**layout["font"], "family": _FONTS}
    # an image needs no controls
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

    # failures raise; a browser that closes with its last answer would be logged as an error
    for library in ("choreographer", "kaleido"):
        logging.getLogger(library).setLevel(logging.CRITICAL)
    drawn: Future[list[bytes]] = Future()

    def draw() -> None:
        try:
            drawn.set_result(_by_one_browser(jobs))
        except Exception as error:
            drawn.set_exception(error)

    # a thread of its own: a notebook's thread already runs an event loop. kaleido's time limit
    # covers a figure alone: it would wait for ever for a browser that dies as it starts or ends
    Thread(target=draw, daemon=True).start()
    try:
        return drawn.result(_TIMEOUT_S * (len(jobs) + 1))
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

    # with mathjax a script would be fetched
    page = kaleido.PageGenerator(mathjax=False)
    page.header += f"<script>{_ADD_FONT % _font_text()}</script>"

    async def drawn() -> list[Any]:
        async with kaleido.Kaleido(n=1, page_generator=page, timeout=_TIMEOUT_S) as browser:
            return [await browser.calc_fig(job["fig"], opts=job["opts"]) for job in jobs]

    return [bytes(image) for image in asyncio.run(drawn())]


def _constant(image: bytes, image_format: str) -> bytes:
    """Return an image that depends on nothing else than its figure.

    What changes from one drawing to the next is removed; an SVG holds its font.
    """
    if image_format == "svg":
        return _with_font(_without_random_keys(image.decode("utf-8"))).encode("utf-8")
    return _PDF_DATE.sub(b"D:20000101000000", image) if image_format == "pdf" else image


def _without_random_keys(svg: str) -> str:
    """Replace the random keys that Plotly puts into the names of an image's clips."""
    for key in dict.fromkeys(_SVG_KEY.findall(svg)):
        svg = svg.replace(key, "000000")
    return svg


def _with_font(svg: str) -> str:
    """Put the font into an SVG, for viewers that read fonts in images."""
    source = f'url(data:font/woff2;base64,{_font_text()}) format("woff2")'
    style = f"<style>@font-face{{font-family:{FONT_NAME};src:{source}}}</style>"
    begin = svg.index(">") + 1
    return svg[:begin] + style + svg[begin:]


def _font_text() -> str:
    return base64.b64encode(font()).decode("ascii")
