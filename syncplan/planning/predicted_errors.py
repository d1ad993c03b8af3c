"""What the bounds predict of positions and of further states, and what neglected errors cost."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import NoSolutionError
from syncplan.estimation.considered_errors import expected_errors, neglected_errors
from syncplan.estimation.referred_system import PosteriorBound
from syncplan.orbits.contacts import Windows
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.team import Team


@dataclass(frozen=True, slots=True)
class PredictedState:
    """A state of the filter that is no pose.

    Attributes
    ----------
    label : what it is, `wind x` or `speed scale of v1`
    unit : in words
    sigma : its standard deviation before anything is seen
    rms : predicted RMS error over the second half of the run, along circles flown in still air
    """

    label: str
    unit: str
    sigma: float
    rms: float


@dataclass(frozen=True, slots=True)
class Neglect:
    """What errors that the filter does not estimate are expected to cost.

    Attributes
    ----------
    names : of the errors, as in ERROR_STATES
    expected : (n,) m, RMS position errors over the second half of the run; None where the
        covariance did not stay positive definite
    """

    names: tuple[str, ...]
    expected: Array | None

    @property
    def expected_of_all(self) -> float | None:
        """RMS over the vehicles of what is expected, in m; None where that is."""
        return None if self.expected is None else float(np.sqrt(np.mean(self.expected**2)))


@dataclass(frozen=True, slots=True)
class Prediction:
    """Predicted position errors in m, from the posterior Cramer-Rao bound.

    Attributes
    ----------
    rms : (n,) over the second half of the run, or None where not computed
    steady : (n,) over a period once periodic, infinite if it never is; None where not asked for
    window : (n,) bound from one window without motion noise; NaN where not determined
    note : why a figure is missing
    states : of the filter that are no poses; empty where there are none or no bound is computed
    neglect : what is to be expected instead, as the filter leaves errors out; None where it leaves
        out none or no bound is computed
    """

    rms: Array | None
    steady: Array | None
    window: Array
    note: str
    states: tuple[PredictedState, ...] = ()
    neglect: Neglect | None = None


def predicted_states(
    team: Team, bound: PosteriorBound, names: Sequence[str]
) -> tuple[PredictedState, ...]:
    """Return what a bound says of further states, of vehicles with these names."""
    layout = layout_of(team)
    return tuple(
        PredictedState(*one)
        for one in zip(
            layout.labels(names),
            layout.units,
            layout.sigmas.tolist(),
            bound.errors_second_half().tolist(),
            strict=True,
        )
    )


def expected_in_world(team: Team, true: Team, windows: Windows, duration: float) -> Array | None:
    """Return (n,) m what the filter of a team makes of the true world, second half of a run.

    `windows` are the contacts there. None where that is not computed.
    """
    try:
        return expected_errors(team, windows, duration, true=true).rms_second_half()
    except NoSolutionError:
        return None


def neglect_of(team: Team, windows: Windows, duration: float) -> Neglect | None:
    """Return what errors that the filter leaves out cost in a run of `duration` s; None if none."""
    names = neglected_errors(team)
    if not names:
        return None
    try:
        return Neglect(names, expected_errors(team, windows, duration).rms_second_half())
    except NoSolutionError:
        return Neglect(names, None)
