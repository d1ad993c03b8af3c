"""Search for starts that the verdict misjudges: unwarned of and lost, or warned of and well.

    python -m tests.searches.search_start_up [DRAWS [SEED]] [--trials N] [--processes N]
        [--filter NAME] [--missed SHARE] [--wrong SHARE]

Part of `make check-all`. Certified teams of 2 to 8 vehicles are drawn, with initial sigmas of 0.5,
2, 5, 15 and 30 m in turn and 0.02 rad a metre, each planned and then validated with the filter that
runs: ekf where the index clears it, robust where not; or the one named. A team is `over` where some
vehicle's RMS error of the second half is over twice its bound, `well` where all are within 1.3
times. Fails where more than 15 % of those over were not warned of, or more than 10 % of those well
were; few draws want wider limits.
"""

import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from syncplan.errors import NoSolutionError
from syncplan.planning.planner import Plan
from syncplan.planning.start_up import CLEARING_INDEX
from syncplan.planning.validation import validate
from syncplan.scenario.filters import AUTO, FILTERS
from tests.tools.scenario_draws import certified_plans, draw_document
from tests.tools.search_arguments import search_arguments

SIGMAS_M = (0.5, 2.0, 5.0, 15.0, 30.0)

OVER, WELL = 2.0, 1.3
MOST_MISSED, MOST_WRONG = 0.15, 0.10


@dataclass(frozen=True, slots=True)
class Start:
    """What one drawn scenario came to.

    Attributes
    ----------
    sigma : m, of the initial position
    index : the start-up index
    warned : whether the plan's verdict warns of the start
    ratio : worst vehicle's error over its bound, found by the validation; infinite if it diverged
    """

    sigma: float
    index: float
    warned: bool
    ratio: float


def draw_plan(number: int, seed: int, filter_: str = AUTO) -> Plan:
    """Return the plan, for a filter, of the `number`-th certified scenario of a seed."""
    generator = np.random.default_rng([seed, number, 60413])
    sigma = SIGMAS_M[number % len(SIGMAS_M)]
    drawn = certified_plans(
        lambda: {**draw_document(generator, sigma), "filter": {"kind": filter_}}
    )
    return next(made for made in drawn if made.start_up is not None)


def search_one(number: int, *, seed: int, trials: int, filter_: str) -> Start:
    """Return what the `number`-th scenario of a seed came to."""
    made = draw_plan(number, seed, filter_)
    assert made.start_up is not None
    warned = any(one.code == "start-up" and one.level == "warning" for one in made.verdict.findings)
    try:
        flown = validate(made, trials=trials, seed=seed + 1, threads=1)
    except NoSolutionError:
        ratio = np.inf
    else:
        assert flown.predicted is not None
        ratio = float(np.max(flown.accuracy.late_position / flown.predicted))
    return Start(made.noise.position_sigma, made.start_up.index.value, warned, ratio)


def main(
    draws: int = 200,
    seed: int = 0,
    *,
    trials: int = 200,
    processes: int | None = None,
    filter_: str = AUTO,
    missed: float = MOST_MISSED,
    wrong: float = MOST_WRONG,
) -> bool:
    """Print what became of the draws; return whether the verdict judged well enough."""
    one = partial(search_one, seed=seed, trials=trials, filter_=filter_)
    with ProcessPoolExecutor(processes) as pool:
        found = list(pool.map(one, range(draws)))
    print(f"{draws} certified scenarios, {trials} trials each, seed {seed}, filter {filter_}")
    print("   sigma  drawn  cleared  over 2  unwarned  within 1.3  warned of")
    for sigma in SIGMAS_M:
        _row(f"{sigma:g} m", [start for start in found if start.sigma == sigma])
    lost, well = _row("all", found)
    print(f"of those over 2, {lost:.1%} went unwarned; of those within 1.3, {well:.1%} warned of")
    return lost <= missed and well <= wrong


def _row(label: str, found: Sequence[Start]) -> tuple[float, float]:
    """Print a row; return the share of lost starts unwarned of, and of well ones warned of."""
    over = [start for start in found if start.ratio > OVER]
    well = [start for start in found if start.ratio < WELL]
    missed = sum(not start.warned for start in over)
    wrong = sum(start.warned for start in well)
    cleared = sum(start.index <= CLEARING_INDEX for start in found)
    print(
        f"{label:>8}{len(found):>7}{cleared:>9}{len(over):>8}{missed:>10}{len(well):>12}{wrong:>11}"
    )
    return missed / max(len(over), 1), wrong / max(len(well), 1)


if __name__ == "__main__":
    arguments = search_arguments(__doc__, 200)
    arguments.add_argument("--filter", dest="filter_", choices=[AUTO, *FILTERS])
    arguments.add_argument("--missed", type=float)
    arguments.add_argument("--wrong", type=float)
    sys.exit(not main(**vars(arguments.parse_args())))
