"""Cell search: the best phases of a few vehicles, globally, by branch and bound.

The first vehicle's time-phase is held; the others' fill a cube, which is cut into cells. In a cell
each difference stays within a window of its table, and the largest worth in that window bounds what
the pair can be worth there. Cells whose bound does not pass the best centre found are dropped, the
rest are halved along every axis (Land and Doig, Econometrica 28, 1960).
"""

from collections.abc import Callable

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.synchronisation.difference_tables import DifferenceTables

MOST_VEHICLES = 4
"""More are left to local search: the cells grow as a power of their number."""

_FIRST_CELLS = 16
_MOST_CELLS = 40_000
_GAIN = 1e-3
"""Relative gain for which a cell is still looked into."""


def smallest_worth(worth: Array) -> Array:
    """Return the smallest worth of any pair, (...) of (e, ...)."""
    return np.asarray(worth.min(axis=0, initial=np.inf))


def most_served(floor: float, ramp: float) -> Callable[[Array], Array]:
    """Return the merit that counts the links of a worth of `floor` or more.

    Links up to `ramp` below it count in part. Minus infinity where a pair is not clear.
    """

    def merit(worth: Array) -> Array:
        served = np.where(np.isposinf(worth), 0.0, np.clip((worth - floor) / ramp + 1.0, 0.0, 1.0))
        clear = np.all(worth > -np.inf, axis=0)
        return np.where(clear, served.sum(axis=0), -np.inf)

    return merit


def best_phases(
    tables: DifferenceTables, count: int, merit: Callable[[Array], Array] = smallest_worth
) -> tuple[Array, float]:
    """Return time-phases (count,) of the largest merit found, and that merit.

    `merit` takes the worth (e, ...) of all pairs and must not fall where one of them rises; by
    default it is the smallest worth. The search is global to a thousandth of the merit, as far as
    the tables resolve, unless more than 40,000 cells remain; then those of the highest bounds are
    followed. Minus infinity where no phases tried keep all pairs clear. The number of samples is a
    power of two.
    """
    worth = tables.worth
    samples = worth.shape[1]
    half = samples // (2 * _FIRST_CELLS)
    windows = _largest_within(worth, 2 * half)
    axis = half * (1 + 2 * np.arange(_FIRST_CELLS))
    cells = np.stack(np.meshgrid(*[axis] * (count - 1), indexing="ij"), axis=-1)
    cells = _with_first(cells.reshape(-1, count - 1))
    best, merit_found = cells[0], -np.inf
    both_move = (tables.a > 0) & (tables.b > 0)
    while len(cells):
        place = (cells[:, tables.a] - cells[:, tables.b]).T % samples
        value = merit(np.take_along_axis(worth, place, axis=1))
        k = int(np.argmax(value))
        if value[k] > merit_found:
            best, merit_found = cells[k], float(value[k])
        if half == 1:
            break
        width = np.where(both_move, 2 * half, half)
        bound = merit(
            np.stack([windows[w][e, p] for e, (w, p) in enumerate(zip(width, place, strict=True))])
        )
        promising = bound > merit_found + _GAIN * max(abs(merit_found), 1e-9)
        if not np.isfinite(merit_found):
            promising = bound > -np.inf
        cells = cells[promising]
        if len(cells) * 2 ** (count - 1) > _MOST_CELLS:
            order = np.argsort(-bound[promising], kind="stable")
            cells = cells[np.sort(order[: _MOST_CELLS // 2 ** (count - 1)])]
        half //= 2
        cells = _halved(cells, half, count)
    return best * (2.0 * np.pi / samples), merit_found


def _with_first(cells: Index) -> Index:
    return np.column_stack([np.zeros(len(cells), dtype=np.int64), cells])


def _halved(cells: Index, half: int, count: int) -> Index:
    """The centres of the parts of each cell."""
    signs = np.stack(np.meshgrid(*[[-half, half]] * (count - 1), indexing="ij"), axis=-1)
    parts = _with_first(signs.reshape(-1, count - 1))
    return np.asarray((cells[:, None] + parts).reshape(-1, count))


def _largest_within(worth: Array, widest: int) -> dict[int, Array]:
    """The largest worth (e, k) within w samples either way, for w = 1, 2, 4, ... `widest`."""
    found = np.maximum(worth, np.maximum(np.roll(worth, 1, axis=1), np.roll(worth, -1, axis=1)))
    windows, width = {1: found}, 1
    while width < widest:
        found = np.maximum(np.roll(found, width, axis=1), np.roll(found, -width, axis=1))
        width *= 2
        windows[width] = found
    return windows
