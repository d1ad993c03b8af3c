"""Difference constraints: angles whose differences lie within given intervals.

Intervals low <= theta_a - theta_b <= high are feasible exactly if the graph of their bounds has no
negative cycle, and then solved by shortest paths (Bellman-Ford; Cormen et al., Introduction to
Algorithms, section 24.4).
"""

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import wrap

_ROUNDING_RAD = 1e-12


def central_solution(
    pairs: tuple[Index, Index], low: Array, high: Array, start: Array
) -> Array | None:
    """Return the midpoint (n,) of the extreme solutions of low <= theta_a - theta_b <= high.

    `pairs` are the (e,) vehicles a and b, `low` and `high` (e,) rad. The first vehicle of each
    connected component keeps its angle in `start` (n,). None if there is no solution.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import NegativeCycleError, bellman_ford, connected_components

    if np.any(low > high + _ROUNDING_RAD):
        return None
    count, (a, b) = len(start), pairs
    tail = np.concatenate([b, a])
    head = np.concatenate([a, b])
    length = np.concatenate([high, -low]) + _ROUNDING_RAD
    # one edge for each ordered pair, the tightest
    order = np.lexsort((length, head, tail))
    tail, head, length = tail[order], head[order], length[order]
    first = np.r_[True, (np.diff(tail) != 0) | (np.diff(head) != 0)][: len(tail)]
    graph = csr_array((length[first], (tail[first], head[first])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    roots = np.array([int(np.argmax(label == k)) for k in range(label.max() + 1)])
    try:
        above = bellman_ford(graph, indices=roots)
        below = bellman_ford(graph.T.tocsr(), indices=roots)
    except NegativeCycleError:
        return None
    row = label
    upper, lower = above[row, np.arange(count)], -below[row, np.arange(count)]
    return wrap(start[roots][label] + 0.5 * (upper + lower))
