"""Maps as static SVG, drawn from the same traces as Plotly's, without a script or a browser."""

import math
from collections.abc import Callable, Iterator, Sequence
from html import escape, unescape
from typing import Any

from syncplan.plotting.canvas import Spec
from syncplan.plotting.figure_style import INK, MUTED

_DASHES = {"dot": (1, 1), "dash": (3, 3), "longdash": (5, 5), "dashdot": (3, 1, 1, 1)}
"""Plotly's dashes, in widths of the line, which count as 3 px at least."""

_Place = tuple[float, float]

_ANCHORS = {"left": "end", "right": "start"}

_STAR = " ".join(
    f"{r * math.sin(math.pi * k / 5):.3f},{-r * math.cos(math.pi * k / 5):.3f}"
    for k, r in enumerate([1.0, 0.4] * 5)
)
_OUTLINES = {
    "arrow": "M0,0L-0.8,2H0.8Z",
    "triangle-up": "M0,-1L-1,1H1Z",
    "diamond": "M0,-1L1,0L0,1L-1,0Z",
    "star": f"M{_STAR}Z",
    "x": "M-1,-1L1,1M-1,1L1,-1",
    "circle-open": "M-1,0A1,1 0 1 1 1,0A1,1 0 1 1 -1,0",
}
"""Plotly's marks of half the size 1, y down: filled if closed, otherwise drawn as lines."""

_SWATCH_PX = (30, 14)
_BAR_SHARE = 0.3
_BAR_PX = 16


def map_svg(spec: Spec, width: int, label: str) -> str:
    """Return the figure of a map, with a scale bar, as an SVG element that a page can hold.

    `width` is that of the plot in px, for which the figure was laid out. The element takes the size
    of its place.
    """
    (west, east), (south, north) = (spec["layout"][axis]["range"] for axis in ("xaxis", "yaxis"))
    scale = min(width / (east - west), spec["layout"]["meta"]["inner_px"] / (north - south))

    def placed(x: float, y: float) -> _Place:
        return (x - west) * scale, (north - y) * scale

    wide, tall = placed(east, south)
    drawn = "\n".join(part for trace in _shown(spec) for part in _trace(trace, placed))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="map" role="img" '
        f'aria-label="{escape(label)}" viewBox="0 0 {wide:.1f} {tall + _BAR_PX:.1f}">\n'
        f"{drawn}\n{_scale_bar(east - west, scale, tall)}</svg>"
    )


def legend_entries(spec: Spec) -> list[tuple[str, str]]:
    """Return a swatch, as SVG, and the words of each trace in the legend, as HTML."""
    named = [one for one in _shown(spec) if one.get("name") and one.get("showlegend", True)]
    return [(_swatch(one), one["name"].replace("<br>", " ")) for one in named]


def _shown(spec: Spec) -> list[Spec]:
    return [one for one in spec["data"] if one.get("visible", True) is True]


def _swatch(trace: Spec) -> str:
    """A short line, or a mark, as the trace has it."""
    wide, tall = _SWATCH_PX
    lines = "lines" in trace["mode"]
    middle = 0.5 * tall
    line = [(0.0, 2.0), (wide, 2.0), (wide, tall - 2.0), (0.0, tall - 2.0)]
    if "fill" not in trace:
        line = [(0.0, middle), (wide, middle)]
    places = line if lines else [(0.5 * wide, middle)]
    sample = {**trace, **dict(zip("xy", zip(*places, strict=True), strict=True))}
    sample["mode"] = "lines" if lines else "markers"
    drawn = "".join(_trace(sample, lambda x, y: (x, y)))
    return f'<svg viewBox="0 0 {wide} {tall}" aria-hidden="true">{drawn}</svg>'


def _trace(trace: Spec, placed: Callable[[float, float], _Place]) -> Iterator[str]:
    """Yield the lines, then the marks, then the texts of a trace."""
    points = [
        None if x is None else placed(x, y) for x, y in zip(trace["x"], trace["y"], strict=True)
    ]
    if "lines" in trace["mode"]:
        runs: list[list[_Place]] = [[]]
        for point in points:
            if point is None:
                runs.append([])
            else:
                runs[-1].append(point)
        yield _path([run for run in runs if run], trace)
    for k, point in enumerate(points):
        if point is None:
            continue
        if "markers" in trace["mode"]:
            yield _mark(*point, {key: _each(one, k) for key, one in trace["marker"].items()})
        if "text" in trace["mode"]:
            yield _text(*point, trace, k)


def _each(value: Any, k: int) -> Any:
    return value[k] if isinstance(value, list) else value


def _path(runs: Sequence[Sequence[_Place]], trace: Spec) -> str:
    line, ends = trace["line"], "Z" if "fill" in trace else ""
    width = line.get("width", 2)
    dashes = " ".join(f"{max(width, 3) * one:g}" for one in _DASHES.get(line.get("dash"), ()))
    path = "".join(f"M{' '.join(f'{x:.1f},{y:.1f}' for x, y in run)}{ends}" for run in runs)
    dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
    return (
        f'<path d="{path}" fill="{trace.get("fillcolor", "none")}" stroke="{line["color"]}" '
        f'stroke-width="{width:g}"{dashed}/>'
    )


def _mark(x: float, y: float, marker: Spec) -> str:
    """A mark at a place, in Plotly's names: the tip of an arrow, or the middle of another shape."""
    size, color = marker["size"], marker["color"]
    outline = _OUTLINES.get(marker.get("symbol", ""))
    if not size or outline is None:
        return ""
    turned = f"translate({x:.1f} {y:.1f}) rotate({marker.get('angle', 0):g}) scale({0.5 * size:g})"
    filled = outline.endswith("Z")
    drawn = f'fill="{color}"' if filled else f'fill="none" stroke="{color}" stroke-width="0.4"'
    return f'<path d="{outline}" transform="{turned}" {drawn}/>'


def _text(x: float, y: float, trace: Spec, k: int) -> str:
    words = trace["text"][k]
    if not words:
        return ""
    up, _, side = _each(trace.get("textposition", "middle center"), k).partition(" ")
    size, off = (
        _each(trace["textfont"]["size"], k),
        _each(trace.get("marker", {}).get("size", 0), k),
    )
    y += {"top": -0.5 * off - 0.25 * size, "bottom": 0.5 * off + 0.85 * size}.get(up, 0.35 * size)
    x += {"left": -0.6 * off, "right": 0.6 * off}.get(side, 0.0)
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" fill="{trace["textfont"]["color"]}" '
        f'text-anchor="{_ANCHORS.get(side, "middle")}">{escape(unescape(words))}</text>'
    )


def _scale_bar(extent: float, scale: float, tall: float) -> str:
    """Bar of a round length below the map, with its length and the axes in words."""
    most = _BAR_SHARE * extent
    step = 10.0 ** math.floor(math.log10(most))
    length = max(one * step for one in (1, 2, 5) if one * step <= most)
    end, low = 6 + length * scale, tall + _BAR_PX - 5
    return (
        f'<path d="M6,{low - 5:.1f}V{low:.1f}H{end:.1f}V{low - 5:.1f}" fill="none" '
        f'stroke="{MUTED}" stroke-width="1.5"/>\n'
        f'<text x="{end + 6:.1f}" y="{low:.1f}" font-size="11" fill="{INK}">'
        f"{length:g} m; x east, y north</text>\n"
    )
