"""A team on its orbits with all that was found of it, and how the orbits were found."""

from dataclasses import dataclass

from syncplan.observability.certificate import Certificate
from syncplan.observability.error_modes import ErrorVerdict
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.observability.rank import Observability
from syncplan.observability.unobservable_modes import UnobservableMode
from syncplan.orbits.contacts import Approach, Windows
from syncplan.orbits.sightings import Loss
from syncplan.orbits.team import Team, WithTeam, true_team_of
from syncplan.placement.centers import Placement
from syncplan.planning.flight_record import FlightRecord
from syncplan.planning.predicted_errors import Prediction
from syncplan.planning.refinement_record import RefinementRecord
from syncplan.planning.start_up import StartUp
from syncplan.scenario.specification import Scenario
from syncplan.synchronisation.phases import Synchronisation


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
    flight: FlightRecord | None = None

    @property
    def true_team(self) -> Team:
        """The team of the simulated world: its own, or with the scenario's truth."""
        return true_team_of(self.scenario, self.team)
