"""The ladder over teams: cells (vehicles, landmarks) searched alone, then on from their neighbours.

Searches are numbered and begin with the results of earlier ones only, so that neither the number of
processes nor an interruption changes a result.
"""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from syncplan.arrays import Array
from syncplan.designs.candidates import Cell, Space
from syncplan.designs.cell_search import Found, search
from syncplan.runtime.machine import single_threaded_blas
from syncplan.runtime.task_crew import EarlierSearch, Work, run_orders
from syncplan.scenario.brief import Brief, Effort

EVALUATIONS: Mapping[Effort, int] = {"quick": 800, "normal": 6000, "thorough": 60_000}
"""Number of candidates looked at in each cell."""

SEARCHES_OF_CELL = 3
"""Searches of a cell: with equal senses, with alternate ones, and on from the best."""


@dataclass(frozen=True, slots=True)
class FrontCell:
    """What a search found for so many vehicles and landmarks.

    Attributes
    ----------
    cell : numbers of vehicles and landmarks
    found : its best candidate, with the error on the coarse grid
    cost : of the team, in the unit of the brief's costs
    """

    cell: Cell
    found: Found
    cost: float


@dataclass(frozen=True, slots=True)
class DesignState:
    """State of a design under way.

    Attributes
    ----------
    doing : what is done at present, in words
    done, total : searches; those of purchases are added to the total where there are some
    front : what was found so far for each number of vehicles and landmarks
    """

    doing: str
    done: int
    total: int
    front: Sequence[FrontCell]


DesignProgress = Callable[[DesignState], None]
"""Callback that receives each new state of a design."""


def cells_of(brief: Brief) -> list[Cell]:
    """Return the cells of a brief: all numbers of vehicles and of landmarks that may do."""
    keep = brief.purpose.keep
    first = max(brief.team.min, keep.count if keep else 1)
    # fewer landmarks cannot be observed, see impossibility
    needed = 1 if brief.heading_sigma_rad is not None else 2
    return [
        Cell(count, sites)
        for count in range(first, brief.team.max + 1)
        for sites in range(max(brief.landmarks.least, needed), brief.landmarks.most + 1)
    ]


@dataclass(frozen=True, slots=True)
class SearchOrder:
    """A search to be made.

    Attributes
    ----------
    number : unique in a design; a search of the same number has the same result
    brief : that of the design, or one with a change
    cell : searched cell
    evaluations : number of candidates
    start : cell and point that are known, to begin at; None for a random point
    """

    number: int
    brief: Brief
    cell: Cell
    evaluations: int
    start: tuple[Cell, Array] | None = None


def search_worker(seed: int) -> Work:
    """Return the function that carries out search orders."""

    @single_threaded_blas
    def work(
        order: SearchOrder, stop: threading.Event, _report: Callable[[Any], None]
    ) -> tuple[SearchOrder, Found, bool]:
        cell = order.cell
        space = Space(order.brief, cell)
        known, point = order.start or (cell, None)
        if point is not None and known != cell:
            point = space.extended(point, known, seed)
        own = (seed, cell.vehicles, cell.landmarks, int(cell.alternate), point is None)
        found = search(space, order.evaluations, own, point, stop.is_set)
        return order, found, stop.is_set()

    return work


@dataclass
class Ladder:
    """The searches of a design, and what they found.

    Attributes
    ----------
    brief, workers, progress, earlier : as in syncplan.design
    made : results by the number of their search
    searches : number of searches of the cells; those of purchases have numbers from it on
    total : number of all searches
    """

    brief: Brief
    workers: int
    progress: DesignProgress
    earlier: EarlierSearch
    made: dict[int, tuple[Cell, Found]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.cells = cells_of(self.brief)
        self.budget = EVALUATIONS[self.brief.effort]
        self.total = self.searches = SEARCHES_OF_CELL * len(self.cells)

    def search_all(self) -> list[FrontCell]:
        """Search all cells and return the front."""
        budget, cells = self.budget, self.cells
        both = [replace(cell, alternate=alternate) for cell in cells for alternate in (False, True)]
        self.carry_out(
            [SearchOrder(k, self.brief, cell, budget // 4) for k, cell in enumerate(both)],
            "searching each team",
        )
        alone = dict(self.made.values())
        orders = [
            self._onward(len(both) + k, cell, alone, budget // 2) for k, cell in enumerate(cells)
        ]
        self.carry_out(
            [one for one in orders if one is not None], "searching on from the neighbours"
        )
        return self.front()

    def front(self) -> list[FrontCell]:
        """The best result of each cell, in either sense, in the order of the cells."""
        best: dict[tuple[int, int], tuple[Cell, Found]] = {}
        for number in sorted(number for number in self.made if number < self.searches):
            cell, found = self.made[number]
            known = best.get((cell.vehicles, cell.landmarks))
            if known is None or found.value < known[1].value:
                best[cell.vehicles, cell.landmarks] = cell, found
        return [FrontCell(*best[key], self.cost(best[key][0])) for key in sorted(best)]

    def cost(self, cell: Cell) -> float:
        """Cost of a team, without its sensors, by the brief's costs."""
        return (
            cell.vehicles * self.brief.prefer.vehicle + cell.landmarks * self.brief.prefer.landmark
        )

    def report(self, doing: str) -> None:
        """Report the state of the design."""
        self.progress(DesignState(doing, len(self.made), self.total, self.front()))

    def carry_out(self, orders: list[SearchOrder], doing: str) -> None:
        """Carry out orders, but for those whose results were kept; Ctrl-C leaves some out."""
        kept = self.earlier.finished
        for one in orders:
            if one.number in kept:
                self.made[one.number] = one.cell, Found.of_bytes(kept[one.number])

        def take(result: tuple[SearchOrder, Found, bool]) -> None:
            order, found, stopped = result
            self.made[order.number] = order.cell, found
            if not stopped:
                self.earlier.keep(order.number, found.as_bytes())
            self.report(doing)

        self.report(doing)
        run_orders(
            search_worker,
            self.brief.seed,
            [one for one in orders if one.number not in kept],
            self.workers,
            begin=lambda order, _busy: order,
            take=take,
        )

    @property
    def evaluations(self) -> int:
        """Number of candidates looked at."""
        return sum(found.evaluations for _, found in self.made.values())

    def _onward(
        self, number: int, cell: Cell, alone: Mapping[Cell, Found], evaluations: int
    ) -> SearchOrder | None:
        """The search of a cell from the best of its own and its neighbours' results."""
        best: tuple[Found, Cell] | None = None
        for fewer in (
            cell,
            replace(cell, landmarks=cell.landmarks - 1),
            replace(cell, vehicles=cell.vehicles - 1),
        ):
            for alternate in (False, True):
                other = replace(fewer, alternate=alternate)
                known = alone.get(other)
                if known is not None and (best is None or known.value < best[0].value):
                    best = known, other
        if best is None:
            return None
        found, other = best
        own = replace(cell, alternate=other.alternate)
        return SearchOrder(number, self.brief, own, evaluations, (other, found.point))
