"""Judged team: a team on its orbits with least distances, predicted errors and findings."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from pydantic import Field

from syncplan.arrays import Array
from syncplan.documents import Document, DocumentPart, OrAbsent
from syncplan.errors import NoSolutionError
from syncplan.estimation.considered_errors import expected_errors, neglected_errors
from syncplan.estimation.referred_system import PosteriorBound
from syncplan.estimation.start_up_index import StartUpIndex
from syncplan.observability.error_modes import ErrorVerdict
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.observability.rank import Certificate
from syncplan.observability.spectrum import Observability
from syncplan.observability.unobservable_modes import UnobservableMode
from syncplan.orbits.contacts import Approach, Windows
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.sightings import Loss
from syncplan.orbits.team import Team, WithTeam, true_team_of
from syncplan.planning.plan_records import FlownPlan, RefinementRecord
from syncplan.results.quantities import plain
from syncplan.scenario.areas import Area
from syncplan.scenario.purposes import PurposeMeasure
from syncplan.scenario.specification import Scenario
from syncplan.synchronisation.phases import Synchronisation

if TYPE_CHECKING:
    from syncplan.placement.centers import Placement

# --- least distances ------------------------------------------------------------------------------
#
# One rule for both: the verdict judges it, and refinement keeps it. So is the purpose.


TOLERANCE = 1e-6
"""Share of a limit by which missing it still counts as meeting it, given a solver's accuracy."""

TOO_NEAR = 0.1
"""Share of the mean radius below which a distance is too small if no least one is stated."""


@dataclass(frozen=True, slots=True)
class DistanceLimit:
    """Least distance allowed.

    Attributes
    ----------
    key : key of the scenario that states it
    stated : m; None if the scenario does not state it
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
    """Return the least distance allowed between two vehicles."""
    return DistanceLimit("min_separation_m", scenario.min_separation_m)


def landmark_limit(scenario: Scenario) -> DistanceLimit:
    """Return the least distance allowed between a vehicle and a landmark."""
    return DistanceLimit("landmark_clearance_m", scenario.landmark_clearance_m)


# --- the purpose ----------------------------------------------------------------------------------


def purpose_measure(scenario: Scenario, points: int = 0) -> PurposeMeasure | None:
    """Return the measure of a scenario's purpose, with a grid of so many points; None without."""
    if scenario.purpose is None:
        return None
    area = Area.of(scenario.area_m, scenario.keep_out_m)
    return PurposeMeasure.of(scenario.purpose, area, points)


# --- predicted errors -----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class PredictedState:
    """State of the filter other than a pose, with its predicted error.

    Attributes
    ----------
    label : name, such as `wind x` or `speed scale of v1`
    unit : in words
    sigma : standard deviation before the first sighting
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
    names : names of the errors, as in ERROR_STATES
    expected : (n,) m, RMS position errors over the second half of the run; None if the covariance
        did not stay positive definite
    """

    names: tuple[str, ...]
    expected: Array | None

    @property
    def expected_of_all(self) -> float | None:
        """RMS of the expected errors over all vehicles, in m; None if there are none."""
        return None if self.expected is None else float(np.sqrt(np.mean(self.expected**2)))


@dataclass(frozen=True, slots=True)
class Prediction:
    """Predicted position errors in m, from the posterior Cramer-Rao bound.

    Attributes
    ----------
    rms : (n,) over the second half of the run; None if not computed
    steady : (n,) over a period once periodic, infinite if it never is; None if not asked for
    window : (n,) bound from one window without motion noise; NaN where not determined
    note : why a figure is missing, or what the figures suppose
    states : filter states other than poses; empty if there are none or no bound is computed
    neglect : errors expected instead, as the filter leaves errors out; None if it leaves out none
        or no exact bound is computed
    """

    rms: Array | None
    steady: Array | None
    window: Array
    note: str
    states: tuple[PredictedState, ...] = ()
    neglect: Neglect | None = None


BOUND_WORK_LIMIT = 4e10
"""Steps times squared state dimension times vehicles up to which `auto` computes the bound."""


def bound_is_affordable(team: Team, duration: float) -> bool:
    """Return whether the posterior bound is cheap enough to be computed by default."""
    steps = duration / team.sensors.sample_time
    size = float(layout_of(team, tuple(ERROR_STATES)).size)
    return steps * size**2 * team.count <= BOUND_WORK_LIMIT


def predicted_states(
    team: Team, bound: PosteriorBound, names: Sequence[str]
) -> tuple[PredictedState, ...]:
    """Return the bound's figures of states other than poses; `names` are those of vehicles."""
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
    """Return (n,) m expected RMS errors of a team's filter in the true world, second half of a run.

    `windows` are the contact windows there. None if the errors are not computed.
    """
    try:
        return expected_errors(team, windows, duration, true=true).rms_second_half()
    except NoSolutionError:
        return None


def neglect_of(team: Team, windows: Windows, duration: float) -> Neglect | None:
    """Return the cost over `duration` s of errors that the filter leaves out; None if none."""
    names = neglected_errors(team)
    if not names:
        return None
    try:
        return Neglect(names, expected_errors(team, windows, duration).rms_second_half())
    except NoSolutionError:
        return Neglect(names, None)


# --- findings and the verdict ---------------------------------------------------------------------


Level = Literal["stop", "warning", "note"]
"""Of a finding, the gravest first."""

_COLOURS = {"stop": "red", "warning": "yellow", "note": "cyan"}

MOST_NAMED = 5
"""Findings of one code, or subjects of one finding, that are listed; the rest are counted."""


class FindingCure(DocumentPart):
    """Remedy for a finding."""

    text: str
    change: Mapping[str, float | str] = Field(
        description="Keys of the scenario, dotted, with the values that cure it; empty where a "
        "person has to choose"
    )


@dataclass(frozen=True, slots=True)
class Remark:
    """Result of a check: its figures in a sentence, and a cure if one is known.

    The attributes are those of PlanFinding; its code is the check's. A cure that changes no key of
    the scenario is a plain text.
    """

    level: Level
    message: str
    subjects: tuple[str, ...] = ()
    cure: FindingCure | str | None = field(default=None, kw_only=True)


class PlanFinding(DocumentPart):
    """Reason against flying the plan, or a fact to know about it."""

    code: str = Field(description="Stable identifier of the finding", examples=["unobservable"])
    level: Level
    message: str
    subjects: tuple[str, ...] = Field(description="Names of the vehicles and landmarks concerned")
    cure: FindingCure | None

    @classmethod
    def of(cls, code: str, one: Remark) -> Self:
        """Return the finding for a remark of the check with this code."""
        cure = FindingCure(text=one.cure, change={}) if isinstance(one.cure, str) else one.cure
        return cls(
            code=code, level=one.level, message=one.message, subjects=one.subjects, cure=cure
        )


class VerdictBasis(DocumentPart):
    """Basis of a verdict: flights, or geometry, rank and prediction alone."""

    kind: Literal["paper", "flown"]
    flights: int = Field(description="Number of flights; 0 on paper")
    seed: int | None = Field(description="Of the flights; null on paper")
    digest: str | None = Field(
        description="Of scenario, orbits, filter, flights and version; null on paper"
    )

    @classmethod
    def of(cls, flight: FlownPlan | None) -> Self:
        """Return the basis of the verdict on a plan with this record of its flights."""
        if flight is None:
            return cls(kind="paper", flights=0, seed=None, digest=None)
        return cls(kind="flown", flights=flight.trials, seed=flight.seed, digest=flight.digest)


class PlanVerdict(Document):
    """Whether the plan can be flown: go is false exactly if a finding is a stop."""

    go: bool
    basis: OrAbsent[VerdictBasis] = Field(
        default=None, description="What the verdict rests on; absent from older files"
    )
    findings: tuple[PlanFinding, ...]

    @classmethod
    def of(cls, findings: Iterable[PlanFinding], flight: FlownPlan | None = None) -> Self:
        """Return the verdict on findings in the order of the checks, and on flights."""
        listed = tuple(findings)
        go = all(finding.level != "stop" for finding in listed)
        return cls(go=go, basis=VerdictBasis.of(flight), findings=listed)

    @property
    def flown(self) -> bool:
        """Whether the verdict rests on flights."""
        return self.basis is not None and self.basis.kind == "flown"

    @property
    def stops(self) -> tuple[PlanFinding, ...]:
        """Findings that stop the flight."""
        return tuple(one for one in self.findings if one.level == "stop")

    @property
    def line(self) -> str:
        """GO, or NO-GO with the number of reasons, marked up."""
        word, colon, reasons = self.headline.partition(":")
        return f"[bold {'green' if self.go else 'red'}]{word}[/]{colon}{reasons}"

    @property
    def finding_lines(self) -> Iterator[str]:
        """Each finding with its cure, marked up."""
        for finding in self.findings:
            level = f"[{_COLOURS[finding.level]}]{finding.level}[/]"
            yield f"{level}: {finding.code}: {plain(finding.message)}"
            if finding.cure is not None:
                yield f"   cure: {plain(finding.cure.text)}"

    @property
    def word(self) -> str:
        """GO or NO-GO, marked up."""
        return "[green]GO[/]" if self.go else "[red]NO-GO[/]"

    @property
    def headline(self) -> str:
        """GO with its basis, or NO-GO with the number of reasons."""
        stops = len(self.stops)
        if stops:
            return f"NO-GO: {stops} reason{'s' if stops > 1 else ''}"
        if self.basis is None:
            return "GO"
        flights = self.basis.flights
        basis = f"{flights} simulated flight{'s' if flights != 1 else ''}"
        return f"GO in {basis}" if self.flown else "GO on paper: not flown"


# --- the team -------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class UnmetLink:
    """Listed link of vehicles `a` < `b` that never comes into contact, with the reason."""

    a: int
    b: int
    reason: str


@dataclass(frozen=True, slots=True, repr=False)
class JudgedTeam(WithTeam):
    """Team with the results of the exact code, on which its verdict rests.

    Attributes
    ----------
    scenario : as resolved
    team, windows : team and contact windows that were judged
    synchronisation : how the phases were found; None for a plan whose phases were given
    alternating_proven : whether the number of alternating links is proven largest; None if the
        senses were given
    links, incidental_links, landmark_links : verdicts on the listed links that meet, on other
        pairs that meet, and on vehicles with the landmarks they see
    dropped_links : listed links that never meet
    connectivity_period : s, None if no window of two periods and of the run certifies the team, or
        if left out
    sufficient_desync : rad, least orbit.desync_rad that makes the team well observable where it is
        not; None where it is, and if no value does or none was sought
    sufficient_run : s, length of a run that makes the team observable where this one is shorter
        than the stated window; None if it is not, if none was found or the search was left out
    approach : closest approach of two vehicles; None for one vehicle
    too_close : pairs of vehicles that come nearer than allowed, nearest first
    observability, certificate : over the scenario's window
    unobservable : a named mode for each dimension that the rank lacks
    prediction : errors predicted by the bounds
    error_verdict : observability of the errors that the filter estimates; None if it estimates
        none
    single_points : single losses that end observability; None if not searched for
    refinement : record of a refinement, successful or not; None if it was not tried
    placement : how the centres were found; None if they were given or the plan is a file's
    centres_placed : whether the plan's file says that placement found the centres
    start_up : start-up index of the run; None if no bound was computed or the team is not
        observable
    flight : results of flying the plan; None if it was not flown
    unflown : why it was not flown although flights were wanted; else empty
    dropped_flights : why the flights of the plan's file do not count; else empty
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
    sufficient_run: float | None
    sufficient_desync: float | None
    approach: Approach | None
    too_close: tuple[Approach, ...]
    observability: Observability
    certificate: Certificate
    unobservable: tuple[UnobservableMode, ...]
    prediction: Prediction
    error_verdict: ErrorVerdict | None = None
    single_points: tuple[Loss, ...] | None = ()
    refinement: RefinementRecord | None = None
    placement: "Placement | None" = None
    centres_placed: bool = False
    start_up: StartUpIndex | None = None
    flight: FlownPlan | None = None
    unflown: str = ""
    dropped_flights: str = ""

    @property
    def borne_out(self) -> FlownPlan | None:
        """Flights of the scenario as stated, on which the verdict rests; None on paper."""
        flight = self.flight
        return flight if flight is not None and flight.bears_out(self.scenario) else None

    @property
    def true_team(self) -> Team:
        """The team of the simulated world: its own, or with the scenario's truth."""
        return true_team_of(self.scenario, self.team)
