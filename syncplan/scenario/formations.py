"""The table of formation shapes, and the centres of `count` circles in m.

Hexagonal rows, counted from zero, the odd ones shifted by half a spacing:

    row 1      o   o   o        rows are spacing * sqrt(3) / 2 apart
    row 0    o   o   o
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

import numpy as np

from syncplan.arrays import Array, Index, as_pairs

# --- a shape --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Shape:
    """A named shape of formations.

    Attributes
    ----------
    name : name in scenarios
    sentence : the shape, and its neighbours, which lie a spacing or a gap apart
    regular : function from (count, spacing in m, width of a row) to (count, 2) centres in m
    adjacent : function from (count, width of a row) to the (e, 2) neighbours a < b
    fitted : function from the (n,) distances of neighbouring centres in m, the last between the
        last and the first, to (n, 2) centres in m; None where there is no closed form
    """

    name: str
    sentence: str
    regular: Callable[[int, float, int], Array]
    adjacent: Callable[[int, int], Index]
    fitted: Callable[[Array], Array] | None = None

    def centers(self, count: int, spacing: float, columns: int | None = None) -> Array:
        """Return the (count, 2) centres in m, neighbours `spacing` m apart.

        `columns` is the width of rows; without it the shape is nearly square.
        """
        return self.regular(count, spacing, _width(count, columns))

    def neighbours(self, count: int, columns: int | None = None) -> Index:
        """Return the (e, 2) pairs a < b that lie one spacing, or gap, apart."""
        return self.adjacent(count, _width(count, columns))

    def gap_centers(self, radii: Array, gap: float, columns: int | None = None) -> Array | None:
        """Return the (n, 2) centres in m whose neighbouring circles lie `gap` m apart.

        Closed form for equal (n,) radii in m, in some shapes for any radii; None otherwise.
        """
        if len(radii) == 1 or np.ptp(radii) == 0.0:
            return self.centers(len(radii), 2.0 * float(radii[0]) + gap, columns)
        return None if self.fitted is None else self.fitted(radii + np.roll(radii, -1) + gap)


def _width(count: int, columns: int | None) -> int:
    return columns if columns is not None else math.ceil(math.sqrt(count))


# --- line -----------------------------------------------------------------------------------------


def _line(count: int, spacing: float, width: int) -> Array:
    return np.column_stack([spacing * np.arange(count), np.zeros(count)])


def _line_neighbours(count: int, width: int) -> Index:
    return np.column_stack([np.arange(count - 1), np.arange(1, count)])


def _fitted_line(sides: Array) -> Array:
    along = np.concatenate([[0.0], np.cumsum(sides[:-1])])
    return np.asarray(np.column_stack([along, np.zeros(len(sides))]))


LINE = Shape(
    "line",
    "a row along x; neighbours follow each other",
    _line,
    _line_neighbours,
    _fitted_line,
)


# --- rows -----------------------------------------------------------------------------------------


def _grid(count: int, spacing: float, width: int) -> Array:
    row, column = np.divmod(np.arange(count), width)
    return spacing * np.column_stack([column, row]).astype(float)


def _grid_neighbours(count: int, width: int) -> Index:
    return _pairs_within(count, _steps_of_rows(count, width))


def _hexagonal(count: int, spacing: float, width: int) -> Array:
    row, column = np.divmod(np.arange(count), width)
    return spacing * np.column_stack([column + 0.5 * (row % 2), row * math.sqrt(3.0) / 2.0])


def _hexagonal_neighbours(count: int, width: int) -> Index:
    row, column = np.divmod(np.arange(count), width)
    leftward = np.flatnonzero((row % 2 == 0) & (column > 0))
    rightward = np.flatnonzero((row % 2 == 1) & (column < width - 1))
    steps = [(leftward, leftward + width - 1), (rightward, rightward + width + 1)]
    return _pairs_within(count, _steps_of_rows(count, width) + steps)


def _steps_of_rows(count: int, width: int) -> list[tuple[Index, Index]]:
    """Pairs of each circle with the next in its row, and with the one above it."""
    every = np.arange(count)
    right = np.flatnonzero(every % width < width - 1)
    return [(right, right + 1), (every, every + width)]


def _pairs_within(count: int, steps: list[tuple[Index, Index]]) -> Index:
    every = np.concatenate([np.column_stack(step) for step in steps])
    return np.array(np.unique(every[every[:, 1] < count], axis=0), dtype=np.int64)


GRID = Shape(
    "grid",
    "rows of `columns`, one above the other; neighbours lie beside or above a circle",
    _grid,
    _grid_neighbours,
)

HEX = Shape(
    "hex",
    "rows of `columns`, every other one shifted by half a spacing; up to six neighbours surround "
    "a circle",
    _hexagonal,
    _hexagonal_neighbours,
)


# --- ring -----------------------------------------------------------------------------------------


def _ring(count: int, spacing: float, width: int) -> Array:
    if count == 1:
        return np.zeros((1, 2))
    angle = 2.0 * math.pi * np.arange(count) / count
    circumradius = spacing / (2.0 * math.sin(math.pi / count))
    return circumradius * np.column_stack([np.cos(angle), np.sin(angle)])


def _ring_neighbours(count: int, width: int) -> Index:
    closing = [(0, count - 1)] if count > 2 else []
    return as_pairs([*((k, k + 1) for k in range(count - 1)), *closing])


def _inscribed(sides: Array) -> Array:
    """(n, 2) corners in m, counter-clockwise from +x, of the cyclic polygon with these sides.

    With k the longest side over the diameter, half the arc of a side s is asin(k s / longest).
    These half arcs add up to pi if the centre lies inside. If their sum is below pi even at k = 1,
    the centre lies beyond the longest side, whose arc is then the sum of the others.
    """
    from scipy.optimize import brentq

    if len(sides) == 2:
        return np.array([[0.5 * sides[0], 0.0], [-0.5 * sides[0], 0.0]])
    longest = int(np.argmax(sides))
    share = sides / sides[longest]
    others = np.delete(share, longest)

    def excess(k: float) -> float:
        arc = float(np.sum(np.arcsin(k * others)))
        return arc + math.asin(k) - math.pi if inside else arc - math.asin(k)

    inside = True
    inside = excess(1.0) >= 0.0
    low = 0.5
    while (excess(low) < 0.0) is not inside:
        low *= 0.5
    k = brentq(excess, low, 1.0, xtol=1e-16, rtol=1e-15)
    half = np.arcsin(k * share)
    half[longest] = math.pi - (np.sum(half) - half[longest])
    angle = 2.0 * np.concatenate([[0.0], np.cumsum(half[:-1])])
    circumradius = float(sides[longest]) / (2.0 * k)
    return np.asarray(circumradius * np.column_stack([np.cos(angle), np.sin(angle)]))


RING = Shape(
    "ring",
    "corners of a polygon inscribed in a circle; neighbours share a side",
    _ring,
    _ring_neighbours,
    _inscribed,
)

SHAPES: Mapping[str, Shape] = MappingProxyType({one.name: one for one in (LINE, GRID, HEX, RING)})
"""The shapes by name."""

if TYPE_CHECKING:
    ShapeName = str
else:
    ShapeName = Literal[tuple(SHAPES)]
