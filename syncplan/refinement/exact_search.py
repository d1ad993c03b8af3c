"""Final search near a refined plan by the exact measure: patterns, then random moves.

The solver sees the step between seen and unseen as a slope; the exact figures jump where a sample
falls in or out of contact. Pattern search (Hooke and Jeeves, "Direct Search" Solution of Numerical
and Statistical Problems, J. ACM 8, 1961, pages 212-229) tries each free value a step up and down.
Where a round of that improves the plan, the same move is repeated; otherwise the step is halved.
Random moves of all sizes then leave small local minima. Circles that violate a constraint are
never taken; among others, a smaller shortfall of distances comes before a lower cost.
"""

from collections.abc import Callable

import numpy as np

from syncplan.arrays import Array
from syncplan.refinement.measures import NO_STANDING, Measurement, Standing, measure
from syncplan.refinement.problem import RefineProblem, orbits_of

_FIRST_STEP, _LEAST_STEP = 0.2, 0.002
"""First and least step: in rad for phases, in mean radii of the plan for lengths."""

_MOST_VALUES = 24
"""Most free values that are searched; of more, the phases alone, or none."""

_LARGEST_MOVE = 1.0
"""Size of the largest random move, in the same units."""

_LOOKS_OF_ALL, _MOST_LOOKS = 2400, 600
"""Measurements allowed: the first number over that of the free values, at most the second."""

_RUN_STEPS, _LEAST_RUNS, _MOST_RUNS = 60_000, 30, 150
"""Posterior bounds allowed: samples in all of them, and least and largest number of bounds."""


def improved_nearby(
    problem: RefineProblem,
    before: Measurement,
    circles: Array,
    generator: np.random.Generator,
    *,
    predict: bool = True,
    over: Callable[[], bool] = lambda: False,
) -> tuple[Array, Measurement] | None:
    """Return better circles (4, n) near the given ones and their measurement, or None.

    They violate nothing that `before` met. `predict` adds their posterior bound to the measurement;
    `over`, called before each measurement, returns whether to stop.
    """
    values = _searched(problem)
    if len(values) == 0:
        return None
    looks = _Looks(problem, before, len(values), over)
    base = looks.limited(circles)
    first = looks.cost(base)
    if first == NO_STANDING:
        return None
    best = _random_moves(looks, _patterns(looks, (base, first), values), values, generator)
    if best[1] >= first:
        return None
    return best[0], measure(problem, orbits_of(best[0], problem.orbits), predict=predict)


def _patterns(
    looks: "_Looks", start: tuple[Array, Standing], values: list[tuple[int, int]]
) -> tuple[Array, Standing]:
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
    start: tuple[Array, Standing],
    values: list[tuple[int, int]],
    generator: np.random.Generator,
) -> tuple[Array, Standing]:
    """Best circles after moves in random directions, their sizes spread over all scales."""
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
    """Row and vehicle of each value to search: all that are free, or the phases if too many."""
    free = problem.freedom.free
    if free.sum() > _MOST_VALUES:
        free = free & (np.arange(4)[:, None] == 3)
    if free.sum() > _MOST_VALUES:
        return []
    rows, vehicles = np.nonzero(free[::-1])
    return [(3 - int(row), int(vehicle)) for row, vehicle in zip(rows, vehicles, strict=True)]


def _round(
    looks: "_Looks", at: tuple[Array, Standing], values: list[tuple[int, int]], step: float
) -> tuple[Array, Standing]:
    """Best circles found by moving one value after the other, and their cost."""
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
    """Exact cost of circles within a budget of measurements; a violation costs infinity."""

    def __init__(
        self, problem: RefineProblem, before: Measurement, values: int, over: Callable[[], bool]
    ) -> None:
        self.problem, self.before, self.over = problem, before, over
        self.predicted = problem.objective.predicted
        self.looks = min(_LOOKS_OF_ALL // values, _MOST_LOOKS)
        steps = problem.duration / problem.sensors.sample_time
        self.run_looks = int(np.clip(_RUN_STEPS / steps, _LEAST_RUNS, _MOST_RUNS))

    @property
    def spent(self) -> bool:
        """Whether to stop."""
        return self.looks <= 0 or self.run_looks <= 0 or self.over()

    def limited(self, circles: Array) -> Array:
        """Return the circles clipped to their bounds, except free phases."""
        freedom = self.problem.freedom
        limited = np.clip(circles, freedom.lower, freedom.upper)
        limited[3] = np.where(freedom.free[3], circles[3], limited[3])
        return np.asarray(limited)

    def cost(self, circles: Array) -> Standing:
        """Return the exact standing; NO_STANDING for a violation or when no measurement is left."""
        if self.spent:
            return NO_STANDING
        self.looks -= 1
        orbits = orbits_of(circles, self.problem.orbits)
        found = measure(self.problem, orbits, predict=False)
        if found.violations(self.before):
            return NO_STANDING
        if self.predicted:
            self.run_looks -= 1
            found = measure(self.problem, orbits)
        return found.standing(self.problem.objective.name)
