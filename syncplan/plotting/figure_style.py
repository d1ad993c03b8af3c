"""Size, text scale, parts and colours of figures, on light and dark pages.

The colours are readable in print and by colour-blind people; the hues are those of Okabe and Ito,
"Color Universal Design" (2008), without black and yellow. Classes never differ in hue alone: they
also differ in dash, pattern or symbol, and are named. Text, axes and grids are drawn in the colours
of a light page; `themed` swaps them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

from syncplan.options import option, options_of

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
"""Colours of a light page, with their counterparts on a dark one."""


def themed(spec: dict[str, Any], theme: Theme) -> dict[str, Any]:
    """Return a figure's values in the colours of a theme; `spec` is not modified."""
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
        # lists of numbers hold no colours
        return [_swapped(one) for one in value] if _may_hold_colors(value) else value
    return DARK.get(value, value) if isinstance(value, str) else value


def _may_hold_colors(values: list[Any]) -> bool:
    return any(isinstance(one, str | dict | list) for one in values)


# --- size and theme -----------------------------------------------------------------------------


PAPER: Mapping[Theme, str] = MappingProxyType({"light": "#ffffff", "dark": "#16161a"})
"""Background of pages and images."""

PAGE_PX = 1000
"""Width for which figures are laid out by default."""

SHEET_PX = 700
"""Width of a figure on a printed sheet, or in a window of middle width."""

COLUMN_PX = 360
"""Width of a figure in a narrow window, or on a telephone."""

_NARROW_PX = 640
"""Width below which panels are stacked rather than side by side."""

_SIDES_PX = (70, 24)
_NARROW_SIDES_PX = (56, 12)


@dataclass(frozen=True, slots=True)
class FigureStyle:
    """Size, text, parts and colours of a figure; raises InputError naming a value not allowed."""

    width: int | None = option(
        None,
        "Width in px, for which texts, legend and panels are laid out; if not given, 1000 for an "
        "image and the reader's window for a page",
        ge=240,
        le=4000,
    )
    height: int | None = option(
        None,
        "Height of each figure in px; if not given, as much as the figure needs",
        ge=160,
        le=8000,
    )
    font_scale: float = option(1.0, "Size of all text, times the usual", ge=0.5, le=3)
    theme: Theme = option("light", "Background that it is shown on")
    pixel_ratio: float = option(2.0, "Dots of a PNG for each px", ge=1, le=6)
    title: bool = option(True, "Show the title")
    subtitle: bool = option(True, "Show the note below the title")
    legend: bool = option(True, "Show the legend")

    def __post_init__(self) -> None:
        for one in options_of(FigureStyle):
            one.check(getattr(self, one.name))

    @property
    def page_px(self) -> int:
        """Width in px for which the figure is laid out."""
        return self.width or PAGE_PX

    @property
    def narrow(self) -> bool:
        """Whether the figure is too narrow for panels side by side."""
        return self.page_px < _NARROW_PX * self.font_scale

    @property
    def sides_px(self) -> tuple[int, int]:
        """Room in px left of the plot, for an axis and its title, and right of it."""
        left, right = _NARROW_SIDES_PX if self.narrow else _SIDES_PX
        return round(left * (0.3 + 0.7 * self.font_scale)), right

    @property
    def plot_px(self) -> int:
        """Width in px of the plot, between the two sides."""
        return self.page_px - sum(self.sides_px)

    def px(self, length: float) -> int:
        """Return a length in px that text fills, scaled as the text is."""
        return round(length * self.font_scale)


PLAIN = FigureStyle()
"""Default style."""
