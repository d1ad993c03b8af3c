"""Search for predictions that a Monte Carlo refutes, with lasting errors and further sensors.

    python -m tests.searches.search_predictions [DRAWS [SEED]] [--trials N] [--processes N]
        [--median SHARE] [--ninety SHARE] [--strays]

Part of `make check-all`. Scenarios of 2 to 8 vehicles are drawn with every key of the world as it
is now and then: random walks, slow cameras, misses, distances, compasses, wind, gusts, scales and
biases, and with `--strays` bearing walks and clock offsets; positions and headings are determined,
and known within 2 m at the start. The filter has all errors as states. Each scenario is planned,
then validated. Fails where the median of error over prediction is further from 1 than `--median`,
or more than a tenth are further than `--ninety`.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from syncplan.planning.planner import Plan
from syncplan.planning.validation import validate
from tests.tools.scenario_draws import certified_plans, draw_document, with_strays, with_world
from tests.tools.search_arguments import search_arguments

LARGEST_SIGMA_M = 2.0
MEDIAN, NINETY = 0.03, 0.08
SHOWN = 10


@dataclass(frozen=True, slots=True)
class Prediction:
    """What one drawn scenario came to.

    Attributes
    ----------
    number : of the draw
    predicted : m, RMS of all vehicles in the second half
    ratio : what the validation found over it
    anees : of the poses
    verdict : on ANEES
    keys : what was in play
    """

    number: int
    predicted: float
    ratio: float
    anees: float
    verdict: str
    keys: str


def draw_world(number: int, seed: int, *, strays: bool = False) -> Plan:
    """Return the plan of the `number`-th scenario of a seed whose poses are determined."""
    generator = np.random.default_rng([seed, number, 15015])

    def drawn() -> dict[str, Any]:
        sigma = float(generator.uniform(0.3, LARGEST_SIGMA_M))
        document = with_world(draw_document(generator, sigma), generator)
        return with_strays(document, generator) if strays else document

    return next(certified_plans(drawn, bound="always"))


def search_one(number: int, *, seed: int, trials: int, strays: bool = False) -> Prediction:
    """Return what the `number`-th scenario of a seed came to."""
    made = draw_world(number, seed, strays=strays)
    flown = validate(made, trials=trials, seed=seed + 1, threads=1)
    expected = _expected(made)
    found = float(flown.accuracy.overall().late_position)
    given = made.scenario.model_dump(exclude_none=True)
    keys = [
        key
        for section in ("sensor", "motion", "wind")
        for key in given.get(section, {})
        if key.partition("_")[0] not in ("fov", "boresight", "sample")
    ]
    return Prediction(
        number, expected, found / expected, flown.anees.value, flown.anees.verdict, " ".join(keys)
    )


def _expected(made: Plan) -> float:
    """m: RMS over all vehicles in the second half that the plan says a filter will have."""
    rms = made.prediction.rms
    assert rms is not None
    return float(np.sqrt(np.mean(rms**2)))


def main(
    draws: int = 100,
    seed: int = 0,
    *,
    trials: int = 200,
    processes: int | None = None,
    median: float = MEDIAN,
    ninety: float = NINETY,
    strays: bool = False,
) -> bool:
    """Print what became of the draws; return whether the predictions held."""
    search = partial(search_one, seed=seed, trials=trials, strays=strays)
    with ProcessPoolExecutor(processes) as pool:
        found = list(pool.map(search, range(draws)))
    off = np.array([one.ratio for one in found])
    within = float(np.mean(np.abs(off - 1.0) <= ninety))
    optimistic = sum(one.verdict == "optimistic" for one in found)
    print(f"{draws} scenarios, {trials} trials each, seed {seed}")
    print(f"error over prediction: median {np.median(off):.3f}, within {ninety:.0%}: {within:.0%}")
    print(f"ANEES: median {np.median([one.anees for one in found]):.2f}, optimistic {optimistic}")
    for one in sorted(found, key=lambda one: -abs(one.ratio - 1.0))[:SHOWN]:
        print(
            f"  {one.number:>4} {one.ratio:>6.2f} of {one.predicted:.2f} m, "
            f"ANEES {one.anees:.2f}: {one.keys}"
        )
    return bool(abs(np.median(off) - 1.0) <= median and within >= 0.9)


if __name__ == "__main__":
    arguments = search_arguments(__doc__, 100)
    arguments.add_argument("--median", type=float)
    arguments.add_argument("--ninety", type=float)
    arguments.add_argument("--strays", action="store_true")
    sys.exit(not main(**vars(arguments.parse_args())))
