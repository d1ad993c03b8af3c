"""The search for a batch solution: how it is tempered, what is credible, and further starts.

The variance R of sightings is 100 times too large at first, then 10 times, then true, which widens
the basin that leads to the least minimum. Where the fit is not credible, others begin at starts
drawn from the prior: the best stays. For N sightings the least cost is chi-square distributed with
about N degrees of freedom, so a fit is credible up to N + 6 sqrt(2 N). Of a recording the true R is
not known, and a wrong fit may cost no more than that: there the least cost counts once it has been
found twice.

`batch_solution` and the pilot's plain one, in `pilot`, search alike.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, Self, TypeVar

import numpy as np

from syncplan.arrays import Array, Flags, Index

TEMPERS = (100.0, 10.0, 1.0)
"""Factors on the variance of sightings, one after another."""

MOST_STEPS = (4, 4, 12)
"""Gauss-Newton steps at each of TEMPERS."""

CLOSE_ENOUGH = (1.0, 1.0, 0.01)
"""Gain in cost that a step promises, below which a lane goes on to the next of TEMPERS."""

MOST_HALVINGS = 6
"""Of a step that does not lower the cost."""

STARTS = (1, 2, 4)
"""Periods from sample 0 that batch solutions cover; the later ones where the start is in doubt."""

DOUBT = 0.1
"""Share of what a lost vehicle may be off that leaves a start in doubt, as one sigma."""

ROUNDS = (2, 8, 16)
"""Further starts, drawn where none before was credible."""

SAME = 1.0
"""Difference in cost within which all starts have found the same: there is nothing better."""

PLAUSIBLE = 4.0
"""Cost of a sighting up to which the first round is enough to say so.

Errors that the filter does not know explain such a cost. Wrong minima, in which many starts can
end, cost far more.
"""


@dataclass(slots=True)
class Tempering:
    """Which of some factors on the variance of sightings each lane has come to.

    Attributes
    ----------
    tempers, most, close : factors; at each, the most steps, and the promised gain that ends it
    level : (lanes,) place in `tempers`; its length where a lane is through
    steps : (lanes,) taken there
    """

    tempers: tuple[float, ...]
    most: tuple[int, ...]
    close: tuple[float, ...]
    level: Index
    steps: Index

    @classmethod
    def of(
        cls, width: int, tempers: tuple[float, ...], most: tuple[int, ...], close: tuple[float, ...]
    ) -> "Tempering":
        """Return so many lanes at the first factor."""
        none = np.zeros(width, dtype=np.int64)
        return cls(tempers, most, close, none, none.copy())

    @property
    def factors(self) -> Array:
        """(lanes,) the present factor; the last for lanes that are through."""
        return np.asarray(np.take((*self.tempers, self.tempers[-1]), self.level))

    def settled(self, promised: Array) -> Flags:
        """Return which lanes (lanes,) leave their factor: little is promised, or steps ran out."""
        little = promised < np.take((*self.close, np.inf), self.level)
        return np.asarray(little | (self.steps >= np.take((*self.most, 0), self.level)))

    def moving(self, settled: Flags) -> Flags:
        """Return which lanes take another step: all but those that leave their last factor."""
        return ~(settled & (self.level >= len(self.tempers) - 1))

    def advance(self, through: Flags) -> None:
        """Count a step, or go on to the next factor where a lane is `through` with this one."""
        self.steps = np.where(through, 0, self.steps + 1)
        self.level = np.where(through, np.minimum(self.level + 1, len(self.tempers)), self.level)


def is_credible(cost: Array, sightings: Index) -> Flags:
    """Return (lanes,) whether noise alone explains the cost (lanes,) of so many sightings."""
    return np.asarray(cost <= sightings + 6.0 * np.sqrt(2.0 * sightings))


class Solutions(Protocol):
    """Solutions of some lanes, with the cost (lanes,) of each."""

    cost: Array

    def take(self, other: Self, mine: Index, its: Index) -> None:
        """Take the other's solutions `its` in place of `mine`."""


AnySolutions = TypeVar("AnySolutions", bound=Solutions)


def search_further(
    best: AnySolutions,
    sightings: Index,
    tried: Callable[[Index, int], AnySolutions],
    *,
    noise_known: bool = True,
) -> None:
    """Put better solutions, from further starts, in place of those that are not credible.

    `sightings` (lanes,) are how many each explains. `tried`, of places in it and the number of a
    round, returns solutions from ROUNDS of that number of drawn starts for each place, in turn.
    Unless `noise_known`, no cost is credible, and the second round goes on to look for a better
    one even where it is small.
    """
    credible = is_credible(best.cost, sightings) & noise_known
    missing = np.flatnonzero(~credible)
    for number, starts in enumerate(ROUNDS):
        if not len(missing):
            break
        found = tried(missing, number)
        costs = np.where(np.isnan(found.cost), np.inf, found.cost).reshape(-1, starts)
        before = best.cost[missing]
        least = np.argmin(costs, axis=1)
        better = ~(before <= costs.min(axis=1))
        its = (np.arange(len(missing)) * starts + least)[better]
        best.take(found, missing[better], its)
        all_costs = np.column_stack([before, costs])
        least_found = all_costs < all_costs.min(axis=1, keepdims=True) + SAME
        settled = least_found.all(axis=1)
        if not number:
            settled &= best.cost[missing] < PLAUSIBLE * sightings[missing]
        if noise_known:
            settled |= is_credible(best.cost[missing], sightings[missing])
        elif number:
            settled |= least_found.sum(axis=1) > 1
        missing = missing[~settled]
