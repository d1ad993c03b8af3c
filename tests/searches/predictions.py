"""Search for predictions that a Monte Carlo refutes, with lasting errors and further sensors.

Scenarios of 2 to 8 vehicles are drawn with every key of the world as it is now and then: random
walks, slow cameras, misses, distances, compasses, wind, gusts, scales and biases, and for
`predictions.strays` bearing walks and clock offsets; positions and headings are determined, and
known within 2 m at the start. The filter has all errors as states. Each scenario is planned, then
validated. Fails where the median of error over prediction is further from 1 than MEDIAN, or more
than a tenth are further than NINETY.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from syncplan.planning.plans import Plan
from syncplan.planning.validation import validate
from tests.searches import Search, most_of
from tests.tools.scenario_draws import certified_plans, draw_document, with_strays, with_world

LARGEST_SIGMA_M = 2.0
MEDIAN, NINETY = 0.03, 0.08
TRIALS = 200
SHOWN = 10


def draw_world(number: int, *, strays: bool) -> Plan:
    """Return the plan of a scenario whose poses are determined."""
    generator = np.random.default_rng([0, number, 15015])

    def drawn() -> dict[str, Any]:
        sigma = float(generator.uniform(0.3, LARGEST_SIGMA_M))
        document = with_world(draw_document(generator, sigma), generator)
        return with_strays(document, generator) if strays else document

    return next(certified_plans(drawn, bound="always"))


def draw(number: int, *, strays: bool = False) -> tuple[list[str], float]:
    """Return the error of a scenario over the one predicted: RMS of the second half."""
    made = draw_world(number, strays=strays)
    rms = made.prediction.rms
    assert rms is not None
    flown = validate(made, trials=TRIALS, seed=1, threads=1)
    return [], float(flown.accuracy.overall().late_position / np.sqrt(np.mean(rms**2)))


def judge(cases: Mapping[int, float], chance: float) -> list[str]:
    """Print what became of the draws; return how predictions failed."""
    off = np.array(list(cases.values()))
    print(f"error over prediction: median {np.median(off):.3f}; furthest off:")
    for number, ratio in sorted(cases.items(), key=lambda item: -abs(item[1] - 1.0))[:SHOWN]:
        print(f"  {number:>4} {ratio:>6.2f}")
    half, tenth = most_of(len(cases), 0.5, chance), most_of(len(cases), 0.1, chance)
    faults = []
    if max(np.sum(off > 1.0 + MEDIAN), np.sum(off < 1.0 - MEDIAN)) > half:
        faults.append(f"the median is over {MEDIAN:.0%} off")
    if (beyond := np.sum(abs(off - 1.0) > NINETY)) > tenth:
        faults.append(f"{beyond} are over {NINETY:.0%} off, at most {tenth:.3g} may")
    return faults


SEARCH = Search(draw, judge, draws=8)
STRAYS = Search(partial(draw, strays=True), judge, draws=8)
