"""Search for a validation that misjudges the filter.

A number is the seed of two validations of the paper's grid, same sense: of the filter as it is,
which is consistent, and of one that takes every sigma of sensors, motion and start for 20 % smaller
than it is, whose ANEES is 1 / 0.8^2 = 1.56 times as large. Fails where over 5 % of the first are
not consistent, or one of the others is not optimistic. Beside the verdicts stands how far ANEES
spreads from seed to seed, and what two intervals make of it: that of the spread over trials, which
reports state, and that of chi-square tables.
"""

from collections.abc import Mapping
from dataclasses import fields, replace
from functools import cache
from typing import NamedTuple

import numpy as np

from syncplan.estimation.consistency import Consistency, chi_square_band
from syncplan.estimation.montecarlo import run_trials
from syncplan.orbits.team import Team
from syncplan.planning.plans import Plan
from syncplan.planning.validation import trial_run
from tests.searches import Search, most_of
from tests.tools.on_paper import plan
from tests.tools.scenarios import example

TOO_SMALL = 0.8
MOST_MISJUDGED = 0.05
TRIALS = 200


class Judged(NamedTuple):
    """ANEES of the filter as it is, and of one with sigmas too small."""

    as_it_is: Consistency
    too_sure: Consistency


def believing(team: Team, factor: float) -> Team:
    """Return a team whose sigmas are all `factor` times those of `team`."""
    sigmas = {sigma.name: factor * getattr(team.noise, sigma.name) for sigma in fields(team.noise)}
    return replace(
        team,
        noise=type(team.noise)(**sigmas),
        sensors=replace(team.sensors, bearing_sigmas=factor * team.sensors.bearing_sigmas),
    )


@cache
def _grid() -> Plan:
    return plan(example("paper-grid-same"))


def _reported(believed: Team, seed: int) -> Consistency:
    """ANEES of a validation of a filter that takes the sigmas of `believed` for true."""
    run = trial_run(_grid(), trials=TRIALS, seed=seed)
    part = run_trials(
        _grid().team, run.sightings, run.steps, run.options, believed=believed, threads=1
    )
    return run.concluded([part]).anees


def draw(number: int) -> tuple[list[str], Judged]:
    """Return what a validation of each filter reports, a fault where it overlooks small sigmas."""
    team = _grid().team
    judged = Judged(_reported(team, number), _reported(believing(team, TOO_SMALL), number))
    verdict = judged.too_sure.verdict
    return [] if verdict == "optimistic" else [f"sigmas 20 % too small: {verdict}"], judged


def judge(cases: Mapping[int, Judged], chance: float) -> list[str]:
    """Print ANEES of both filters; return whether too many validations misjudge the first."""
    true, sure = ([case[k] for case in cases.values()] for k in (0, 1))
    for name, reports, wanted in (
        ("sigmas as they are", true, "consistent"),
        ("sigmas 20 % too small", sure, "optimistic"),
    ):
        print(
            f"{name}: {sum(anees.verdict == wanted for anees in reports)} of {len(reports)} "
            f"validations of {TRIALS} trials {wanted}; mean ANEES "
            f"{np.mean([anees.value for anees in reports]):.3f}, intervals from "
            f"{min(anees.band[0] for anees in reports):.3f} to "
            f"{max(anees.band[1] for anees in reports):.3f}"
        )
    print(_widths(true))
    misjudged = sum(anees.verdict != "consistent" for anees in true)
    most = most_of(len(true), MOST_MISJUDGED, chance)
    if misjudged > most:
        return [f"{misjudged} of the filter as it is not consistent, at most {most:.3g} may be"]
    return []


def _widths(reports: list[Consistency]) -> str:
    spread = 1.96 * np.std([anees.value for anees in reports], ddof=min(1, len(reports) - 1))
    stated = np.mean([(anees.band[1] - anees.band[0]) / 2.0 for anees in reports])
    low, high = chi_square_band(3 * _grid().team.count * TRIALS)
    return (
        f"half of the width that holds 95 % of ANEES: {spread:.4f} from seed to seed, "
        f"{stated:.4f} by the spread over trials, {(high - low) / 2.0:.4f} by chi-square tables"
    )


SEARCH = Search(draw, judge, draws=10)
