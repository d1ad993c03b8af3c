"""What the sightings of one window determine: the chain that every verdict on a team rests on.

    windows -> sampled sightings -> what each pair determines -> rank -> certificate

Plans are judged by it, and so is every candidate of a refinement.
"""

from dataclasses import dataclass

from syncplan.observability.certificate import Certificate, certify
from syncplan.observability.rank import (
    LinkInformation,
    Observability,
    assess,
    link_information,
    lone_rows,
)
from syncplan.orbits.contacts import Windows, find_windows
from syncplan.orbits.sightings import Remainder, Sightings, sightings_over
from syncplan.orbits.team import Team


@dataclass(frozen=True, slots=True)
class Assessment:
    """What the exact code finds of a team over one window.

    Attributes
    ----------
    windows : of contact, over one period
    sightings : at the samples k Ts in the window, k >= 0
    information : what the sightings of each pair determine, ordered by (a, b)
    observability, certificate : of all sightings together
    """

    team: Team
    windows: Windows
    sightings: Sightings
    information: list[LinkInformation]
    observability: Observability
    certificate: Certificate

    @property
    def largest(self) -> float:
        """Largest singular value of the team's matrix, beside which a link must not drown."""
        return float(self.observability.singular_values[0])

    def measured_in(self, scale: float) -> Observability:
        """Return rank and singular values with positions in `scale` m instead of mean radii."""
        if scale == self.observability.scale:
            return self.observability
        links = link_information(self.team, self.sightings, scale)
        return assess(self.team, links, lone_rows(self.team, self.sightings, scale), scale)


def assess_team(team: Team, window: float) -> Assessment:
    """Return what the sightings of a team over `window` s determine."""
    windows = find_windows(team)
    return _assessed(team, windows, sightings_over(team, windows, window))


def assess_remainder(before: Assessment, left: Remainder) -> Assessment:
    """Return what the sightings that a loss leaves determine, over the same window."""
    return _assessed(left.team, left.windows(before.windows), left.sightings(before.sightings)[0])


def _assessed(team: Team, windows: Windows, sightings: Sightings) -> Assessment:
    information = link_information(team, sightings)
    verdict = assess(team, information, lone_rows(team, sightings))
    certificate = certify(team, verdict, information)
    return Assessment(team, windows, sightings, information, verdict, certificate)
