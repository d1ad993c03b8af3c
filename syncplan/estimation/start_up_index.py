"""Start-up index: nonlinearity of sightings in the initial errors, relative to innovations.

An extended Kalman filter replaces a bearing by its tangent at the estimate. With the error of the
relative position split into a along and b across the line of sight, at distance rho,

    bearing  = b / rho - a b / rho^2 + ...     distance = rho + a + b^2 / (2 rho) + ...
    eta      = standard deviation of the last term
             = sqrt(P_aa P_bb + P_ab^2) / rho^2           of a bearing
             = P_bb / (sqrt(2) rho)                       of a distance

for normal errors (Isserlis). To the filter that term is unmodelled noise, so its size is compared
with the standard deviation sqrt(S) of the innovation that the filter expects:

    start-up index = max of eta / sqrt(S) over the sightings of the first two periods

with P and S of the covariance recursion along the plan, from the initial sigmas, each just before
the sighting is processed. In two periods, each sighting of a plan occurs twice. The mean of the
last term is left out: the index was compared with trials without it. A compass is linear and has no
such term. A sighting that may be missed has the weight in S that the bound gives it.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.covariances import Foreseen
from syncplan.observability.referred_rows import NEAREST, relative_places
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS, sigmas_by_kind
from syncplan.orbits.sightings import Sightings, steps_within
from syncplan.orbits.team import Team

PERIODS = 2.0


@dataclass(frozen=True, slots=True)
class StartUpIndex:
    """The start-up index of a run, and the sighting that has it.

    Attributes
    ----------
    value : the index, a pure number; 0 without sightings
    observer, target : of that sighting; targets from n on are landmarks
    time : s, of that sighting
    """

    value: float
    observer: int
    target: int
    time: float


def first_samples(team: Team) -> int:
    """Return the last sample whose sightings the index covers."""
    return steps_within(PERIODS * team.orbits.period, team.sensors.sample_time)


def second_order_terms(team: Team, sightings: Sightings, scale: float) -> tuple[Array, Array]:
    """Return the functions and the size of each sighting's second-order term.

    The term is the product of two functions (2, s, 6) of errors at time 0, as in lines_of_sight,
    times its size (s,), which is 0 where there is none.
    """
    lines, distances = lines_of_sight(team, sightings, scale)
    functions, sizes = np.zeros_like(lines), np.zeros(len(distances))
    for place, kind in enumerate(SIGHTING_KINDS.values()):
        term, chosen = kind.second_order, sightings.kinds == place
        if term is not None and chosen.any():
            functions[:, chosen] = lines[list(term.ways)][:, chosen]
            sizes[chosen] = term.size(distances[chosen])
    return functions, sizes


def lines_of_sight(team: Team, sightings: Sightings, scale: float) -> tuple[Array, Array]:
    """Return (2, s, 6): errors along and across each line of sight, over its length (s,) in m.

    These errors of the relative position are linear functions of errors at time 0, the observer's
    three and the target's three, positions in `scale` m; a landmark's three are zero. All are zero
    where the two are nearer than NEAREST mean radii: the bound hardly counts such a sighting.
    """
    q, (own, other) = relative_places(team, sightings)
    squared = q[0] * q[0] + q[1] * q[1]
    nearest = NEAREST * float(team.orbits.radii.mean())
    x, y = np.divide(q, squared, out=np.zeros_like(q), where=squared >= nearest**2)
    found = np.zeros((2, len(squared), 6))
    for place, (east, north) in enumerate(((x, y), (-y, x))):
        found[place, :, 0], found[place, :, 1] = -scale * east, -scale * north
        found[place, :, 2] = east * own[1] - north * own[0]
        found[place, :, 3], found[place, :, 4] = scale * east, scale * north
        found[place, :, 5] = north * other[0] - east * other[1]
    found[:, sightings.targets >= team.count, 3:] = 0.0
    return found, np.sqrt(squared)


def index_of_run(
    team: Team, sightings: Sightings, sizes: Array, foreseen: Foreseen
) -> StartUpIndex:
    """Return the index from the covariances of second-order terms before each sighting."""
    if not len(sightings.steps):
        return StartUpIndex(0.0, 0, 0, 0.0)
    along, both, across = foreseen.pairs
    remainder = np.maximum(along, 0.0) * np.maximum(across, 0.0) + both * both
    sigma = sigmas_by_kind(team.sensors, sightings.kinds, sightings.observers)
    values = np.sqrt(remainder / foreseen.innovation) / sigma * sizes
    first = int(np.argmax(values))
    return StartUpIndex(
        value=float(values[first]),
        observer=int(sightings.observers[first]),
        target=int(sightings.targets[first]),
        time=float(sightings.steps[first] * team.sensors.sample_time),
    )
