"""The periodic limit of a covariance: the fixed point of one period's Riccati map, by doubling.

Each map is P -> A P (I + C P)^-1 A^T + B. Composed with itself again and again, B becomes the
covariance long after an exact start.

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

__all__ = ["settled_covariance"]


_DOUBLINGS = 60
_SETTLED, _SETTLED_BY_ROUNDING = 1e-12, 1e-8


def settled_covariance(system: ReferredSystem) -> Array | None:
    """Fixed point of one period's map P -> A P (I + C P)^-1 A^T + B, by structured doubling.

    After k doublings B is the covariance 2^k periods after an exact start.
    """
    size = 3 * system.run.count
    a, b, c = _period_map(system, size)
    last = np.inf
    for _ in range(_DOUBLINGS):
        grown = _composed((a, b, c), (a, b, c))
        change = np.max(np.abs(grown[1] - b))
        a, b, c = grown
        if not np.isfinite(change) or np.max(np.abs(b)) > 1e12:
            return None
        settled = change / max(float(np.max(np.abs(b))), 1e-300)
        if settled <= _SETTLED or (settled <= _SETTLED_BY_ROUNDING and change >= last):
            return 0.5 * (b + b.T)
        last = change
    return None


def _period_map(system: ReferredSystem, size: int) -> tuple[Array, Array, Array]:
    run = system.run
    vehicles = np.arange(run.count)
    noise, columns = run.noise_blocks, run.columns
    identity, zero = np.eye(size), np.zeros((size, size))
    total = (identity, zero, zero)
    for k in range(1, len(noise)):
        added = np.zeros((size, size))
        added.reshape(run.count, 3, run.count, 3)[vehicles, :, vehicles, :] = noise[k]
        total = _composed(total, (identity, added, zero))
        begin, end = run.first[k], run.first[k + 1]
        if begin < end:
            dense = np.zeros((end - begin, size))
            np.add.at(
                dense, (np.arange(end - begin)[:, None], columns[begin:end]), run.rows[begin:end]
            )
            total = _composed(total, (identity, zero, dense.T @ dense))
    return total


def _composed(
    first: tuple[Array, Array, Array], then: tuple[Array, Array, Array]
) -> tuple[Array, Array, Array]:
    """The map `first`, then `then`; each is P -> A P (I + C P)^-1 A^T + B.

    With first = then it is the doubling step (Anderson 1978).
    """
    a1, b1, c1 = first
    a2, b2, c2 = then
    inner = np.linalg.inv(np.eye(len(a1)) + b1 @ c2)
    middle = a2 @ inner
    return middle @ a1, b2 + middle @ b1 @ a2.T, c1 + a1.T @ c2 @ inner @ a1
