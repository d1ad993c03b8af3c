"""A last search about a refined plan by the exact measure: patterns, then random moves.

The solver sees steps between seen and unseen as slopes; the exact figures jump where a sample
falls in or out of contact, and constraints such as the window bound have no slack there. Hooke and
Jeeves's pattern search tries each free value a step up and down; where a round of that improves the
plan the same move is tried again, otherwise the step is halved. Random moves of all sizes then
leave what is only a dent. Only what violates nothing is ever taken.
"""

from collections.abc import Callable

import numpy as np

from syncplan.arrays import Array
from syncplan.refinement.measures import Measurement, measure
from syncplan.refinement.problem import RefineProblem, orbits_of

__all__ = ["improved_nearby"]


_FIRST_STEP, _LEAST_STEP = 0.2, 0.002
"""In rad for phases, in the plan's mean radius for lengths."""

_MOST_VALUES = 24
"""Largest number of free values that are searched; of larger teams only the phases, or nothing."""

_LARGEST_MOVE = 1.0
"""Of a random move, in the same units."""

_LOOKS_OF_ALL, _MOST_LOOKS = 2400, 600
"""Measurements: so many over the number of values, but no more."""

_RUN_STEPS, _LEAST_RUNS, _MOST_RUNS = 60_000, 30, 150
"""Samples in all that posterior bounds may go through, and limits on their number."""


def improved_nearby(
    problem: RefineProblem,
    before: Measurement,
    circles: Array,
    generator: np.random.Generator,
    *,
    predict: bool = True,
    over: Callable[[], bool] = lambda: False,
) -> tuple[Array, Measurement] | None:
    """Return better circles (4, n) near the given ones and their measurement; None if none is.

    They violate nothing that `before` met. `predict` computes the posterior bound of what is
    returned; `over` is asked before each look.
    """
    values = _searched(problem)
    if len(values) == 0:
        return None
    looks = _Looks(problem, before, len(values), over)
    base = looks.limited(circles)
    first = looks.cost(base)
    if not np.isfinite(first):
        return None
    best = _random_moves(looks, _patterns(looks, (base, first), values), values, generator)
    if best[1] >= first:
        return None
    return best[0], measure(problem, orbits_of(best[0], problem.orbits), predict=predict)


def _patterns(
    looks: "_Looks", start: tuple[Array, float], values: list[tuple[int, int]]
) -> tuple[Array, float]:
    best, step = start, _FIRST_STEP
    while step >= _LEAST_STEP and not looks.spent:
        found = _round(looks, best, values, step)
        if found[1] >= best[1]:
            step *= 0.5
            continue
        while found[1] < best[1] and not looks.spent:
            leap = looks.limited(2.0 * found[0] - best[0])
            best = found
            found = _round(looks, (leap, looks.cost(leap)), values, step)
    return best


def _random_moves(
    looks: "_Looks",
    start: tuple[Array, float],
    values: list[tuple[int, int]],
    generator: np.random.Generator,
) -> tuple[Array, float]:
    """The best that moves in random directions come to, their sizes spread over all scales."""
    best = start
    rows, vehicles = np.array(values).T
    units = np.where(rows == 3, 1.0, looks.problem.scale)
    while not looks.spent:
        size = np.exp(generator.uniform(np.log(_LEAST_STEP), np.log(_LARGEST_MOVE)))
        trial = best[0].copy()
        direction = generator.standard_normal(len(values))
        trial[rows, vehicles] += units * size * direction / np.linalg.norm(direction)
        trial = looks.limited(trial)
        cost = looks.cost(trial)
        if cost < best[1]:
            best = trial, cost
    return best


def _searched(problem: RefineProblem) -> list[tuple[int, int]]:
    """(row, vehicle) of the values that are searched: all if they are few, or the phases."""
    free = problem.freedom.free
    if free.sum() > _MOST_VALUES:
        free = free & (np.arange(4)[:, None] == 3)
    if free.sum() > _MOST_VALUES:
        return []
    rows, vehicles = np.nonzero(free[::-1])
    return [(3 - int(row), int(vehicle)) for row, vehicle in zip(rows, vehicles, strict=True)]


def _round(
    looks: "_Looks", at: tuple[Array, float], values: list[tuple[int, int]], step: float
) -> tuple[Array, float]:
    """The best circles that one value after the other comes to, and their cost."""
    best = at
    for row, vehicle in values:
        unit = step if row == 3 else step * looks.problem.scale
        for move in (unit, -unit):
            trial = best[0].copy()
            trial[row, vehicle] += move
            trial = looks.limited(trial)
            cost = looks.cost(trial)
            if cost < best[1]:
                best = trial, cost
                break
    return best


class _Looks:
    """Counts what is measured; what violates something costs infinitely much."""

    def __init__(
        self, problem: RefineProblem, before: Measurement, values: int, over: Callable[[], bool]
    ) -> None:
        self.problem, self.before, self.over = problem, before, over
        self.runs = problem.objective.predicted
        self.looks = min(_LOOKS_OF_ALL // values, _MOST_LOOKS)
        steps = problem.duration / problem.sensors.sample_time
        self.run_looks = int(np.clip(_RUN_STEPS / steps, _LEAST_RUNS, _MOST_RUNS))

    @property
    def spent(self) -> bool:
        """Whether to stop looking."""
        return self.looks <= 0 or self.run_looks <= 0 or self.over()

    def limited(self, circles: Array) -> Array:
        """Return the circles within their bounds; phases turn freely."""
        freedom = self.problem.freedom
        limited = np.clip(circles, freedom.lower, freedom.upper)
        limited[3] = np.where(freedom.free[3], circles[3], limited[3])
        return np.asarray(limited)

    def cost(self, circles: Array) -> float:
        """Return the exact cost; infinite for a violation, or when there is no look left."""
        if self.spent:
            return float("inf")
        self.looks -= 1
        orbits = orbits_of(circles, self.problem.orbits)
        found = measure(self.problem, orbits, predict=False)
        if found.violations(self.before):
            return float("inf")
        if self.runs:
            self.run_looks -= 1
            found = measure(self.problem, orbits)
        return found.figures.cost(self.problem.objective.name)
