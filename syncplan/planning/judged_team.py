"""A team on its orbits with all that was found of it: distances, predicted errors, findings."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, Self

import numpy as np
from pydantic import Field

from syncplan.arrays import Array
from syncplan.documents import DocumentPart
from syncplan.errors import NoSolutionError
from syncplan.estimation.considered_errors import expected_errors, neglected_errors
from syncplan.estimation.referred_system import PosteriorBound
from syncplan.observability.error_modes import ErrorVerdict
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.observability.rank import Certificate, Observability
from syncplan.observability.unobservable_modes import UnobservableMode
from syncplan.orbits.contacts import Approach, Windows
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.sightings import Loss
from syncplan.orbits.team import Team, WithTeam, true_team_of
from syncplan.placement.centers import Placement
from syncplan.planning.plan_records import FlownPlan, RefinementRecord
from syncplan.planning.start_up import StartUp
from syncplan.scenario.specification import Scenario
from syncplan.synchronisation.phases import Synchronisation

# --- least distances ------------------------------------------------------------------------------
#
# One rule for the verdict, which judges it, and for refinement, which keeps it.


TOLERANCE = 1e-6
"""Share of a limit by which it may be missed and still be met: what a solver's accuracy leaves."""

TOO_NEAR = 0.1
"""Share of the mean radius below which a distance is too small where no least one is stated."""


@dataclass(frozen=True, slots=True)
class DistanceLimit:
    """A least distance.

    Attributes
    ----------
    key : of the scenario, which states it
    stated : m; None where the scenario does not state it
    """

    key: str
    stated: float | None

    def least(self, radii: Array) -> float:
        """Return the least distance in m, for a team of circles of `radii` (n,) m."""
        return TOO_NEAR * float(radii.mean()) if self.stated is None else self.stated

    def worded(self, radii: Array) -> str:
        """Return the limit in words."""
        if self.stated is not None:
            return f"{self.key} {self.stated:g}"
        least = self.least(radii)
        return f"{least:.4g} m, a tenth of the mean radius, as no {self.key} is stated"


def separation_limit(scenario: Scenario) -> DistanceLimit:
    """Return how near two vehicles may come to each other."""
    return DistanceLimit("min_separation_m", scenario.min_separation_m)


def landmark_limit(scenario: Scenario) -> DistanceLimit:
    """Return how near a vehicle may come to a landmark."""
    return DistanceLimit("landmark_clearance_m", scenario.landmark_clearance_m)


# --- predicted errors -----------------------------------------------------------------------------


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
    """Expected cost of errors that the filter does not estimate.

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
    """Return the bound's figures of further states, of vehicles with these names."""
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
    """Return the cost of errors that the filter leaves out over `duration` s; None if none."""
    names = neglected_errors(team)
    if not names:
        return None
    try:
        return Neglect(names, expected_errors(team, windows, duration).rms_second_half())
    except NoSolutionError:
        return Neglect(names, None)


# --- findings and the verdict ---------------------------------------------------------------------


Level = Literal["stop", "warning", "note"]

MOST_NAMED = 5
"""Findings of one code, or subjects of one finding, that are worded one by one; the rest is
counted."""


class FindingCure(DocumentPart):
    """What would remedy a finding."""

    text: str
    change: Mapping[str, float | str] = Field(
        description="Keys of the scenario, dotted, with the values that cure it; empty where a "
        "person has to choose"
    )


@dataclass(frozen=True, slots=True)
class Remark:
    """What a check finds: its figures in a sentence, and what would remedy it, if known.

    The attributes are those of PlanFinding; its code is the check's. A cure that no key of the
    scenario brings is a text.
    """

    level: Level
    message: str
    subjects: tuple[str, ...] = ()
    cure: FindingCure | str | None = field(default=None, kw_only=True)


class PlanFinding(DocumentPart):
    """One thing that speaks against flying the plan, or has to be known of it."""

    code: str = Field(
        description="Stable word by which software knows the finding", examples=["unobservable"]
    )
    level: Level
    message: str
    subjects: tuple[str, ...] = Field(description="Names of the vehicles and landmarks concerned")
    cure: FindingCure | None

    @classmethod
    def of(cls, code: str, one: Remark) -> Self:
        """Return the finding that the check of this code remarks on."""
        cure = FindingCure(text=one.cure, change={}) if isinstance(one.cure, str) else one.cure
        return cls(
            code=code, level=one.level, message=one.message, subjects=one.subjects, cure=cure
        )


class PlanVerdict(DocumentPart):
    """Whether the plan can be flown: go is false exactly where a finding is a stop."""

    go: bool
    findings: tuple[PlanFinding, ...]

    @classmethod
    def of(cls, findings: Iterable[PlanFinding]) -> Self:
        """Return the verdict on what was found, in the order of the checks."""
        found = tuple(findings)
        return cls(go=all(one.level != "stop" for one in found), findings=found)

    @property
    def stops(self) -> tuple[PlanFinding, ...]:
        """The findings that stop the flight."""
        return tuple(one for one in self.findings if one.level == "stop")

    @property
    def headline(self) -> str:
        """GO, or NO-GO with the number of reasons."""
        stops = len(self.stops)
        return f"NO-GO: {stops} reason{'s' if stops > 1 else ''}" if stops else "GO"


# --- the team -------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class UnmetLink:
    """A listed link, between vehicles `a` < `b`, that never comes into contact, and why."""

    a: int
    b: int
    reason: str


@dataclass(frozen=True, slots=True, repr=False)
class JudgedTeam(WithTeam):
    """A team with all that the exact code found of it; what a verdict rests on.

    Attributes
    ----------
    scenario : as resolved
    team, windows : what the judgement rests on
    synchronisation : how the phases were found; None for a plan whose phases were given
    alternating_proven : whether the number of alternating links is proven largest; None where
        the senses were given
    links, incidental_links, landmark_links : verdicts on the links listed that meet, on other
        pairs that meet, and on vehicles with the landmarks they see
    dropped_links : listed links that never meet
    connectivity_period : s, None if no window of two periods certifies the team
    approach : the closest two vehicles come; None for one vehicle
    too_close : pairs of vehicles that come nearer than they may, nearest first
    observability, certificate : over the scenario's window
    unobservable : a named mode for each dimension that the rank lacks
    prediction : errors that the bounds predict
    error_verdict : what the window determines of errors that the filter estimates; None where it
        estimates none
    single_points : what ends observability when it alone is lost; None where not looked for
    refinement : how the plan was refined, or why it could not be; None if that was not tried
    placement : how the centres were found; None where they were given or the plan is a file's
    centres_placed : whether the plan's file says that placement found the centres
    start_up : whether the filter can be expected to reach the bound; None where no bound was
        computed, or the team is not observable
    flight : what flying the plan has found; None where it was not flown
    """

    scenario: Scenario
    team: Team
    windows: Windows
    synchronisation: Synchronisation | None
    alternating_proven: bool | None
    links: tuple[LinkVerdict, ...]
    incidental_links: tuple[LinkVerdict, ...]
    landmark_links: tuple[LinkVerdict, ...]
    dropped_links: tuple[UnmetLink, ...]
    connectivity_period: float | None
    approach: Approach | None
    too_close: tuple[Approach, ...]
    observability: Observability
    certificate: Certificate
    unobservable: tuple[UnobservableMode, ...]
    prediction: Prediction
    error_verdict: ErrorVerdict | None = None
    single_points: tuple[Loss, ...] | None = ()
    refinement: RefinementRecord | None = None
    placement: Placement | None = None
    centres_placed: bool = False
    start_up: StartUp | None = None
    flight: FlownPlan | None = None

    @property
    def true_team(self) -> Team:
        """The team of the simulated world: its own, or with the scenario's truth."""
        return true_team_of(self.scenario, self.team)
