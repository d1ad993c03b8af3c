"""Search for a batch solution: tempering, credibility and further starts.

The variance R of sightings is 100 times too large at first, then 10 times, then true, which widens
the basin of the global minimum. If the fit is not credible, others begin at starts drawn from the
prior, and the best stays. For N sightings the least cost is chi-square distributed with about N
degrees of freedom, so a fit is credible up to N + 6 sqrt(2 N). For a recording the true R is
unknown, and a wrong fit may cost no more than that: there the least cost counts once it has been
found twice.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, Self, TypeVar

import numpy as np

from syncplan.arrays import Array, Flags, Index

TEMPERS = (100.0, 10.0, 1.0)
"""Factors on the variance of sightings, in the order applied."""

MOST_STEPS = (4, 4, 12)
"""Largest number of Gauss-Newton steps at each of TEMPERS."""

CLOSE_ENOUGH = (1.0, 1.0, 0.01)
"""Predicted decrease of the cost below which a lane goes on to the next of TEMPERS."""

MOST_HALVINGS = 6
"""Largest number of halvings of a step that does not lower the cost."""

STARTS = (1, 2, 4)
"""Periods from sample 0 that batch solutions cover; the later ones if the start is in doubt."""

DOUBT = 0.1
"""Position sigma that leaves a start in doubt, as a share of that of a lost vehicle."""

ROUNDS = (2, 8, 16)
"""Number of further starts in each round, drawn if none before was credible."""

SAME = 1.0
"""Difference in cost within which starts count as having found the same minimum."""

PLAUSIBLE = 4.0
"""Cost of a sighting up to which agreement in the first round ends the search.

Errors that the filter does not model explain such a cost. Wrong minima, in which many starts can
end, cost far more.
"""


@dataclass(slots=True)
class Tempering:
    """Progress of lanes through factors on the variance of sightings.

    Attributes
    ----------
    tempers, most, close : factors; for each, most steps and the predicted decrease that ends it
    level : (lanes,) index in `tempers`; its length once a lane is done
    steps : (lanes,) number taken at this level
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
        """Return `width` lanes at the first factor."""
        none = np.zeros(width, dtype=np.int64)
        return cls(tempers, most, close, none, none.copy())

    @property
    def factors(self) -> Array:
        """Present factor (lanes,); the last one for lanes that are done."""
        return np.asarray(np.take((*self.tempers, self.tempers[-1]), self.level))

    def settled(self, promised: Array) -> Flags:
        """Return the lanes whose factor ends: `promised` (lanes,) is small, or steps ran out."""
        little = promised < np.take((*self.close, np.inf), self.level)
        return np.asarray(little | (self.steps >= np.take((*self.most, 0), self.level)))

    def moving(self, settled: Flags) -> Flags:
        """Return the lanes that take another step: all but those whose last factor ends."""
        return ~(settled & (self.level >= len(self.tempers) - 1))

    def advance(self, through: Flags) -> None:
        """Count a step, or go on to the next factor in lanes that are `through` with this one."""
        self.steps = np.where(through, 0, self.steps + 1)
        self.level = np.where(through, np.minimum(self.level + 1, len(self.tempers)), self.level)


def is_credible(cost: Array, sightings: Index) -> Flags:
    """Return (lanes,) whether noise alone explains the cost (lanes,) of so many sightings."""
    return np.asarray(cost <= sightings + 6.0 * np.sqrt(2.0 * sightings))


class Solutions(Protocol):
    """Solutions of some lanes, with the cost (lanes,) of each."""

    cost: Array

    def take(self, other: Self, mine: Index, its: Index) -> None:
        """Replace solutions `mine` by the other's solutions `its`."""


AnySolutions = TypeVar("AnySolutions", bound=Solutions)


def search_further(
    best: AnySolutions,
    sightings: Index,
    tried: Callable[[Index, int], AnySolutions],
    *,
    noise_known: bool = True,
) -> None:
    """Replace solutions that are not credible by better ones from further starts.

    `sightings` (lanes,) is the number that each solution explains. `tried` takes indices of lanes
    and the number of a round; for each lane in turn it returns solutions from as many drawn starts
    as ROUNDS has for that round. Unless `noise_known`, no cost is credible, however small: the
    search goes on until starts agree.
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
