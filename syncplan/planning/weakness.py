"""Weakness: whether full rank determines positions well enough for a filter, and its cure.

A filter linearises each sighting at its estimate. One window leaves w m of a position unknown, the
window bound; a run of K windows with the predicted error p leaves at most p sqrt(K) in each. So
estimates may wander by

    v = min(w, p sqrt(K))

along a direction that a window hardly determines. A displacement by v changes the sightings of a
window by up to s v / R of their standard deviations, with the largest singular value s of the
windowed matrix in mean radii R. What the tangent leaves out is smaller by v / R once more:

    index = s (v / R)^2

Where it is large, the filter counts changes of its tangent as information that no sighting holds,
and misses its bound. This supposes circles flown exactly. tests/searches/weak.py shows how well the
index separates teams.
"""

from bisect import bisect_left
from functools import partial

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.bounds import window_bound
from syncplan.observability.rank import assess_team
from syncplan.observability.spectrum import Observability
from syncplan.orbits.team import team_of
from syncplan.planning.rule_orbits import RuleOrbits, rule_orbits
from syncplan.scenario.specification import Scenario

WEAK_INDEX = 120.0
"""Largest index of a vehicle whose position is determined well enough, by drawn teams."""

CURED_INDEX = 80.0
"""Largest index after a cure, which leaves room for errors of the orbits."""

LARGEST_CONDITION_NUMBER = 1e6
"""Condition number of the windowed matrix above which full rank rests on noise-free geometry."""

LEAST_RAD = 0.01
"""Smallest desynchronisation that is offered."""

_STEPS_RAD = (0.1, 0.2, 0.4, 0.8)


def weakness(
    observability: Observability, predicted: Array | None = None, windows: float = np.inf
) -> Array:
    """Return (n,) the index of each vehicle of an observable team.

    `predicted` is (n,) m, the RMS error over the second half of a run that is so many `windows`
    long; without it, the index is that of a run of any length.
    """
    wander = window_bound(observability)
    if predicted is not None:
        wander = np.minimum(wander, predicted * np.sqrt(windows))
    return np.asarray(observability.singular_values[0] * (wander / observability.scale) ** 2)


def is_weak(
    observability: Observability, predicted: Array | None = None, windows: float = np.inf
) -> bool:
    """Return whether an observable team is weakly so; the arguments are those of `weakness`."""
    if observability.condition_number > LARGEST_CONDITION_NUMBER:
        return True
    return bool(weakness(observability, predicted, windows).max() > WEAK_INDEX)


def windows_of(scenario: Scenario) -> float:
    """Return how many windows the run of a scenario is long."""
    return scenario.duration_s / scenario.window


def least_desync(scenario: Scenario) -> float | None:
    """Return the least orbit.desync_rad, rad to two digits, that makes the team well observable.

    The team planned with it is observable, with an index of at most CURED_INDEX in a run of any
    length. None if no offset up to 0.8 rad does.
    """
    try:
        exact = rule_orbits(scenario, margin_bound=False)
    except (InputError, NoSolutionError):
        return None
    if np.ptp(exact.orbits.senses) == 0.0:
        return None  # a common offset turns the team as a whole
    low = LEAST_RAD
    for high in _STEPS_RAD:
        if _well_observable(scenario, exact, high):
            sizes = _two_digits(low, high)
            return sizes[bisect_left(sizes, True, key=partial(_well_observable, scenario, exact))]
        low = high
    return None


def _well_observable(scenario: Scenario, exact: RuleOrbits, offset: float) -> bool:
    """Whether a team off the rules by `offset` rad is observable, with an index as after a cure."""
    team = team_of(scenario, exact.desynchronised(offset))
    verdict = assess_team(team, scenario.window).observability
    return not is_weak(verdict) and bool(weakness(verdict).max() <= CURED_INDEX)


def _two_digits(low: float, high: float) -> list[float]:
    """Numbers of two digits from `low` to `high`, both within one decade."""
    unit = 1000 if low < 0.1 else 100
    return [number / unit for number in range(round(low * unit), round(high * unit) + 1)]
