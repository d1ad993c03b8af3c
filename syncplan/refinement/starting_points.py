"""Starting points of a refinement: the plan, the rules desynchronised, then random ones.

Start k draws from the k-th child of SeedSequence(seed), so it depends neither on the number of
starts nor on where they run. A random start is the most promising of several draws, by the softest
stage's objective and constraints.
"""

from collections.abc import Callable

import numpy as np

from syncplan.arrays import Array
from syncplan.refinement.nlp import StageNlp
from syncplan.refinement.problem import RefineProblem, circles_of

_NUDGE_RAD = 0.1
_DESYNC_RAD = 0.4
_SCATTER_RAD = 1.2
"""Of phases, from the plan's or those of the rules."""

_DRAWS = 24
_PENALTY = 10.0
"""Cost of a unit of violation, in units of the objective."""


def starting_circles(
    problem: RefineProblem,
    rule_phases: Array,
    nudged: bool,
    start: int,
    seed: int,
    softest: Callable[[], StageNlp],
) -> Array:
    """Return the circles (4, n) in m and rad at which start `start` (from 0) begins.

    `rule_phases` (n,) rad meet the rules. `nudged` moves the plan itself a little: a plan that is
    not observable may be a saddle point, where all slopes vanish. `softest` returns the nonlinear
    program of the softest stage, by which random starts are chosen.
    """
    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(start,)))
    given = circles_of(problem.orbits)
    if start == 0:
        shift = _NUDGE_RAD * generator.standard_normal(given.shape[1]) if nudged else 0.0
        return _limited(problem, given, given[3] + shift)
    if start == 1:
        shift = _DESYNC_RAD * generator.uniform(-1.0, 1.0, given.shape[1])
        return _limited(problem, given, rule_phases + shift)
    draws = [_drawn(problem, rule_phases, generator, k) for k in range(_DRAWS)]
    return _most_promising(softest(), draws)


def _drawn(
    problem: RefineProblem, rule_phases: Array, generator: np.random.Generator, draw: int
) -> Array:
    """Circles anywhere within bounds; phases near the rules, in every second draw anywhere."""
    given, freedom = circles_of(problem.orbits), problem.freedom
    low = np.maximum(freedom.lower[:3], given[:3] - problem.scale)
    high = np.minimum(freedom.upper[:3], given[:3] + problem.scale)
    circles = given.copy()
    circles[:3] = generator.uniform(low, np.maximum(high, low))
    spread = np.pi if draw % 2 else _SCATTER_RAD
    return _limited(
        problem, circles, rule_phases + spread * generator.uniform(-1.0, 1.0, given.shape[1])
    )


def _limited(problem: RefineProblem, circles: Array, phases: Array) -> Array:
    """Circles within their bounds, phases taken modulo 2 pi to the middle of theirs."""
    freedom = problem.freedom
    limited = np.clip(circles, freedom.lower, freedom.upper)
    if problem.area.limited and freedom.free[:2].all():
        moved = problem.area.nearest_clear(limited[:2].T, limited[2], paths=True)
        if moved is not None:
            limited[:2] = np.clip(moved.T, freedom.lower[:2], freedom.upper[:2])
    middle = 0.5 * (freedom.lower[3] + freedom.upper[3])
    limited[3] = np.where(
        freedom.free[3], middle + (phases - middle + np.pi) % (2.0 * np.pi) - np.pi, middle
    )
    return limited


def _most_promising(nlp: StageNlp, draws: list[Array]) -> Array:
    costs = []
    for circles in draws:
        variables, sides = nlp.variables_of(circles), nlp.sides_of(circles)
        objective = float(nlp.values(variables, sides)[0])
        violated = float(nlp.violations(variables, sides).sum())
        cost = objective + _PENALTY * violated
        costs.append(cost if np.isfinite(cost) else np.inf)
    return draws[int(np.argmin(costs))]
