"""Colours of the figures: readable in print, by colour-blind people, on light and on dark.

The hues are those of Okabe and Ito, "Color Universal Design" (2008), without black and yellow.
Nothing rests on a hue alone: classes differ in dash, pattern or symbol too, and are named.
Text, axes and grids are drawn in the colours of a light page; `themed` swaps them.
"""

from collections.abc import Mapping
from typing import Any, Literal

Theme = Literal["light", "dark"]

BLUE = "#0072b2"
GREEN = "#009e73"
ORANGE = "#e69f00"
PURPLE = "#cc79a7"
SKY = "#56b4e9"
VERMILLION = "#d55e00"

INK = "#1b1b1f"
MUTED = "#5b5b66"
GRID = "#dcdce2"

DARK: Mapping[str, str] = {INK: "#ececf0", MUTED: "#b2b2bd", GRID: "#3b3b44", BLUE: "#4aa3df"}
"""Colours of a light page, and what they become on a dark one."""


def themed(spec: dict[str, Any], theme: Theme) -> dict[str, Any]:
    """Return a figure's values in the colours of a theme; `spec` itself is left as it is."""
    if theme == "light":
        return spec
    swapped: dict[str, Any] = _swapped(spec)
    return swapped


def translucent(color: str, opacity: float) -> str:
    """Return a colour #rrggbb as Plotly's rgba(...), `opacity` from 0 to 1."""
    red, green, blue = (int(color[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"


def _swapped(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _swapped(one) for key, one in value.items()}
    if isinstance(value, list):
        # long lists are numbers: the first value decides
        return [_swapped(one) for one in value] if _may_hold_colors(value) else value
    return DARK.get(value, value) if isinstance(value, str) else value


def _may_hold_colors(values: list[Any]) -> bool:
    return any(isinstance(one, str | dict | list) for one in values)
