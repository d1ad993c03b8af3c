"""How large a figure is, how large its text, and what it is to be shown on."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, get_args

from syncplan.errors import InputError
from syncplan.plotting.palette import Theme

THEMES: tuple[Theme, ...] = get_args(Theme)
"""What figures can be shown on."""

PAPER: Mapping[Theme, str] = MappingProxyType({"light": "#ffffff", "dark": "#16161a"})
"""The background of pages and images."""

PAGE_PX = 1000
"""Width for which figures are laid out where none is given."""

COLUMN_PX = 400
"""Width of a column of a page, or of a telephone."""

_NARROW_PX = 640
"""Below this, panels stand under each other rather than side by side."""

_SIDES_PX = (70, 24)
_NARROW_SIDES_PX = (56, 12)

LIMITS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "width": (240, 4000),
        "height": (160, 8000),
        "font_scale": (0.5, 3.0),
        "pixel_ratio": (1.0, 6.0),
    }
)
"""The least and the largest of what can be chosen."""


@dataclass(frozen=True, slots=True)
class FigureStyle:
    """Size, text and colours of a figure; values outside LIMITS raise InputError.

    Attributes
    ----------
    width : px; without it a figure is as wide as its page, laid out for PAGE_PX
    height : px of the whole figure; without it, what the figure wants
    font_scale : of all text, times its usual size
    theme : "light" or "dark", what it is to be shown on
    pixel_ratio : dots of a PNG for each px
    """

    width: int | None = None
    height: int | None = None
    font_scale: float = 1.0
    theme: Theme = "light"
    pixel_ratio: float = 2.0

    def __post_init__(self) -> None:
        for key, (least, most) in LIMITS.items():
            value: Any = getattr(self, key)
            if value is not None and not (math.isfinite(value) and least <= value <= most):
                raise InputError(f"{value:g}: choose from {least:g} to {most:g}", key=key)
        if self.theme not in THEMES:
            raise InputError(f"{self.theme!r}: choose from {', '.join(THEMES)}", key="theme")

    @property
    def page_px(self) -> int:
        """The width in px that the figure is laid out for."""
        return self.width or PAGE_PX

    @property
    def narrow(self) -> bool:
        """Whether panels find no room side by side."""
        return self.page_px < _NARROW_PX * self.font_scale

    @property
    def sides_px(self) -> tuple[int, int]:
        """Room left of the plot, for an axis and its title, and right of it."""
        left, right = _NARROW_SIDES_PX if self.narrow else _SIDES_PX
        return round(left * (0.3 + 0.7 * self.font_scale)), right

    @property
    def plot_px(self) -> int:
        """The width in px between the two sides."""
        return self.page_px - sum(self.sides_px)

    def px(self, length: float) -> int:
        """Return a length that text fills, in px, at this scale of text."""
        return round(length * self.font_scale)


PLAIN = FigureStyle()
"""What a figure looks like where nothing is chosen."""
