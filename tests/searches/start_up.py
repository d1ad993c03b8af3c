"""Search for starts that the verdict misjudges: unwarned of and lost, or warned of and well.

Certified teams of 2 to 8 vehicles are drawn, with initial sigmas of 0.5, 2, 5, 15 and 30 m in turn
and 0.02 rad a metre, each planned and then validated with the filter that runs: ekf where the index
clears it, robust where not; or, as `start_up.ekf` and `start_up.second_order`, the one named. A
team is `over` where some vehicle's RMS error of the second half is over twice its bound, `well`
where all are within 1.3 times. Fails where more than 15 % of those over were not warned of, or more
than 10 % of those well were.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from syncplan.errors import NoSolutionError
from syncplan.planning.planner import Plan
from syncplan.planning.start_up import CLEARING_INDEX
from syncplan.planning.validation import validate
from syncplan.scenario.filters import AUTO
from tests.searches import Search, most_of
from tests.tools.scenario_draws import certified_plans, draw_document

SIGMAS_M = (0.5, 2.0, 5.0, 15.0, 30.0)

OVER, WELL = 2.0, 1.3
MOST_MISSED, MOST_WRONG = 0.15, 0.10
TRIALS = 200


@dataclass(frozen=True, slots=True)
class Start:
    """A start, judged by the plan and by the validation.

    Attributes
    ----------
    sigma : m, of the initial position
    index : the start-up index
    warned : whether the plan's verdict warns of the start
    ratio : worst vehicle's error over its bound in the validation; infinite if it diverged
    """

    sigma: float
    index: float
    warned: bool
    ratio: float


def draw_plan(number: int, filter_: str = AUTO) -> Plan:
    """Return the plan of a certified scenario, for a filter."""
    generator = np.random.default_rng([0, number, 60413])
    sigma = SIGMAS_M[number % len(SIGMAS_M)]
    plans = certified_plans(
        lambda: {**draw_document(generator, sigma), "filter": {"kind": filter_}}
    )
    return next(planned for planned in plans if planned.start_up is not None)


def draw(number: int, *, filter_: str = AUTO) -> tuple[list[str], Start]:
    """Return how the start of a scenario is judged."""
    planned = draw_plan(number, filter_)
    assert planned.start_up is not None
    warned = any(
        finding.code == "start-up" and finding.level == "warning"
        for finding in planned.verdict.findings
    )
    try:
        flown = validate(planned, trials=TRIALS, seed=1, threads=1)
    except NoSolutionError:
        ratio = np.inf
    else:
        assert flown.predicted is not None
        ratio = float(np.max(flown.accuracy.late_position / flown.predicted))
    return [], Start(planned.noise.position_sigma, planned.start_up.index.value, warned, ratio)


def judge(cases: Mapping[int, Start], chance: float) -> list[str]:
    """Print a row for each sigma; return where the verdict misjudges too many."""
    starts = list(cases.values())
    print("   sigma  drawn  cleared  over 2  unwarned  within 1.3  warned of")
    for sigma in SIGMAS_M:
        _row(f"{sigma:g} m", [start for start in starts if start.sigma == sigma])
    over, missed, well, wrong = _row("all", starts)
    faults = []
    if missed > most_of(over, MOST_MISSED, chance):
        faults.append(f"of {over} over {OVER:g} times the bound, {missed} went unwarned")
    if wrong > most_of(well, MOST_WRONG, chance):
        faults.append(f"of {well} within {WELL:g} times the bound, {wrong} were warned of")
    return faults


def _row(label: str, starts: Sequence[Start]) -> tuple[int, int, int, int]:
    """Print a row; return how many are over, of these unwarned, and well, of these warned of."""
    over = [start for start in starts if start.ratio > OVER]
    well = [start for start in starts if start.ratio < WELL]
    missed = sum(not start.warned for start in over)
    wrong = sum(start.warned for start in well)
    cleared = sum(start.index <= CLEARING_INDEX for start in starts)
    print(
        f"{label:>8}{len(starts):>7}{cleared:>9}{len(over):>8}{missed:>10}{len(well):>12}"
        f"{wrong:>11}"
    )
    return len(over), missed, len(well), wrong


SEARCH = Search(draw, judge, draws=10)
EKF = Search(partial(draw, filter_="ekf"), judge, draws=20)
SECOND_ORDER = Search(partial(draw, filter_="second-order"), judge, draws=20)
