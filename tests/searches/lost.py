"""Search for trials that a filter loses, from starts of several sizes: the table of all filters.

Certified teams of 2 to 8 vehicles are drawn whose bound from 30 m is at most 5 m for each vehicle:
what is hardly observed is no place to be lost from. Each is flown by filters from initial sigmas,
with the same draws: 5 m and 0.1 rad, 15 m and 0.3 rad, 30 m and 0.6 rad, 50 m and 1 rad. A trial is
lost where some vehicle's RMS error of the second half is over 5 times its bound. `lost` has the
filters and sigmas with limits alone, `lost.all` all of them, `lost.hardly` teams drawn without the
condition on the bound.

Fails where `second-order` loses over 0.5 % at 5 m or `robust` loses over 0.2 % at 15 or 30 m, where
then a vehicle's RMS over all trials is over twice its bound, or where ANEES is outside 0.95 to 1.1.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.trial_readings import possible_sightings
from syncplan.orbits.sightings import steps_within
from syncplan.orbits.team import Team
from syncplan.planning.plans import Plan
from syncplan.scenario.filters import FILTERS
from tests.searches import Search, most_of, outside
from tests.tools.scenario_draws import certified_plans, draw_document

TRIALS = 50


class Start(NamedTuple):
    """A filter, and its initial sigma in m."""

    filter: str
    sigma: float


HEADINGS = {5.0: 0.1, 15.0: 0.3, 30.0: 0.6, 50.0: 1.0}
"""rad of initial sigma for each position's in m."""

LIMITS = {
    Start("second-order", 5.0): 0.005,
    Start("robust", 15.0): 0.002,
    Start("robust", 30.0): 0.002,
}
"""Largest share of trials that may be lost."""

LOST, OVER = 5.0, 2.0
LEAST_ANEES, LARGEST_ANEES = 0.95, 1.1

OBSERVED_FROM, OBSERVED = 30.0, 5.0
"""m: from this initial sigma each vehicle's bound is at most so much."""


class Flown(NamedTuple):
    """What a filter made of a scenario from an initial sigma.

    Number of trials lost; largest RMS of a vehicle over its bound; ANEES.
    """

    lost: int
    worst: float
    anees: float


def draw_plan(number: int, *, hardly: bool = False) -> Plan:
    """Return the plan of a certified scenario whose vehicles may be `hardly` observed."""
    generator = np.random.default_rng([0, number, 16016])
    return next(
        drawn
        for drawn in certified_plans(lambda: draw_document(generator, 5.0), bound="always")
        if hardly or np.max(_bound(started(drawn, OBSERVED_FROM), drawn)) <= OBSERVED
    )


def started(drawn: Plan, sigma: float) -> Team:
    """Return the team with an initial sigma in m, of HEADINGS, and its heading's."""
    noise = replace(drawn.noise, position_sigma=sigma, heading_sigma=HEADINGS[sigma])
    return replace(drawn.team, noise=noise)


def _bound(team: Team, drawn: Plan) -> Array:
    """(n,) m, the bound's RMS over the second half."""
    return posterior_bound(team, drawn.windows, drawn.scenario.duration_s).rms_second_half()


def draw(
    number: int, starts: Sequence[Start] = tuple(LIMITS), *, hardly: bool = False
) -> tuple[list[str], dict[Start, Flown]]:
    """Return what the filters made of a scenario, a fault where a vehicle is far off its bound."""
    drawn = draw_plan(number, hardly=hardly)
    steps = steps_within(drawn.scenario.duration_s, drawn.sensors.sample_time)
    seen = possible_sightings(drawn.team, drawn.windows, steps)
    faults, figures = [], {}
    for start in starts:
        team = started(drawn, start.sigma)
        bound = _bound(team, drawn)
        options = FilterOptions(trials=TRIALS, seed=1, filter=start.filter)
        result = run_trials(team, seen, steps, options, threads=1)
        squares = result.late_mean_squares[..., :2].sum(axis=-1)
        squares[~np.isfinite(squares)] = np.inf
        lost = int(np.any(np.sqrt(squares) > LOST * bound, axis=1).sum())
        worst = float(np.max(np.sqrt(squares.mean(axis=0)) / bound))
        figures[start] = Flown(lost, worst, float(np.nanmean(result.nees)) / (3 * team.count))
        if start in LIMITS and worst > OVER:
            faults.append(f"{_name(start)}: RMS {worst:.2f} times the bound, {lost} trials lost")
    return faults, figures


def _name(start: Start) -> str:
    return f"{start.filter} from {start.sigma:g} m"


def judge(cases: Mapping[int, Mapping[Start, Flown]], chance: float) -> list[str]:
    """Print the table of filters; return where they lose more than they may."""
    print("   sigma  filter         lost           over 2  worst RMS/bound      ANEES")
    faults = []
    trials = TRIALS * len(cases)
    for start in next(iter(cases.values())):
        flown = [case[start] for case in cases.values()]
        lost, worst = sum(each.lost for each in flown), [each.worst for each in flown]
        anees = [each.anees for each in flown]
        print(
            f"{start.sigma:>6g} m  {start.filter:<13}{lost:>6} ({lost / trials:6.2%})"
            f"{sum(ratio > OVER for ratio in worst):>8}{max(worst):>17.3f}{np.mean(anees):>11.3f}"
        )
        if start not in LIMITS:
            continue
        if lost > (most := most_of(trials, LIMITS[start], chance)):
            faults.append(f"{_name(start)}: {lost} of {trials} trials lost, at most {most:.3g} may")
        if outside(anees, LEAST_ANEES, LARGEST_ANEES, chance):
            faults.append(f"{_name(start)}: ANEES {np.mean(anees):.3f}")
    return faults


EVERY = tuple(Start(name, sigma) for sigma in HEADINGS for name in FILTERS)
FAR = Start("robust", 30.0), Start("robust", 50.0)

SEARCH = Search(draw, judge, draws=21)
ALL = Search(partial(draw, starts=EVERY), judge, draws=40)
HARDLY = Search(partial(draw, starts=FAR, hardly=True), judge, draws=40)
