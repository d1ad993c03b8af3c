"""Search for batch solutions that are not those of GTSAM, which knows nothing of ours.

    python -m tests.searches.search_batch [DRAWS [SEED]] [--processes N]

Part of `make check-all`; `make check` has a few small cases. Certified teams of 2 to 8 vehicles are
drawn, every second one with further states and sensors: wind, gusts, scales, biases, distances,
compasses, missed sightings. A trial's first period is solved by `estimation.batch_solution` from
the prior, and by GTSAM as a factor graph from the truth: `tests.tools.factor_graphs`. Fails where
a state at the start or the end differs by more than 1e-6 of its standard deviation, or one of these
at the end by more than 1e-6 of itself.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.batch_problem import Prior
from syncplan.estimation.batch_solution import BatchSolution, solve
from syncplan.estimation.filter_setup import start_of
from syncplan.orbits.circles import wrap
from syncplan.planning.planner import Plan
from tests.tools.filter_scenes import Scene, scene_of
from tests.tools.scenario_draws import certified_plans, draw_document, with_world
from tests.tools.search_arguments import search_arguments

__all__ = ["Compared", "batch_of", "compare", "compare_drawn", "main"]

SAME = 1e-6
"""Of a standard deviation."""

CONVERGED = -np.inf
"""Gain in cost below which ours takes no further step: it takes as many as it may."""


@dataclass(frozen=True, slots=True)
class Compared:
    """How far two solutions of one trial differ.

    Attributes
    ----------
    name : of the case
    vehicles, errors, samples : numbers of vehicles, further states and samples
    start, end : largest difference of a state, in its standard deviation
    sigma : largest relative difference of a standard deviation at the end
    cost : ours less GTSAM's; twice the negative log-likelihood
    """

    name: str
    vehicles: int
    errors: int
    samples: int
    start: float
    end: float
    sigma: float
    cost: float

    @property
    def same(self) -> bool:
        """Whether they are the same to rounding."""
        return max(self.start, self.end, self.sigma) <= SAME


def batch_of(given: Scene, steps: int) -> BatchSolution:
    """Return our solution over the first samples, from the prior, to convergence."""
    setup, readings, _ = given
    mean, _ = start_of(setup, readings)
    return solve(
        setup,
        readings.speeds[:steps],
        readings.turn_rates[:steps],
        readings.sightings[: setup.first[steps + 1]],
        Prior(mean, setup.initial_variances),
        0,
        close_enough=CONVERGED,
    )


def compare(name: str, given: Scene, steps: int) -> Compared:
    """Return how far the solutions of the first trial differ."""
    from tests.tools.factor_graphs import solve_graph

    theirs, ours = solve_graph(given, 0, steps), batch_of(given, steps)
    n, sigmas = given.setup.vehicles, np.sqrt(np.diagonal(ours.covariance[..., 0]))
    return Compared(
        name=name,
        vehicles=n,
        errors=len(given.setup.states.variances),
        samples=steps,
        start=_apart(ours.path.start[:, 0], theirs.start, theirs.start_sigmas, n),
        end=_apart(ours.state[:, 0], theirs.end, theirs.end_sigmas, n),
        sigma=float(np.max(np.abs(sigmas / theirs.end_sigmas - 1.0))),
        cost=float(ours.cost[0]) - theirs.cost,
    )


def _apart(a: Array, b: Array, sigmas: Array, n: int) -> float:
    off = a - b
    off[2 : 3 * n : 3] = wrap(off[2 : 3 * n : 3])
    return float(np.max(np.abs(off) / sigmas))


def compare_drawn(number: int, *, seed: int) -> Compared:
    """Return how far the solutions of the `number`-th case of a seed differ."""
    made = _draw_plan(number, seed)
    team, sample = made.team, made.team.sensors.sample_time
    steps = int(np.ceil(team.orbits.period / sample - 1e-9))
    given = scene_of(team, steps, 1, seed=seed + number, filter="robust")
    return compare(str(number), given, steps)


def _draw_plan(number: int, seed: int) -> Plan:
    generator = np.random.default_rng([seed, number, 4300])

    def drawn() -> dict[str, Any]:
        document = draw_document(generator, 5.0)
        return with_world(document, generator) if number % 2 else document

    return next(certified_plans(drawn, bound="never"))


def main(draws: int = 50, seed: int = 0, *, processes: int | None = None) -> bool:
    """Print how far solutions differ; return whether all are the same."""
    with ProcessPoolExecutor(processes) as pool:
        found = list(pool.map(partial(compare_drawn, seed=seed), range(draws)))
    print(f"{draws} certified scenarios, a trial's first period each, seed {seed}")
    print("case  vehicles  further states  samples  start      end        sigma      cost")
    for one in sorted(found, key=lambda one: max(one.start, one.end))[-10:]:
        print(
            f"{one.name:>4}{one.vehicles:>10}{one.errors:>16}{one.samples:>9}"
            f"  {one.start:9.2e}  {one.end:9.2e}  {one.sigma:9.2e}  {one.cost:9.2e}"
        )
    same = sum(one.same for one in found)
    print(f"the ten that differ most; the same within {SAME:g} sigma: {same} of {draws}")
    return same == draws


if __name__ == "__main__":
    sys.exit(not main(**vars(search_arguments(__doc__, 50, trials=False).parse_args())))
