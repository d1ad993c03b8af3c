"""Estimate of a scenario's computing work before it is planned, from circles and ranges alone.

On circles D apart, the target moves relative to the observer by at most rho, the sum of the radii.
On a circle of relative motion of radius rho' <= rho, it is within range r for the share
arccos((D^2 + rho'^2 - r^2) / (2 D rho')) / pi of the time. This share is largest at
rho' = sqrt(D^2 - r^2), or at rho where that is less; if D <= r, the target may always be in range.
The share is a bound for vehicles of one sense and for landmarks, and an estimate for opposite
senses. Obstacles only remove sightings and are left out.

A narrow view turns with its vehicle, so a sighting depends on the target's direction as well as its
distance. For such views, the share is counted at instants around the circle for several phases of
the target, and the largest is taken.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import reachable_pairs
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.sighting_kinds import kinds_measured, of_targets, samples_between
from syncplan.orbits.team import Team, radii_of, team_of
from syncplan.planning.judged_team import bound_is_affordable
from syncplan.scenario.specification import Scenario

_INSTANTS, _PHASES = 72, 8
"""Instants around a circle, and phases of a target, at which narrow views are sampled."""

FLIGHT_WORK_LIMIT = 3e8
"""Pass work of a flight up to which a plan is flown before its verdict."""

_FLIGHT_SECONDS = 5e-10
"""Time of one of many flights for each unit of pass work, in s on two cores."""


@dataclass(frozen=True)
class ExpectedWork:
    """Expected size of a run of a scenario.

    Attributes
    ----------
    team : the team, with placeholders for phases
    length : s
    a, b : (k,) observers and targets that may come within their range
    """

    team: Team
    length: float
    a: Index
    b: Index

    @property
    def pairs(self) -> int:
        """Number of pairs of an observer and a target that may come within its range."""
        return len(self.a)

    @cached_property
    def sightings(self) -> float:
        """Number of sightings in the run."""
        team, circles, a, b = self.team, self.team.orbits, self.a, self.b
        places = np.concatenate([circles.centers, team.landmarks.reshape(-1, 2)])
        radii = np.concatenate([circles.radii, np.zeros(len(team.landmarks))])
        distance = np.hypot(*(places[b] - places[a]).T)
        reach, sum_of_radii = team.sensors.ranges[a], circles.radii[a] + radii[b]
        away = np.sqrt(np.maximum(distance**2 - reach**2, 0.0))
        rho = np.minimum(sum_of_radii, away)
        with np.errstate(divide="ignore", invalid="ignore"):
            cosine = (distance**2 + rho**2 - reach**2) / (2.0 * distance * rho)
        share = np.where(distance <= reach, 1.0, np.arccos(np.clip(cosine, -1.0, 1.0)) / np.pi)
        narrow = team.sensors.fields_of_view[a] < 2.0 * np.pi
        share[narrow] = _share_in_view(team, places, a[narrow], b[narrow])
        measured = kinds_measured(team.sensors)
        paired = of_targets(np.arange(measured.shape[1]))
        share *= measured[a][:, paired].sum(axis=1) / team.sensors.every[a]
        alone = measured[:, ~paired] / samples_between(team.sensors)[~paired].T
        each = float(share.sum()) + float(alone.sum())
        return each * self.length / team.sensors.sample_time

    @property
    def pass_work(self) -> float:
        """Sightings times the squared dimension of the state with every error.

        It is the work of the bound, and of a trial.
        """
        return self.sightings * float(layout_of(self.team, tuple(ERROR_STATES)).size) ** 2

    @property
    def bounded(self) -> bool:
        """Whether a plan computes the posterior bound by default."""
        return bound_is_affordable(self.team, self.length)

    def flight_seconds(self, flights: int) -> float:
        """Return about how long so many flights take on two cores, in s."""
        return _FLIGHT_SECONDS * flights * self.pass_work


def work_of(scenario: Scenario, duration: float | None = None) -> ExpectedWork | None:
    """Return the work of a run of `duration` s, the scenario's if not given.

    None if the centres are yet to be found.
    """
    if not scenario.formation.placed:
        return None
    resolved = scenario.resolved()
    length = resolved.duration_s if duration is None else duration
    team = _team(resolved)
    pairs = reachable_pairs(team.orbits, team.sensors.ranges, team.landmarks)
    return ExpectedWork(team, length, *pairs)


def _team(scenario: Scenario) -> Team:
    """Team of a resolved scenario; its phases are placeholders."""
    zeros = np.zeros(scenario.size)
    centers = np.array(scenario.centers, dtype=float)
    circles = Orbits(centers, radii_of(scenario), _senses(scenario), zeros, scenario.orbit.rate)
    return team_of(scenario, circles)


def _senses(scenario: Scenario) -> Array:
    """Senses (n,) as given; where they are yet to be chosen, neighbours in the list alternate."""
    direction = scenario.orbit.direction
    given = direction if isinstance(direction, list) else [direction] * scenario.size
    senses = np.array([1.0 if one == "ccw" else -1.0 for one in given])
    chosen = np.array([one == "alternate" for one in given])
    return np.where(chosen, 1.0 - 2.0 * (np.arange(scenario.size) % 2), senses)


def _share_in_view(team: Team, places: Array, a: Index, b: Index) -> Array:
    """Share (p,) of the time that each target is in range and view, the largest over phases."""
    orbits, sensors = team.orbits, team.sensors
    apart = (places[b] - places[a]) @ np.array([1.0, 1.0j])
    own = orbits.senses[a, None]
    fixed = len(team.landmarks)
    radii = np.concatenate([orbits.radii, np.zeros(fixed)])[b, None]
    senses = np.concatenate([orbits.senses, np.ones(fixed)])[b, None]
    turn = 2.0 * np.pi * (np.arange(_INSTANTS) + 0.5) / _INSTANTS
    arm = np.exp(1.0j * own * turn)
    # the heading is a quarter turn from the arm, the camera's direction a boresight further
    ahead = 1.0j * own * arm * np.exp(1.0j * sensors.boresights[a, None])
    least = np.cos(0.5 * sensors.fields_of_view[a, None])
    # vectors from the observer to the target's centre, and from there to the target
    start, further = (
        apart[:, None] - orbits.radii[a, None] * arm,
        radii * np.exp(1j * senses * turn),
    )
    share = np.zeros(len(a))
    for late in 2.0 * np.pi * np.arange(_PHASES) / _PHASES:
        q = start + np.exp(1.0j * late) * further
        far = np.abs(q)
        seen = (far <= sensors.ranges[a, None]) & ((q * ahead.conj()).real >= least * far)
        share = np.maximum(share, seen.mean(axis=1))
    return share
