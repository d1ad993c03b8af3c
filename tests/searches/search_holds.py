"""Search for a hold after which guidance `mpc` is not back in phase sooner than `track`, or unsafe.

    python -m tests.searches.search_holds [TRIALS [SEED]]

Part of `make check-all`, with few trials. The paper's grid, where 10 m of separation are asked for,
flies with v2 held for 20 s from 100 s on, by either guidance under the same noise: within several
limits, from a start known well or hardly. Fails where the median time until the phase is within 1 s
again is not at least 30 % shorter with `mpc`, where any two vehicles of a trial of `mpc` come
nearer than asked, and where a decision of the first trials breaks a constraint: speed, turn rate,
their changes, the exact flight that the decision foresees.
"""

import sys
from typing import Any

import numpy as np

from syncplan.arrays import Array, Flags
from syncplan.flight.flying import FlightRun, flight_run, fly
from syncplan.flight.predictive_guidance import (
    STEP_ANGLE,
    Decision,
    PredictiveGuidance,
    PredictiveOptions,
)
from syncplan.planning.planner import Plan, plan
from syncplan.scenario.loading import scenario_from
from tests.tools.flown_trials import lanes_begun
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

LEAST_SOONER, MOST_BROKEN = 0.3, 1e-9
CHECKED = 4
"""Trials whose decisions are checked."""


def _plan(limits: dict[str, Any], sigma: float) -> Plan:
    made = changed(
        "paper-grid-same",
        min_separation_m=SEPARATION_M,
        initial_sigma={"position_m": sigma, "heading_rad": 0.05},
    ).model_dump(mode="json", exclude_none=True)
    return plan(scenario_from({**made, **({"limits": limits} if limits else {})}), pilot=False)


class _Checked:
    """Guidance of a trial, with what its decisions break."""

    def __init__(self, inside: PredictiveGuidance, step: float, run: FlightRun) -> None:
        self.inside, self.step, self.limits = inside, step, run.limits
        self.checks: list[DecisionCheck] = []

    def decide(
        self, time: float, poses: Array, winds: Array, before: Array, held: Flags, moved: Array
    ) -> Decision:
        """Decide as what is inside."""
        found = self.inside.decide(time, poses, winds, before, held, moved)
        options = PredictiveOptions()
        self.checks.append(
            check_decision(found, self.step, poses, winds, before, self.limits, options)
        )
        return found


def _broken(made: Plan, trials: int, seed: int) -> float:
    """The worst of all constraints in the decisions of the first trials, whatever its unit."""
    run = flight_run(made, guidance="mpc", trials=trials, seed=seed, hold=HOLD)
    lanes = lanes_begun(run.team, range(trials))
    assert lanes.guidance is not None
    step = max(STEP_ANGLE / run.plan.orbits.rate, PredictiveOptions().interval)
    checked = [_Checked(one, step, run) for one in lanes.guidance._guidances]
    own: Any = lanes.guidance
    own._guidances = checked
    lanes.advance(run.team.steps)
    parts = ("speed", "turn_rate", "speed_change", "turn_rate_change", "place", "heading")
    return max(float(getattr(c, part)) for one in checked for c in one.checks for part in parts)


def _line(name: str, sigma: float, trials: int, seed: int) -> list[str]:
    """Print a line of the table; return what is wrong."""
    made, options = _plan(LIMITS[name], sigma), {"trials": trials, "seed": seed, "hold": HOLD}
    figures = {
        law: fly(made, guidance=law, **options).result.figures  # type: ignore[arg-type]
        for law in ("track", "mpc")
    }
    # a vehicle that never has its phase again is last
    back = {
        law: float(np.median(np.nan_to_num(one.settled[:, 0], nan=np.inf)))
        for law, one in figures.items()
    }
    apart = {law: float(one.separations.min()) for law, one in figures.items()}
    sooner = 1.0 - back["mpc"] / back["track"]
    broken = _broken(made, min(CHECKED, trials), seed)
    wrong = []
    if not sooner >= LEAST_SOONER:
        wrong.append("not soon enough")
    if apart["mpc"] < SEPARATION_M:
        wrong.append("too near")
    if broken > MOST_BROKEN:
        wrong.append("a decision breaks a constraint")
    refused = 100.0 * figures["mpc"].refused.mean()
    print(
        f"{name:22s}  {sigma:5g}  {back['track']:7.2f}  {back['mpc']:6.2f}  "
        f"{100.0 * sooner:8.0f}  {apart['track']:9.2f}  {apart['mpc']:9.2f}  {refused:9.2f}  "
        f"{broken:7.1e}" + "".join(f"  <- {one}" for one in wrong),
        flush=True,
    )
    return wrong


def main(trials: int = 200, seed: int = 0) -> list[str]:
    """Print the table; return what is wrong."""
    print(f"v2 held for 20 s, {trials} trials each, seed {seed}")
    print(
        "limits                  start  track s   mpc s  sooner %  closest m      mpc m  "
        "refused %   breaks"
    )
    return [
        one for name in LIMITS for sigma in SIGMAS_M for one in _line(name, sigma, trials, seed)
    ]


if __name__ == "__main__":
    sys.exit(bool(main(*(int(argument) for argument in sys.argv[1:]))))
