"""The best formation of so many vehicles and landmarks: random formations, then small steps.

A step moves a vehicle, a landmark or the whole formation. If it does not lower the worst error, the
opposite step is tried; where one helps, longer ones follow in its direction. Only whether a
formation beats the best matters, so one that cannot is left after its first figures: the error
without losses, or after the loss that decided before.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array
from syncplan.designs.candidates import UNFIT, Cell, Space
from syncplan.scenario.brief import Brief

AT_RANDOM = 0.25
"""Share of a search that looks at random formations, where it begins with none."""

GROWTH = 1.5
"""Ratio of a step to the one before it that helped."""

LONGEST = 8
"""Multiple of its evaluations that a search may make as long as a smaller team is better."""

TRIES = 20
"""Number of random places for a further vehicle or landmark."""


@dataclass(frozen=True, slots=True)
class BestCandidate:
    """Best candidate of a search.

    Attributes
    ----------
    cell : with the senses of the candidate
    point : (size,) of the unit cube
    value : m, its worst predicted error; from UNFIT on, it has faults
    evaluations : number of candidates looked at
    """

    cell: Cell
    point: Array
    value: float
    evaluations: int

    @property
    def fits(self) -> bool:
        """Whether the candidate has no faults."""
        return self.value < UNFIT

    def as_bytes(self) -> bytes:
        """Return the result as JSON, whose numbers read back unchanged."""
        cell = self.cell.vehicles, self.cell.landmarks, self.cell.alternate
        return json.dumps([cell, self.point.tolist(), self.value, self.evaluations]).encode()

    @classmethod
    def of_bytes(cls, data: bytes, cell: Cell) -> "BestCandidate | None":
        """Return the result that `as_bytes` gave; None if it is not of a cell's search."""
        try:
            (*numbers, alternate), point, value, evaluations = json.loads(data)
        except (TypeError, ValueError):
            return None
        if numbers != [cell.vehicles, cell.landmarks]:
            return None
        return cls(replace(cell, alternate=alternate), np.array(point), value, evaluations)


def search(
    brief: Brief,
    cell: Cell,
    budget: float,
    seed: Sequence[int],
    starts: Sequence[BestCandidate] = (),
    stop: Callable[[], bool] = lambda: False,
) -> BestCandidate:
    """Return the best candidate of a cell, with either sense, after about `budget` evaluations.

    Evaluations are weighed by what they cost, see Space. The search begins with the best of
    `starts`, of this cell or of smaller ones, to which vehicles and landmarks are added; its result
    is no worse than those of this cell. Without starts, it begins at random. Where `stop` returns
    True, it ends early.
    """
    generator = np.random.default_rng(seed)
    # a single vehicle has no other to alternate with
    senses = (False, True)[: cell.vehicles]
    spaces = [Space(brief, replace(cell, alternate=alternate)) for alternate in senses]
    best, evaluations = BestCandidate(cell, np.zeros(0), np.inf, 0), 0
    smaller = min((start.value for start in starts), default=np.inf)

    def points() -> Iterator[tuple[Space, Array]]:
        for start in starts:
            space = spaces[start.cell.alternate]
            for _ in range(1 if space.cell == start.cell else TRIES):
                yield space, space.joined(start.point, start.cell, generator)
        while not starts and spent() < AT_RANDOM * budget:
            for space in spaces:
                yield space, generator.uniform(size=space.size)
        while spent() < (budget if best.value <= smaller else LONGEST * budget):
            space, before = spaces[best.cell.alternate], best
            step = space.step(generator)
            yield space, space.shifted(best.point, step)
            if best is before:
                step = -step
                yield space, space.shifted(best.point, step)
            while best is not before:
                before, step = best, GROWTH * step
                yield space, space.shifted(best.point, step)

    def spent() -> float:
        return sum(space.spent for space in spaces)

    for space, point in points():
        value = space.value(point, best.value)
        evaluations += 1
        if value < best.value:
            best = BestCandidate(space.cell, point, value, evaluations)
        if stop():
            break
    return replace(best, evaluations=evaluations)
