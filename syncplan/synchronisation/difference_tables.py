"""Difference tables: what pairs of vehicles are worth at every difference of their time-phases.

A pair is worth its share of contact or its margin. "Every pair worth at least t, and clear of every
other" is an interval of differences around the current one: a system of difference constraints. So
bisection finds the largest t, globally for the turns round the cycles that the start has.
"""

from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.circles import wrap
from syncplan.synchronisation.difference_constraints import central_solution

_TURN = 2.0 * np.pi
_BISECTIONS = 14


@dataclass(frozen=True, slots=True)
class DifferenceTables:
    """Pairs of vehicles over the difference theta_a - theta_b of their time-phases.

    Attributes
    ----------
    a, b : (e,) vehicles
    value : (e, k) worth, at differences 2 pi j / k; infinite for pairs that are only kept apart
    clearance : (e, k) m, by which the pair keeps its separation; infinite where it need keep none
    """

    a: Index
    b: Index
    value: Array
    clearance: Array

    def __len__(self) -> int:
        return len(self.a)

    @property
    def links(self) -> Flags:
        """(e,) which pairs are to be served, not only kept apart."""
        return np.asarray(np.isfinite(self.value[:, 0]))

    @property
    def edges(self) -> list[tuple[int, int]]:
        """The (a, b) pairs."""
        return list(zip(self.a.tolist(), self.b.tolist(), strict=True))

    @property
    def worth(self) -> Array:
        """(e, k) the value where the pair is clear; minus infinity elsewhere."""
        return np.where(self.clearance >= 0.0, self.value, -np.inf)

    def only(self, rows: Index) -> "DifferenceTables":
        """Return the tables of the chosen pairs, their vehicles numbered from 0 in order."""
        _, place = np.unique(np.concatenate([self.a[rows], self.b[rows]]), return_inverse=True)
        a, b = place.reshape(2, -1)
        return DifferenceTables(a, b, self.value[rows], self.clearance[rows])

    def without_clearance(self) -> "DifferenceTables":
        """Return the same tables with nothing to be kept apart."""
        return replace(self, clearance=np.full_like(self.clearance, np.inf))

    def at(self, theta: Array) -> Array:
        """Return the worth (..., e) at the samples nearest to time-phases (..., n) rad."""
        samples = self.value.shape[1]
        difference = theta[..., self.a] - theta[..., self.b]
        place = np.rint(difference * (samples / _TURN)).astype(np.int64) % samples
        return np.asarray(self.worth[np.arange(len(self)), place])

    def central(self, levels: Array, start: Array) -> Array | None:
        """Return central time-phases with the turns of `start` (n,) and every worth at its level.

        `levels` are (e,); those of pairs that are only kept apart do not matter. None if there
        are no such phases.
        """
        intervals = self._intervals(levels, start)
        return None if intervals is None else central_solution((self.a, self.b), *intervals, start)

    def highest(
        self, start: Array, free: Flags | None = None, levels: Array | None = None
    ) -> tuple[Array, float] | None:
        """Return (theta, t): the largest t that every free pair's worth reaches.

        The others keep their `levels` (e,); without `free`, all links are free. None if not even
        the start's worth is reached with its turns.
        """
        free = self.links if free is None else free
        fixed = np.full(len(self), -np.inf) if levels is None else levels
        low = float(np.min(self.at(start)[free], initial=np.inf))
        high = float(np.min(self.worth[free].max(axis=1), initial=np.inf))
        theta = self.central(np.where(free, low, fixed), start)
        if theta is None or not np.isfinite(high):
            return None if theta is None else (theta, high)
        top = self.central(np.where(free, high, fixed), start)
        if top is not None:
            return top, high
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            trial = self.central(np.where(free, middle, fixed), start)
            if trial is None:
                high = middle
            else:
                low, theta = middle, trial
        return theta, low

    def _intervals(self, levels: Array, start: Array) -> tuple[Array, Array] | None:
        """Low and high (e,) rad of the differences allowed around the start's."""
        samples = self.value.shape[1]
        levels = np.where(self.links, levels, 0.0)
        lack = np.maximum(levels[:, None] - self.value, -self.clearance)
        difference = start[self.a] - start[self.b]
        here = np.rint(difference * (samples / _TURN)).astype(np.int64)
        # from the nearest allowed sample both ways round the turn
        column = np.arange(samples)
        rows = np.arange(len(self))[:, None]
        ahead = lack[rows, (here[:, None] + column) % samples]
        away = np.where(ahead <= 0.0, np.minimum(column, samples - column), samples)
        near = np.argmin(away, axis=1)
        if np.any(away[rows[:, 0], near] == samples):
            return None
        up = lack[rows, (here[:, None] + near[:, None] + column) % samples]
        down = up[:, (-column) % samples]
        offset = wrap((here + near) * (_TURN / samples) - difference)
        middle = difference + offset
        return middle - _extent(down), middle + _extent(up)


def _extent(lack: Array) -> Array:
    """(e,) rad from the first sample, which lacks nothing, to where the lack begins; pi at most."""
    rows, samples = lack.shape
    outside = np.argmax(lack > 0.0, axis=1)
    row = np.arange(rows)
    beyond, within = lack[row, outside], lack[row, outside - 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.nan_to_num(within / (within - beyond), nan=0.0)
    reached = (outside - 1 + np.clip(share, 0.0, 1.0)) * (_TURN / samples)
    return np.where(outside == 0, np.pi, np.minimum(reached, np.pi))
