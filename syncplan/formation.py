"""Shapes of formations: where the centres of `count` circles lie, in metres.

Hexagonal rows, counted from zero, the odd ones shifted by half a spacing:

    row 1      o   o   o        rows are spacing * sqrt(3) / 2 apart
    row 0    o   o   o
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["SHAPES", "shape_centers"]

Centers = NDArray[np.float64]


def _line(count: int, spacing: float, columns: int) -> Centers:
    return np.column_stack([spacing * np.arange(count), np.zeros(count)])


def _grid(count: int, spacing: float, columns: int) -> Centers:
    row, column = np.divmod(np.arange(count), columns)
    return spacing * np.column_stack([column, row]).astype(float)


def _hexagonal(count: int, spacing: float, columns: int) -> Centers:
    row, column = np.divmod(np.arange(count), columns)
    return spacing * np.column_stack([column + 0.5 * (row % 2), row * math.sqrt(3.0) / 2.0])


def _ring(count: int, spacing: float, columns: int) -> Centers:
    if count == 1:
        return np.zeros((1, 2))
    angle = 2.0 * math.pi * np.arange(count) / count
    circumradius = spacing / (2.0 * math.sin(math.pi / count))
    return circumradius * np.column_stack([np.cos(angle), np.sin(angle)])


SHAPES: dict[str, Callable[[int, float, int], Centers]] = {
    "line": _line,
    "grid": _grid,
    "hex": _hexagonal,
    "ring": _ring,
}


def shape_centers(shape: str, count: int, spacing: float, columns: int | None = None) -> Centers:
    """Return the (count, 2) centres of a named shape, neighbours `spacing` metres apart.

    `columns` is the width of grid and hex rows; without it the shape is made nearly square.
    A ring's spacing is the chord between neighbours.
    """
    width = columns if columns is not None else math.ceil(math.sqrt(count))
    return SHAPES[shape](count, spacing, width)
