"""Search for a hold after which guidance `mpc` is not back in phase sooner than `track`, or unsafe.

The paper's grid, where 10 m of separation are asked for, flies with v2 held for 20 s from 100 s on,
by either guidance under the same noise: a case is one of several limits, from a start known well or
hardly, each in turn. Fails where the median time until the phase is within 1 s again, of all trials
with these limits and this start, is not at least 30 % shorter with `mpc`, where any two vehicles of
a trial of `mpc` come nearer than asked, and where a decision of the first trials of a case breaks a
constraint: speed, turn rate, their changes, the exact flight that the decision foresees.
"""

from collections.abc import Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from syncplan.arrays import Array, Flags
from syncplan.flight.flying import flight_run, fly
from syncplan.guidance.predictive_guidance import (
    STEP_ANGLE,
    Decision,
    PredictiveGuidance,
    PredictiveOptions,
)
from syncplan.planning.plan_flights import FlightRun
from syncplan.planning.plans import Plan
from syncplan.scenario.loading import scenario_from
from tests.searches import Search
from tests.tools.flown_trials import lanes_begun
from tests.tools.on_paper import plan
from tests.tools.predictive_check import DecisionCheck, check_decision
from tests.tools.scenarios import changed

HOLD = ("v2@100:20",)
SEPARATION_M = 10.0
LIMITS: dict[str, dict[str, Any]] = {
    "default": {},
    "2 to 6 m/s, 0.8 rad/s": {"speed_mps": [2, 6], "turn_rate_rad_s": 0.8},
    "1 to 5 m/s, 0.6 rad/s": {"speed_mps": [1, 5], "turn_rate_rad_s": 0.6},
}
SIGMAS_M = (0.5, 5.0)
"""Of the places at the start."""

ROWS = tuple(product(LIMITS, SIGMAS_M))
LAWS = ("track", "mpc")

LEAST_SOONER, MOST_BROKEN = 0.3, 1e-9
TRIALS = 6
CHECKED = 4
"""Trials whose decisions are checked."""


class Held(NamedTuple):
    """Trials after a hold, with the laws of guidance in turn.

    Seconds until v2 has its phase again, infinite where it never does, (laws, trials); metres
    between vehicles (laws,); the share of decisions of `mpc` refused, and the most that one breaks.
    """

    back: Array
    closest: Array
    refused: float
    broken: float


def _plan(limits: dict[str, Any], sigma: float) -> Plan:
    document = changed(
        "paper-grid-same",
        min_separation_m=SEPARATION_M,
        initial_sigma={"position_m": sigma, "heading_rad": 0.05},
    ).model_dump(mode="json", exclude_none=True)
    return plan(scenario_from({**document, **({"limits": limits} if limits else {})}), pilot=False)


class _Checked:
    """Guidance of a trial, with what its decisions break."""

    def __init__(self, inside: PredictiveGuidance, step: float, run: FlightRun) -> None:
        self.inside, self.step, self.limits = inside, step, run.limits
        self.checks: list[DecisionCheck] = []

    def decide(
        self, time: float, poses: Array, winds: Array, before: Array, held: Flags, moved: Array
    ) -> Decision:
        """Decide as what is inside."""
        decision = self.inside.decide(time, poses, winds, before, held, moved)
        options = PredictiveOptions()
        self.checks.append(
            check_decision(decision, self.step, poses, winds, before, self.limits, options)
        )
        return decision


def _broken(planned: Plan, seed: int) -> float:
    """The worst of all constraints in the decisions of the first trials, whatever its unit."""
    run = flight_run(planned, guidance="mpc", trials=CHECKED, seed=seed, hold=HOLD)
    lanes = lanes_begun(run.team, range(CHECKED))
    guidance: Any = lanes.guidance
    step = max(STEP_ANGLE / run.plan.orbits.rate, PredictiveOptions().interval)
    checked = [_Checked(inside, step, run) for inside in guidance._guidances]
    guidance._guidances = checked
    lanes.advance(run.team.steps)
    parts = ("speed", "turn_rate", "speed_change", "turn_rate_change", "place", "heading")
    return max(float(getattr(c, part)) for trial in checked for c in trial.checks for part in parts)


def draw(number: int) -> tuple[list[str], Held]:
    """Return how trials of a row go on after the hold."""
    (limits, sigma), seed = ROWS[number % len(ROWS)], number // len(ROWS)
    planned = _plan(LIMITS[limits], sigma)
    options: Any = {"trials": TRIALS, "seed": seed, "hold": HOLD, "threads": 1}
    figures = [fly(planned, guidance=law, **options).result.figures for law in LAWS]
    back = np.array([np.nan_to_num(law.settled[:, 0], nan=np.inf) for law in figures])
    closest = np.array([law.separations.min() for law in figures])
    broken = _broken(planned, seed)
    faults = []
    if closest[-1] < SEPARATION_M:
        faults.append(f"vehicles come as near as {closest[-1]:.2f} m")
    if not broken <= MOST_BROKEN:
        faults.append(f"a decision breaks a constraint by {broken:.1e}")
    return faults, Held(back, closest, float(figures[-1].refused.mean()), broken)


def judge(cases: Mapping[int, Held], chance: float) -> list[str]:
    """Print the table by row; return where phases are not back soon enough."""
    print("limits                  start  trials  track s   mpc s  sooner %", end="")
    print("  closest m      mpc m  refused %   breaks")
    faults = []
    for row, (limits, sigma) in enumerate(ROWS):
        some = [case for number, case in cases.items() if number % len(ROWS) == row]
        if not some:
            continue
        back = np.concatenate([case.back for case in some], axis=1)
        track, mpc = np.median(back, axis=1)
        sooner = 1.0 - mpc / track
        if not sooner >= LEAST_SOONER:
            faults.append(f"{limits}, start known to {sigma:g} m: {sooner:.0%} sooner with mpc")
        closest = np.min([case.closest for case in some], axis=0)
        print(
            f"{limits:22s}  {sigma:5g}  {back.shape[1]:6d}  {track:7.2f}  {mpc:6.2f}  "
            f"{100.0 * sooner:8.0f}  {closest[0]:9.2f}  {closest[1]:9.2f}  "
            f"{100.0 * np.mean([case.refused for case in some]):9.2f}  "
            f"{max(case.broken for case in some):7.1e}"
        )
    return faults


SEARCH = Search(draw, judge, draws=len(ROWS))
