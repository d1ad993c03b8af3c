"""Search for batch solutions that are not those of GTSAM, which knows nothing of ours.

Certified teams of 2 to 8 vehicles are
drawn, every second one with further states and sensors: wind, gusts, scales, biases, distances,
compasses, missed sightings. A trial's first period is solved by `estimation.batch_solution` from
the prior, and by GTSAM as a factor graph from the truth: `tests.tools.factor_graphs`. Fails where
a state at the start or the end differs by more than 1e-6 of its standard deviation, or one of these
at the end by more than 1e-6 of itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.batch_problem import Prior
from syncplan.estimation.batch_solution import BatchSolution, solve
from syncplan.estimation.filter_setup import start_of
from syncplan.orbits.circles import wrap
from syncplan.planning.plans import Plan
from tests.searches import Search
from tests.tools.filter_scenes import Scene, scene_of
from tests.tools.scenario_draws import certified_plans, draw_document, with_world

__all__ = ["SAME", "SEARCH", "Compared", "batch_of", "compare", "draw"]

SAME = 1e-6
"""Of a standard deviation."""


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
    return solve(
        setup,
        readings.speeds[:steps],
        readings.turn_rates[:steps],
        readings.sightings[: setup.first[steps + 1]],
        Prior(start_of(setup, readings)[0], setup.initial_variances),
        0,
        # no gain is too little: it takes them all
        close_enough=-np.inf,
        most_steps=100,
    )


def compare(name: str, given: Scene, steps: int) -> Compared:
    """Return how far the solutions of the first trial differ."""
    from tests.tools.factor_graphs import TrialGraph

    theirs, ours = TrialGraph(given, 0, steps).solved(), batch_of(given, steps)
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


def draw(number: int) -> tuple[list[str], Compared]:
    """Return how far the solutions of a case differ."""
    made = _draw_plan(number)
    team, sample = made.team, made.team.sensors.sample_time
    steps = int(np.ceil(team.orbits.period / sample - 1e-9))
    compared = compare(str(number), scene_of(team, steps, 1, seed=number, filter="robust"), steps)
    return [] if compared.same else ["solutions differ"], compared


def _draw_plan(number: int) -> Plan:
    generator = np.random.default_rng([0, number, 4300])

    def drawn() -> dict[str, Any]:
        document = draw_document(generator, 5.0)
        return with_world(document, generator) if number % 2 else document

    return next(certified_plans(drawn, bound="never"))


def judge(cases: Mapping[int, Compared], chance: float) -> list[str]:
    """Print how far the solutions differ."""
    print("case  vehicles  further states  samples  start      end        sigma      cost")
    for case in sorted(cases.values(), key=lambda case: max(case.start, case.end))[-10:]:
        print(
            f"{case.name:>4}{case.vehicles:>10}{case.errors:>16}{case.samples:>9}"
            f"  {case.start:9.2e}  {case.end:9.2e}  {case.sigma:9.2e}  {case.cost:9.2e}"
        )
    same = sum(case.same for case in cases.values())
    print(f"the ten that differ most; the same within {SAME:g} sigma: {same} of {len(cases)}")
    return []


SEARCH = Search(draw, judge, draws=3)
