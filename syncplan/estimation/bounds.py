"""Cramer-Rao bounds: the least error any unbiased filter can have along the nominal circles.

The posterior bound with motion noise is the covariance recursion along the nominal path. Errors
are referred to time 0 by the closed-form transition, so that prediction only adds noise:

    P <- P + Phi(0, k) G Q G^T Phi(0, k)^T      block diagonal, one 3 x 3 block a vehicle
    P <- P - P H^T (H P H^T + 1)^-1 H P         H: the rows of the windowed matrix, sigma = 1

Positions are in mean radii until the end. syncplan.estimation.covariances processes the rows.

To bound many losses quickly, noise, rows and displacements of the whole team's run are prepared
once; each loss selects from them.

The periodic limit of a covariance is the fixed point of one period's Riccati map, found by
doubling. Each map is P -> A P (I + C P)^-1 A^T + B. Composed with itself repeatedly, its B becomes
the covariance long after an exact start.

With constant errors as states, the limit depends on the start. The part of them that sightings
determine becomes known, its variance falling as 1 / t; the rest keeps its prior. So the limit is
taken from the start itself, and the part that falls as 1 / t is removed by extrapolation: with P_k
the covariance after 2^k periods, 2 P_k - P_(k - 1). Where sightings determine all constant errors,
this is the limit of poses and changing errors alone, with the constant errors known.

Sources
-------
posterior bound : Tichavsky, Muravchik, Nehorai, "Posterior Cramer-Rao bounds for discrete-time
    nonlinear filtering", IEEE Transactions on Signal Processing 46(5), 1998, Proposition 1, here
    for additive Gaussian noise, in covariances, along the nominal path
its periodic limit : doubling of the Riccati map, Anderson, "Second-order convergent algorithms for
    the steady-state Riccati equation", International Journal of Control 28(2), 1978; structured
    doubling, Chu, Fan, Lin, Wang, "Structure-preserving algorithms for periodic discrete-time
    algebraic Riccati equations", International Journal of Control 77(8), 2004
"""

from dataclasses import dataclass, replace
from itertools import islice
from math import lcm

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import NoSolutionError
from syncplan.estimation.referred_system import INDEFINITE, PosteriorBound, ReferredSystem
from syncplan.observability.spectrum import Observability
from syncplan.orbits.contacts import Windows
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.sighting_kinds import kinds_measured, samples_between
from syncplan.orbits.sightings import Remainder, steps_within
from syncplan.orbits.team import Team

_ADAPTED = 0.01
"""Largest relative change of the sample time made so that sightings repeat."""

_MOST_PERIODS = 20
"""Periods after which sightings are taken to repeat, at the latest."""


def window_bound(result: Observability) -> Array:
    """Return (n,) m: the bound on each initial position from one window, without motion noise.

    The Cramer-Rao bound of the windowed information (Bar-Shalom, Li, Kirubarajan 2001). NaN
    for a vehicle whose position is not determined. Lasting errors count as known.
    """
    variance = result.variances.reshape(-1, 3)[:, :2].sum(axis=1)
    lost = result.moved.reshape(-1, 3)[:, :2].sum(axis=1)
    return np.where(lost > 1e-9, np.nan, result.scale * np.sqrt(variance))


def posterior_bound(
    team: Team,
    windows: Windows,
    duration: float,
    *,
    start_up: bool = False,
    lumped: bool = False,
) -> PosteriorBound:
    """Return the posterior bound over `duration` s, sightings at k Ts with k >= 1.

    Errors that the filter estimates are states too, with their sigmas as the start.
    `start_up` adds the start-up index, from the same recursion. `lumped` computes the bound of a
    large team by lumps of sightings, without the index, unless an error that the filter estimates
    changes or lumps would save little. Raises NoSolutionError where the covariance stops being
    positive definite in floating point: sigmas that span too many orders of magnitude.
    """
    steps = steps_within(duration, team.sensors.sample_time)
    system = ReferredSystem.along(team, windows, steps, layout_of(team))
    exact = system.with_index if start_up else system.bound
    if lumped and system.run.changing is None:
        from syncplan.estimation.lumped_bound import lumped_bound

        return system.from_start(lambda covariance: lumped_bound(system, covariance, exact))
    return system.from_start(exact)


@dataclass(frozen=True, slots=True)
class PositionCovariances:
    """Covariances of positions over the last period of a run, as the posterior bound has them.

    Attributes
    ----------
    times : (k,) s since the start, the last at the end of the run
    values : (k, n, 2, 2) m^2, of each vehicle's (x, y)
    """

    times: Array
    values: Array


def position_covariances(
    team: Team, windows: Windows, duration: float, moments: int
) -> PositionCovariances:
    """Return covariances at `moments` samples of the last period, evenly spread.

    They belong to the bound that posterior_bound computes over `duration` s: their traces are its
    variances of position. A run shorter than a period has fewer. Raises NoSolutionError as
    posterior_bound does.
    """
    sample_time = team.sensors.sample_time
    steps = steps_within(duration, sample_time)
    system = ReferredSystem.along(team, windows, steps, layout_of(team))
    try:
        values = system.position_covariances(system.start)
    except np.linalg.LinAlgError:
        raise NoSolutionError(INDEFINITE) from None
    before = team.orbits.period / sample_time * np.arange(moments)[::-1] / moments
    chosen = np.unique(np.maximum(steps - np.rint(before).astype(np.int64), 0))
    return PositionCovariances(chosen * sample_time, values[chosen])


def steady_bound(team: Team, windows: Windows) -> Array:
    """Return (n,) m: RMS position bound over a period once it has become periodic.

    The fixed point of one period's Riccati map, by doubling. The period is rounded to a whole
    number of samples, at least one, and the sample time adapted. Where sensors are not ready at
    every sample, it is the fewest periods that nearly hold a whole number of all their intervals.
    Where there are none, sightings drift relative to the meetings, and one pattern of them stands
    for all: with one sighting in a third of a period the bound is off by a few per cent.
    Infinite where the bound never settles, as for unobservable teams.

    By then, errors that the filter estimates are known as far as sightings determine them. For the
    rest, the initial sigmas remain.
    """
    even, samples = _repeating(team)
    system = ReferredSystem.along(even, windows, samples, layout_of(even))
    try:
        settled = settled_covariance(system)
        bound = None if settled is None else system.bound(settled)
    except np.linalg.LinAlgError:
        return np.full(team.count, np.inf)
    if bound is None:
        return np.full(team.count, np.inf)
    variance = bound.position_variance[1:].mean(axis=0)
    with np.errstate(invalid="ignore"):
        return np.where(variance >= 0.0, np.sqrt(variance), np.inf)


def _repeating(team: Team) -> tuple[Team, int]:
    """Return the team with a sample time at which sightings repeat, and the samples until they do.

    They repeat after the fewest periods for which the sample time changes by no more than _ADAPTED,
    or after the number up to _MOST_PERIODS for which it changes least.
    """
    period, sample_time = team.orbits.period, team.sensors.sample_time
    together = lcm(*samples_between(team.sensors)[kinds_measured(team.sensors).T].tolist())
    if together == 1:
        samples = max(round(period / sample_time), 1)
        return _sampled(team, period / samples), samples
    best = (np.inf, 1, together)
    for turns in range(1, _MOST_PERIODS + 1):
        samples = max(round(turns * period / (sample_time * together)), 1) * together
        change = abs(turns * period / (samples * sample_time) - 1.0)
        best = min(best, (change, turns, samples))
        if change <= _ADAPTED:
            break
    _, turns, samples = best
    return _sampled(team, turns * period / samples), samples


def _sampled(team: Team, sample_time: float) -> Team:
    return replace(team, sensors=replace(team.sensors, sample_time=sample_time))


# --- bounds after a loss --------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LossBounds:
    """A run of a whole team, from which the bounds after losses are computed."""

    system: ReferredSystem

    @classmethod
    def along(cls, team: Team, windows: Windows, duration: float) -> "LossBounds":
        """Return the run of a team over `duration` s."""
        steps = steps_within(duration, team.sensors.sample_time)
        return cls(ReferredSystem.along(team, windows, steps, layout_of(team, ())))

    def after(self, left: Remainder) -> PosteriorBound:
        """Return the bound after a loss; raises NoSolutionError as posterior_bound does."""
        system = self.system.left_by(left, layout_of(left.team))
        return system.from_start(system.bound)


# --- the periodic limit ---------------------------------------------------------------------------


_DOUBLINGS = 60
_SETTLED, _SETTLED_BY_ROUNDING = 1e-12, 1e-8

_LARGEST = 1e12
"""Largest element of a covariance that may still settle."""

_DOUBLINGS_FROM_START, _SETTLED_FROM_START = 24, 1e-6
"""Limits with constant errors: more doublings would lose undetermined parts in rounding."""

Riccati = tuple[Array, Array, Array]
"""Matrices A, B and C of a map."""


def settled_covariance(system: ReferredSystem) -> Array | None:
    """Return the covariance at the beginning of a period once it has become periodic.

    None where it does not settle. The system's run must cover whole periods.
    """
    once = _period_map(system)
    if system.run.poses_alone:
        return _fixed_point(once)
    return _settled_from(system.start, once)


def _fixed_point(once: Riccati) -> Array | None:
    """Return the fixed point of a map by structured doubling, None where it does not settle.

    After k doublings B is the covariance 2^k periods after an exact start.
    """
    a, b, c = once
    last = np.inf
    for _ in range(_DOUBLINGS):
        grown = _composed((a, b, c), (a, b, c))
        change = np.max(np.abs(grown[1] - b))
        a, b, c = grown
        if not np.isfinite(change) or np.max(np.abs(b)) > _LARGEST:
            return None
        settled = change / max(float(np.max(np.abs(b))), 1e-300)
        if settled <= _SETTLED or (settled <= _SETTLED_BY_ROUNDING and change >= last):
            return 0.5 * (b + b.T)
        last = change
    return None


def _settled_from(start: Array, once: Riccati) -> Array | None:
    """Return the limit of the covariance from `start` at time 0, None where it does not settle."""
    before, settled = start, None
    for _ in range(_DOUBLINGS_FROM_START):
        a, b, c = once
        now = a @ start @ np.linalg.inv(np.eye(len(start)) + c @ start) @ a.T + b
        last, settled = settled, 2.0 * now - before
        largest = float(np.max(np.abs(settled)))
        if not largest <= _LARGEST:
            return None
        if last is not None and np.max(np.abs(settled - last)) <= _SETTLED_FROM_START * largest:
            return 0.5 * (settled + settled.T)
        before, once = now, _composed(once, once)
    return None


def _period_map(system: ReferredSystem) -> Riccati:
    """Return the map of a period: each sample's changes and noise, then its rows.

    Finally, time 0 is moved to the end of the period.
    """
    run = system.run
    identity, zero = np.eye(run.size), np.zeros((run.size, run.size))
    carried, blown = identity, zero
    if run.changing is not None:
        carried, blown = run.changing.transition(run.size)
    vehicles = np.arange(run.count)
    poses = slice(0, 3 * run.count)
    total: Riccati = (identity, zero, zero)
    # the first is at time 0, where nothing has happened yet
    for _, seen, noise in islice(run.samples(), 1, None):
        added = blown.copy()
        own = added[poses, poses].reshape(run.count, 3, run.count, 3)
        own[vehicles, :, vehicles, :] += noise
        total = _composed(total, (carried, added, zero))
        if len(seen):
            total = _composed(total, (identity, zero, seen.T @ seen))
    return _composed(total, (system.moved_on(), zero, zero))


def _composed(first: Riccati, then: Riccati) -> Riccati:
    """Return the map `first` followed by `then`; each is P -> A P (I + C P)^-1 A^T + B.

    With first = then this is the doubling step (Anderson 1978).
    """
    a1, b1, c1 = first
    a2, b2, c2 = then
    inner = np.linalg.inv(np.eye(len(a1)) + b1 @ c2)
    middle = a2 @ inner
    return middle @ a1, b2 + middle @ b1 @ a2.T, c1 + a1.T @ c2 @ inner @ a1
