"""The periodic limit of a covariance: the fixed point of one period's Riccati map, by doubling.

Each map is P -> A P (I + C P)^-1 A^T + B. Composed with itself again and again, B becomes the
covariance long after an exact start.

With constant errors as states it depends on the start: what sightings determine of them becomes
known, its variance falling as 1 / t, and of the rest the prior is all there ever is. So the limit
is taken from the start itself, and what falls as 1 / t is left out by extrapolation: with P_k the
covariance after 2^k periods, 2 P_k - P_(k - 1). Where all such errors are determined it is the
limit of poses and errors that change alone, with the errors known.

Sources
-------
doubling of the Riccati map : Anderson, "Second-order convergent algorithms for the steady-state
    Riccati equation", International Journal of Control 28(2), 1978
structured doubling : Chu, Fan, Lin, Wang, "Structure-preserving algorithms for periodic
    discrete-time algebraic Riccati equations", International Journal of Control 77(8), 2004
"""

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.referred_system import ReferredSystem

_DOUBLINGS = 60
_SETTLED, _SETTLED_BY_ROUNDING = 1e-12, 1e-8

_LARGEST = 1e12
"""Of a covariance that still may settle."""

_DOUBLINGS_FROM_START, _SETTLED_FROM_START = 24, 1e-6
"""With constant errors: more doublings would drown what is not determined in rounding."""

Riccati = tuple[Array, Array, Array]
"""A, B and C of a map."""


def settled_covariance(system: ReferredSystem) -> Array | None:
    """Return the covariance at the beginning of a period once it has become periodic.

    None where it does not settle. The run of the system has to be one of whole periods.
    """
    once = _period_map(system)
    if system.run.poses_alone:
        return _fixed_point(once)
    return _settled_from(system.start, once)


def _fixed_point(once: Riccati) -> Array | None:
    """The fixed point of a map, by structured doubling.

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
    """The covariance long after the covariance `start` at time 0."""
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
    """Changes and noise, then rows, of each sample; in the end time 0 is moved to the period's."""
    run = system.run
    identity, zero = np.eye(run.size), np.zeros((run.size, run.size))
    carried, blown = identity, zero
    if run.changing is not None:
        carried, blown = run.changing.transition(run.size)
    vehicles = np.arange(run.count)
    poses = slice(0, 3 * run.count)
    rows, each, noise = run.laid_out(0, run.steps + 1)
    total: Riccati = (identity, zero, zero)
    for k in range(1, run.steps + 1):
        added = blown.copy()
        own = added[poses, poses].reshape(run.count, 3, run.count, 3)
        own[vehicles, :, vehicles, :] += noise[k]
        total = _composed(total, (carried, added, zero))
        if each[k].stop > each[k].start:
            seen = rows[each[k]]
            total = _composed(total, (identity, zero, seen.T @ seen))
    return _composed(total, (system.moved_on(), zero, zero))


def _composed(first: Riccati, then: Riccati) -> Riccati:
    """The map `first`, then `then`; each is P -> A P (I + C P)^-1 A^T + B.

    With first = then it is the doubling step (Anderson 1978).
    """
    a1, b1, c1 = first
    a2, b2, c2 = then
    inner = np.linalg.inv(np.eye(len(a1)) + b1 @ c2)
    middle = a2 @ inner
    return middle @ a1, b2 + middle @ b1 @ a2.T, c1 + a1.T @ c2 @ inner @ a1
