"""Shapes of formations: where the centres of `count` circles lie, in metres.

Hexagonal rows, counted from zero, the odd ones shifted by half a spacing:

    row 1      o   o   o        rows are spacing * sqrt(3) / 2 apart
    row 0    o   o   o
"""

import math
from collections.abc import Callable

import numpy as np

from syncplan.arrays import Array, Index

__all__ = ["SHAPES", "gap_centers", "neighbours", "shape_centers"]


def _line(count: int, spacing: float, columns: int) -> Array:
    return np.column_stack([spacing * np.arange(count), np.zeros(count)])


def _grid(count: int, spacing: float, columns: int) -> Array:
    row, column = np.divmod(np.arange(count), columns)
    return spacing * np.column_stack([column, row]).astype(float)


def _hexagonal(count: int, spacing: float, columns: int) -> Array:
    row, column = np.divmod(np.arange(count), columns)
    return spacing * np.column_stack([column + 0.5 * (row % 2), row * math.sqrt(3.0) / 2.0])


def _ring(count: int, spacing: float, columns: int) -> Array:
    if count == 1:
        return np.zeros((1, 2))
    angle = 2.0 * math.pi * np.arange(count) / count
    circumradius = spacing / (2.0 * math.sin(math.pi / count))
    return circumradius * np.column_stack([np.cos(angle), np.sin(angle)])


SHAPES: dict[str, Callable[[int, float, int], Array]] = {
    "line": _line,
    "grid": _grid,
    "hex": _hexagonal,
    "ring": _ring,
}


def shape_centers(shape: str, count: int, spacing: float, columns: int | None = None) -> Array:
    """Return the (count, 2) centres of a named shape, neighbours `spacing` metres apart.

    `columns` is the width of grid and hex rows; without it the shape is made nearly square.
    A ring's spacing is the chord between neighbours.
    """
    return SHAPES[shape](count, spacing, _width(count, columns))


def gap_centers(shape: str, radii: Array, gap: float, columns: int | None = None) -> Array | None:
    """Return the (n, 2) centres of a shape whose neighbouring circles lie `gap` metres apart.

    In closed form for equal radii (n,), and for lines and rings of any; None for others. An
    unequal ring is the polygon with sides R_k + R_(k+1) + gap inscribed in a circle.
    """
    if len(radii) == 1 or np.ptp(radii) == 0.0:
        return shape_centers(shape, len(radii), 2.0 * float(radii[0]) + gap, columns)
    sides = radii + np.roll(radii, -1) + gap
    if shape == "line":
        along = np.concatenate([[0.0], np.cumsum(sides[:-1])])
        return np.asarray(np.column_stack([along, np.zeros(len(radii))]))
    return _inscribed(sides) if shape == "ring" else None


def neighbours(shape: str, count: int, columns: int | None = None) -> Index:
    """Return the (e, 2) pairs a < b of a shape that lie one spacing apart."""
    if shape == "line":
        return np.column_stack([np.arange(count - 1), np.arange(1, count)])
    if shape == "ring":
        closing = [[0, count - 1]] if count > 2 else []
        pairs = [*([k, k + 1] for k in range(count - 1)), *closing]
        return np.array(pairs, dtype=np.int64).reshape(-1, 2)
    width = _width(count, columns)
    row, column = np.divmod(np.arange(count), width)
    # The next in the row; the one above; in hex rows also the one above left or right.
    right = np.flatnonzero(column < width - 1)
    steps = [(right, right + 1), (np.arange(count), np.arange(count) + width)]
    if shape == "hex":
        odd = row % 2 == 1
        leftward = np.flatnonzero(~odd & (column > 0))
        rightward = np.flatnonzero(odd & (column < width - 1))
        steps += [(leftward, leftward + width - 1), (rightward, rightward + width + 1)]
    every = np.concatenate([np.column_stack(step) for step in steps])
    return np.array(np.unique(every[every[:, 1] < count], axis=0), dtype=np.int64)


def _width(count: int, columns: int | None) -> int:
    return columns if columns is not None else math.ceil(math.sqrt(count))


def _inscribed(sides: Array) -> Array:
    """Corners (n, 2) m, counter-clockwise from +x, of the polygon with these sides in a circle.

    With k the longest side over the diameter, a side s takes half its arc asin(k s / longest).
    They add up to pi if the centre lies inside. If they do not even at k = 1, it lies beyond the
    longest side, whose arc is then what the others take together.
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
