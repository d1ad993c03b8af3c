"""Search for a validation that misjudges the filter.

    python -m tests.searches.search_consistency [VALIDATIONS [FIRST_SEED [TRIALS]]]

Part of `make check-all`. Each seed gives two validations of the paper's
grid, same sense: of the filter as it is, which is consistent, and of one that takes every sigma of
sensors, motion and start for 20 % smaller than it is, whose ANEES is 1 / 0.8^2 = 1.56 times as
large. Beside the verdicts stands how far ANEES spreads from seed to seed, and what two intervals
make of it: that of the spread over trials, which reports state, and that of chi-square tables.
"""

import sys
from dataclasses import fields, replace

import numpy as np

from syncplan.estimation.consistency import chi_square_band
from syncplan.estimation.montecarlo import run_trials
from syncplan.orbits.team import Team
from syncplan.planning.planner import Plan, plan
from syncplan.planning.validation import Validation, conclude, trial_run
from tests.tools.scenarios import example

TOO_SMALL = 0.8
MOST_MISJUDGED = 0.05


def believing(team: Team, factor: float) -> Team:
    """Return a team whose sigmas are all `factor` times those of `team`."""
    noise = {one.name: factor * getattr(team.noise, one.name) for one in fields(team.noise)}
    return replace(
        team,
        noise=type(team.noise)(**noise),
        sensors=replace(team.sensors, bearing_sigmas=factor * team.sensors.bearing_sigmas),
    )


def reported(flown: Plan, believed: Team, seed: int, trials: int) -> Validation:
    """Return a validation of a filter that takes the sigmas of `believed` for true."""
    run = trial_run(flown, trials=trials, seed=seed)
    part = run_trials(flown.team, run.sightings, run.steps, run.options, believed=believed)
    return conclude(run, [part])


def main(validations: int = 40, first_seed: int = 1, trials: int = 200) -> bool:
    """Print what validations say of both filters; return whether they misjudge neither.

    At most 5 % of the first are not consistent, and all others are optimistic.
    """
    flown, passed = plan(example("paper-grid-same")), True
    seeds = range(first_seed, first_seed + validations)
    true, sure = (
        [reported(flown, believed, seed, trials) for seed in seeds]
        for believed in (flown.team, believing(flown.team, TOO_SMALL))
    )
    for name, runs, wanted, most_misjudged in (
        ("sigmas as they are", true, "consistent", MOST_MISJUDGED),
        ("sigmas 20 % too small", sure, "optimistic", 0.0),
    ):
        low, high = min(one.anees.band[0] for one in runs), max(one.anees.band[1] for one in runs)
        found = sum(one.anees.verdict == wanted for one in runs)
        passed &= len(runs) - found <= most_misjudged * len(runs)
        print(
            f"{name}: {found} of {len(runs)} validations of {trials} trials "
            f"{wanted}; mean ANEES {np.mean([one.anees.value for one in runs]):.3f}, "
            f"intervals from {low:.3f} to {high:.3f}"
        )
    print(_widths(true, trials))
    return passed


def _widths(runs: list[Validation], trials: int) -> str:
    spread = 1.96 * np.std([one.anees.value for one in runs], ddof=1)
    stated = np.mean([(one.anees.band[1] - one.anees.band[0]) / 2.0 for one in runs])
    low, high = chi_square_band(3 * runs[0].plan.orbits.count * trials)
    return (
        f"half of the width that holds 95 % of ANEES: {spread:.4f} from seed to seed, "
        f"{stated:.4f} by the spread over trials, {(high - low) / 2.0:.4f} by chi-square tables"
    )


if __name__ == "__main__":
    sys.exit(not main(*(int(argument) for argument in sys.argv[1:])))
