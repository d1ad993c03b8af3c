"""The ladder over teams: cells (vehicles, landmarks) searched alone, then on from smaller ones.

                2 landmarks    3 landmarks
    2 vehicles      o      ->      o           a vehicle or a landmark is added to the best
                    |              |           formation of each smaller cell
    3 vehicles      o      ->      o

A cell is searched on as soon as its smaller neighbours have been, with any number of processes at
once. Searches are numbered and begin with the results of certain others, so that neither the number
of processes nor an interruption changes a result.
"""

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from syncplan.designs.candidates import Cell
from syncplan.designs.cell_search import BestCandidate, search
from syncplan.runtime.machine import single_threaded_blas
from syncplan.runtime.task_crew import EarlierSearch, Work, run_orders
from syncplan.scenario.brief import Brief, Effort

EVALUATIONS: Mapping[Effort, int] = {"quick": 150, "normal": 1100, "thorough": 11_000}
"""Number of candidates looked at in a cell that has both smaller neighbours, by their weight."""

ROUNDS: Mapping[Effort, int] = {"quick": 1, "normal": 3, "thorough": 8}
"""Number of searches of each cell alone, which share half of its candidates."""


@dataclass(frozen=True, slots=True)
class DesignState:
    """State of a design under way.

    Attributes
    ----------
    doing : what is done at present, in words
    done, total : searches; those of purchases are added to the total where there are some
    front : the best candidate so far for each number of vehicles and landmarks
    """

    doing: str
    done: int
    total: int
    front: Sequence[BestCandidate]


DesignProgress = Callable[[DesignState], None]
"""Callback that receives each new state of a design."""


def cells_of(brief: Brief) -> list[Cell]:
    """Return the cells of a brief: all numbers of vehicles and of landmarks that may do."""
    keep = brief.purpose.keep
    first = max(brief.team.min, keep.count if keep else 1)
    # fewer landmarks cannot be observed, see impossibility
    needed = (1 if brief.heading_sigma_rad is not None else 2) + brief.need.losses
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
    evaluations : number of candidates, weighed by what they cost
    needs : numbers of the searches whose results it begins with
    starts : results that it begins with; without any, random formations
    """

    number: int
    brief: Brief
    cell: Cell
    evaluations: int
    needs: tuple[int, ...] = ()
    starts: tuple[BestCandidate, ...] = ()


def orders_of(brief: Brief) -> list[SearchOrder]:
    """Return the searches of all cells: each alone, then on from those and from smaller cells.

    Where a cell lacks a smaller neighbour, it is searched alone twice more in its stead.
    """
    cells, rounds, half = cells_of(brief), ROUNDS[brief.effort], EVALUATIONS[brief.effort] // 2
    alone: list[SearchOrder] = []
    onward: list[SearchOrder] = []
    numbers = {cell: number for number, cell in enumerate(cells)}
    for cell, number in numbers.items():
        fewer = Cell(cell.vehicles, cell.landmarks - 1), Cell(cell.vehicles - 1, cell.landmarks)
        smaller = [numbers[other] for other in fewer if other in numbers]
        first = len(cells) + len(alone)
        first_searches = range(first, first + rounds * (5 - 2 * len(smaller)))
        alone += [SearchOrder(k, brief, cell, half // rounds) for k in first_searches]
        onward.append(SearchOrder(number, brief, cell, half, (*first_searches, *smaller)))
    return alone + onward


def search_worker(seed: int) -> Work:
    """Return the function that carries out search orders."""

    @single_threaded_blas
    def work(
        order: SearchOrder, stop: threading.Event, _report: Callable[[Any], None]
    ) -> tuple[SearchOrder, BestCandidate, bool]:
        seeds = seed, order.number
        best = search(order.brief, order.cell, order.evaluations, seeds, order.starts, stop.is_set)
        return order, best, stop.is_set()

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
    cut_short : whether the time limit or Ctrl-C ended the searches
    """

    brief: Brief
    workers: int
    progress: DesignProgress
    earlier: EarlierSearch
    made: dict[int, BestCandidate] = field(default_factory=dict)
    cut_short: bool = False

    def __post_init__(self) -> None:
        self._orders = orders_of(self.brief)
        self.total = self.searches = len(self._orders)
        self._ends = time.monotonic() - self.earlier.spent_s + (self.brief.time_limit_s or math.inf)

    def search_all(self) -> list[BestCandidate]:
        """Search all cells and return the front."""
        self.carry_out(self._orders, "searching teams")
        return self.front()

    def front(self) -> list[BestCandidate]:
        """The best result of each cell, in either sense, in the order of the cells."""
        made = [self.made[number] for number in sorted(self.made) if number < self.searches]
        made.sort(key=lambda result: result.value, reverse=True)
        best = {(result.cell.vehicles, result.cell.landmarks): result for result in made}
        return [best[team] for team in sorted(best)]

    def report(self, doing: str) -> None:
        """Report the state of the design."""
        self.progress(DesignState(doing, len(self.made), self.total, self.front()))

    def carry_out(self, orders: Sequence[SearchOrder], doing: str) -> None:
        """Carry out orders, each once the results that it needs are there.

        Those whose results were kept are not repeated. The time limit and Ctrl-C leave some out.
        """
        given: set[int] = set()

        def ready() -> list[SearchOrder]:
            """Orders that can be carried out now and could not before."""
            now = []
            for order in orders:
                if order.number in given or not self.made.keys() >= {*order.needs}:
                    continue
                given.add(order.number)
                data = self.earlier.finished.get(order.number)
                kept = data and BestCandidate.of_bytes(data, order.cell)
                if kept:
                    self.made[order.number] = kept
                else:
                    starts = *order.starts, *(self.made[number] for number in order.needs)
                    now.append(replace(order, starts=starts))
            return now

        def take(result: tuple[SearchOrder, BestCandidate, bool]) -> list[SearchOrder]:
            order, best, stopped = result
            self.made[order.number] = best
            self.cut_short |= stopped
            if not stopped:
                self.earlier.keep(order.number, best.as_bytes())
            self.report(doing)
            return ready()

        waiting = ready()
        self.report(doing)
        run_orders(
            search_worker,
            self.brief.seed,
            waiting,
            self.workers,
            begin=lambda order, _busy: order,
            take=take,
            time_limit_s=self._ends - time.monotonic(),
        )
        self.cut_short |= any(order.number not in self.made for order in orders)
