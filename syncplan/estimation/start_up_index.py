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
from syncplan.observability.referred_rows import NEAREST
from syncplan.orbits.circles import body_paths
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


def second_order_terms(team: Team, sightings: Sightings, scale: float) -> Array:
    """Return (2, s, 6) the two functions whose product makes each sighting's second-order term.

    They are functions of errors at time 0, positions in `scale` m, as in lines_of_sight.
    """
    lines = lines_of_sight(team, sightings, scale)
    functions = np.zeros_like(lines)
    for place, kind in enumerate(SIGHTING_KINDS.values()):
        term, chosen = kind.second_order, sightings.kinds == place
        if term is not None and chosen.any():
            functions[:, chosen] = lines[list(term.ways)][:, chosen]
    return functions


def lines_of_sight(team: Team, sightings: Sightings, scale: float) -> Array:
    """Return (2, s, 6): errors along and across each line of sight, over its length.

    These errors of the relative position are linear functions of errors at time 0, the observer's
    three and the target's three, positions in `scale` m; a landmark's three are zero. All are zero
    where the two are nearer than NEAREST mean radii: the bound hardly counts such a sighting.
    """
    q, (own, other) = _relative(team, sightings)
    squared = np.sum(q * q, axis=1, keepdims=True)
    nearest = NEAREST * float(team.orbits.radii.mean())
    along = np.divide(q, squared, out=np.zeros_like(q), where=squared >= nearest**2)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    found = np.zeros((2, len(q), 6))
    for place, way in enumerate((along, across)):
        found[place, :, :2] = -scale * way
        found[place, :, 2] = way[:, 0] * own[:, 1] - way[:, 1] * own[:, 0]
        found[place, :, 3:5] = scale * way
        found[place, :, 5] = way[:, 1] * other[:, 0] - way[:, 0] * other[:, 1]
    found[:, sightings.targets >= team.count, 3:] = 0.0
    return found


def index_of_run(team: Team, sightings: Sightings, foreseen: Foreseen) -> StartUpIndex:
    """Return the index from the covariances of second-order terms before each sighting."""
    if not len(sightings.steps):
        return StartUpIndex(0.0, 0, 0, 0.0)
    (along, both), (_, across) = foreseen.pairs
    remainder = np.maximum(along, 0.0) * np.maximum(across, 0.0) + both * both
    sigma = sigmas_by_kind(team.sensors, sightings.kinds, sightings.observers)
    values = np.sqrt(remainder / foreseen.innovation) / sigma * _sizes(team, sightings)
    first = int(np.argmax(values))
    return StartUpIndex(
        value=float(values[first]),
        observer=int(sightings.observers[first]),
        target=int(sightings.targets[first]),
        time=float(sightings.steps[first] * team.sensors.sample_time),
    )


def _sizes(team: Team, sightings: Sightings) -> Array:
    """Factor (s,) of each sighting's second-order term; 0 where it has none."""
    distances = np.hypot(*_relative(team, sightings)[0].T)
    found = np.zeros(len(sightings.steps))
    for place, kind in enumerate(SIGHTING_KINDS.values()):
        term, chosen = kind.second_order, sightings.kinds == place
        if term is not None:
            found[chosen] = term.size(distances[chosen])
    return found


def _relative(team: Team, sightings: Sightings) -> tuple[Array, tuple[Array, Array]]:
    """Target relative to observer (s, 2) in m, and the displacement of each since time 0."""
    center, cosine, sine = body_paths(team.orbits, team.landmarks)
    tau = (sightings.steps * (team.orbits.rate * team.sensors.sample_time))[:, None]
    turned, swung = np.cos(tau) - 1.0, np.sin(tau)
    ends = (sightings.observers, sightings.targets)
    starts = [center[end] + cosine[end] for end in ends]
    own, other = (cosine[end] * turned + sine[end] * swung for end in ends)
    return starts[1] + other - starts[0] - own, (own, other)
