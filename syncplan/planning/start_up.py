"""Start-up: whether the filter can be expected to reach the bound from the initial sigmas.

An index computed with the bound clears most plans, for any filter. Otherwise, the robust filter
runs unless another is asked for, and a pilot of a few trials compares the errors of the filter that
will run with those that the bound predicts.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from syncplan.arrays import Array
from syncplan.documents import DocumentPart, finite_or_none
from syncplan.errors import NoSolutionError
from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.referred_system import PosteriorBound
from syncplan.estimation.start_up_index import StartUpIndex, first_samples
from syncplan.orbits.contacts import Windows
from syncplan.orbits.noise import NO_ERRORS
from syncplan.orbits.team import Team
from syncplan.scenario.filters import AUTO, FILTERS, FilterModel

CLEARING_INDEX = 0.45
"""Largest start-up index of a plan that needs no trials."""

CLEARED_FILTER, UNCLEARED_FILTER = "ekf", "robust"
"""Names of the filters that run on cleared and on other plans, unless another is asked for."""

SAFE_RATIO = 1.5
"""Largest ratio of RMS error to prediction, of any vehicle, that counts as reaching the bound."""

PILOT_TURNS = 5
"""Largest number of periods that a pilot covers."""

PILOT_WORK_LIMIT = 3e9
"""Largest number of multiplications in a pilot: about a second, 26 vehicles with `robust`."""

_ATTEMPTS = 4
_LEAST_SHARE = 0.02


@dataclass(frozen=True, slots=True)
class StartTrials:
    """Errors in trials from the initial sigmas, with their predictions.

    Attributes
    ----------
    trials, seed : number of trials, and their seed
    duration : s, of each trial
    pilot : whether the trials are a pilot's, rather than those of a validation
    found, predicted : (n,) m, RMS position error over the second half, and the bound's; an error
        is infinite if a filter broke down
    """

    trials: int
    seed: int
    duration: float
    pilot: bool
    found: Array
    predicted: Array

    @property
    def ratios(self) -> Array:
        """(n,) ratio of the error found to that predicted; infinite if only the latter is 0."""
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = self.found / self.predicted
        return np.where(np.isnan(shares), 1.0, shares)


@dataclass(frozen=True, slots=True)
class ClearingSigmas:
    """Smaller initial sigmas, in m and rad, that the index of the same plan clears."""

    position: float
    heading: float


class InputStart(DocumentPart):
    """Start-up of the plan that was refined; see `start_up` of plans."""

    index: float
    worst_rms_over_predicted: float | None = Field(
        description="Of the pilot's worst vehicle: 1 where the index cleared the plan, null where "
        "a filter broke down"
    )

    @property
    def cleared(self) -> bool:
        """Whether the index alone cleared the plan."""
        return self.index <= CLEARING_INDEX

    @property
    def worst_ratio(self) -> float:
        """Largest ratio of error to prediction in the trials; infinite if a filter broke down."""
        worst = self.worst_rms_over_predicted
        return math.inf if worst is None else worst


@dataclass(frozen=True, slots=True)
class StartUp:
    """Whether the filter can be expected to reach the bound.

    Attributes
    ----------
    index : start-up index of the whole run
    filter : name in syncplan.scenario.filters.FILTERS of the filter that will run, or ran in trials
    trials : the pilot, or a validation's trials; None if none ran
    untried : why no pilot ran although the index does not clear the plan; else empty
    clearing : initial sigmas from which the index clears the plan; None if trials found no harm,
        or no such sigmas were found
    """

    index: StartUpIndex
    filter: str
    trials: StartTrials | None = None
    untried: str = ""
    clearing: ClearingSigmas | None = None

    @property
    def cleared(self) -> bool:
        """Whether the index alone clears the plan."""
        return self.index.value <= CLEARING_INDEX

    @property
    def worst_ratio(self) -> float:
        """Largest ratio of error to prediction in the trials; 1 if there are none."""
        return 1.0 if self.trials is None else float(self.trials.ratios.max())

    @property
    def before(self) -> InputStart | None:
        """Record of this start-up for a plan refined from this one; None if nothing was tried."""
        if self.trials is None and not self.cleared:
            return None
        return InputStart(
            index=self.index.value, worst_rms_over_predicted=finite_or_none(self.worst_ratio)
        )


def start_up_of(
    team: Team,
    windows: Windows,
    duration: float,
    bound: PosteriorBound,
    *,
    asked: str | None,
    pilot: bool,
) -> StartUp | None:
    """Return the start-up verdict, by index and pilot, on a run of `duration` s with its bound.

    `asked` names the filter that is asked for; AUTO or None if none is. Without `pilot`, the
    verdict rests on the index alone. Returns None if the bound has no index.
    """
    index = bound.start_up
    if index is None:
        return None
    found = StartUp(index, asked if asked not in (None, AUTO) else _filter_for(index))
    if found.cleared:
        return found
    if not pilot:
        return replace(found, untried="trials were left out, as in quick previews")
    from syncplan.estimation.pilot import pilot_work

    length = min(duration, PILOT_TURNS * team.orbits.period)
    if pilot_work(team, windows, length, FILTERS[found.filter]) > PILOT_WORK_LIMIT:
        return replace(found, untried=f"a pilot of {team.count} vehicles takes over a second")
    trials = _piloted(team, windows, length, bound, FILTERS[found.filter])
    if trials is None:
        return replace(found, untried="the run is too short for a pilot")
    return concluded(found, trials, team, windows, duration)


def concluded(
    found: StartUp, trials: StartTrials, team: Team, windows: Windows, duration: float
) -> StartUp:
    """Return the verdict with these trials and a cure for harm; the index covers `duration` s."""
    found = replace(found, trials=trials, untried="", clearing=None)
    if found.worst_ratio <= SAFE_RATIO:
        return found
    # the index covers no more than this
    length = min(duration, first_samples(team) * team.sensors.sample_time)
    return replace(found, clearing=_clearing(team, windows, length, found.index.value))


def _filter_for(index: StartUpIndex) -> str:
    return CLEARED_FILTER if index.value <= CLEARING_INDEX else UNCLEARED_FILTER


def _piloted(
    team: Team, windows: Windows, length: float, bound: PosteriorBound, model: FilterModel
) -> StartTrials | None:
    from syncplan.estimation.pilot import PILOT_SEED, PILOT_TRIALS, pilot_squares
    from syncplan.estimation.pilot_readings import thinned

    thin = thinned(team)
    if length < 2.0 * thin.sensors.sample_time:
        return None
    squares = pilot_squares(thin, windows, length, model)
    if bound.errors is not None:
        # the pilot leaves out bias states, so its prediction does too
        bound = posterior_bound(replace(team, errors=NO_ERRORS), windows, length)
    return StartTrials(
        trials=PILOT_TRIALS,
        seed=PILOT_SEED,
        duration=length,
        pilot=True,
        found=np.sqrt(squares.mean(axis=0)),
        predicted=bound.until(length / team.sensors.sample_time).rms_second_half(),
    )


def _clearing(team: Team, windows: Windows, duration: float, index: float) -> ClearingSigmas | None:
    """Both sigmas scaled alike, to two digits; the index falls about in proportion."""
    share, noise = 1.0, team.noise
    for _ in range(_ATTEMPTS):
        share *= 0.95 * CLEARING_INDEX / index
        if share < _LEAST_SHARE:
            return None
        smaller = replace(
            noise,
            position_sigma=_two_digits(share * noise.position_sigma),
            heading_sigma=_two_digits(share * noise.heading_sigma),
        )
        try:
            bound = posterior_bound(replace(team, noise=smaller), windows, duration, start_up=True)
        except NoSolutionError:
            return None
        assert bound.start_up is not None
        index = bound.start_up.value
        if index <= CLEARING_INDEX:
            return ClearingSigmas(smaller.position_sigma, smaller.heading_sigma)
    return None


def _two_digits(value: float) -> float:
    return float(f"{value:.2g}")
