"""How much work a scenario will be, before it is planned: from circles and ranges alone.

The circles of an observer and its target, D apart, carry the target around the observer by at most
the sum of their radii, rho. On a circle of relative motion of radius rho' <= rho, it is within
range r for the share arccos((D^2 + rho'^2 - r^2) / (2 D rho')) / pi of the time, which is largest
at rho' = sqrt(D^2 - r^2), or at rho where that is less; if D <= r, it may be in range always. This
bounds vehicles of one sense, and landmarks; of opposite senses it is an estimate. Obstacles, which
only take sightings away, are left out.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import reachable_pairs
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.scenario_arrays import radii_of, team_of
from syncplan.orbits.sighting_kinds import kinds_measured, of_targets, samples_between
from syncplan.planning.judgement import bound_is_affordable
from syncplan.scenario.specification import Scenario

__all__ = ["ExpectedWork", "work_of"]


@dataclass(frozen=True, slots=True)
class ExpectedWork:
    """What a run of a scenario holds.

    Attributes
    ----------
    sightings : in all samples of the run
    pass_work : sightings times the squared size of the state with all errors that there are: work
        of the bound, and of a trial
    bounded : whether a plan computes the posterior bound without being asked
    """

    sightings: float
    pass_work: float
    bounded: bool


def work_of(scenario: Scenario, duration: float | None = None) -> ExpectedWork | None:
    """Return the work of a run of `duration` s, the scenario's if not given.

    None where centres are yet to be found.
    """
    if not scenario.formation.placed:
        return None
    resolved = scenario.resolved()
    length = resolved.duration_s if duration is None else duration
    zeros = np.zeros(resolved.size)
    centers = np.array(resolved.centers, dtype=float)
    circles = Orbits(centers, radii_of(resolved), zeros + 1.0, zeros, resolved.orbit.rate)
    team = team_of(resolved, circles)
    a, b = reachable_pairs(circles, team.sensors.ranges, team.landmarks)
    places = np.concatenate([centers, team.landmarks.reshape(-1, 2)])
    radii = np.concatenate([circles.radii, np.zeros(len(team.landmarks))])
    distance = np.hypot(*(places[b] - places[a]).T)
    reach, sum_of_radii = team.sensors.ranges[a], circles.radii[a] + radii[b]
    away = np.sqrt(np.maximum(distance**2 - reach**2, 0.0))
    rho = np.minimum(sum_of_radii, away)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = (distance**2 + rho**2 - reach**2) / (2.0 * distance * rho)
    share = np.where(distance <= reach, 1.0, np.arccos(np.clip(cosine, -1.0, 1.0)) / np.pi)
    share *= np.minimum(team.sensors.fields_of_view[a] / (2.0 * np.pi), 1.0)
    measured = kinds_measured(team.sensors)
    paired = of_targets(np.arange(measured.shape[1]))
    share *= measured[a][:, paired].sum(axis=1) / team.sensors.every[a]
    alone = measured[:, ~paired] / samples_between(team.sensors)[~paired].T
    each = float(share.sum()) + float(alone.sum())
    sightings = each * length / team.sensors.sample_time
    size = float(layout_of(team, tuple(ERROR_STATES)).size)
    return ExpectedWork(sightings, sightings * size**2, bound_is_affordable(team, length))
