"""Senses for `direction: alternate`: as many links as possible join opposite senses.

That is the largest cut of the graph of links; a bipartite graph is cut entirely.
"""

from collections import Counter

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.graphs import contraction, two_colouring

Edge = tuple[int, int]

EXACT_LIMIT = 60
"""Up to this many contracted links the largest cut is found exactly, within the time limit."""

_TIME_LIMIT_S = 5.0
_RESTARTS = 20


def alternating_senses(count: int, edges: list[Edge], shared: list[Edge]) -> tuple[Array, bool]:
    """Return (senses (n,) of +1 and -1, whether the number of alternating links is proven largest).

    `shared` are pairs on one circle: opposite senses would collide there, so each such group is
    one vertex of the cut. The first vehicle turns counter-clockwise, and so does the first of
    every component where the links allow all to alternate.
    """
    label = contraction(count, shared)
    groups = max(label, default=-1) + 1
    contracted = [(label[a], label[b]) for a, b in edges if label[a] != label[b]]
    colour = two_colouring(groups, contracted)
    proven = True
    if colour is None:
        colour, proven = _largest_cut(groups, contracted)
    flip = colour[label[0]] if count else 0
    return np.array([1.0 if colour[label[k]] == flip else -1.0 for k in range(count)]), proven


def _largest_cut(count: int, edges: list[Edge]) -> tuple[list[int], bool]:
    weight = Counter((min(edge), max(edge)) for edge in edges)
    local = _local_cut(count, weight)
    if len(weight) > EXACT_LIMIT:
        return local, False
    exact = _exact_cut(count, weight)
    return (local, False) if exact is None else (exact, True)


def _exact_cut(count: int, weight: Counter[Edge]) -> list[int] | None:
    """Largest cut as a mixed-integer program; None if it is not solved in time."""
    from scipy.optimize import Bounds, LinearConstraint, milp

    pairs = list(weight)
    objective = np.concatenate([np.zeros(count), [-float(weight[pair]) for pair in pairs]])
    rows = np.zeros((2 * len(pairs), count + len(pairs)))
    limit = np.zeros(2 * len(pairs))
    for k, (a, b) in enumerate(pairs):
        rows[2 * k, [a, b, count + k]] = -1.0, -1.0, 1.0
        rows[2 * k + 1, [a, b, count + k]] = 1.0, 1.0, 1.0
        limit[2 * k + 1] = 2.0
    upper = np.ones(count + len(pairs))
    upper[0] = 0.0
    result = milp(
        objective,
        integrality=np.concatenate([np.ones(count), np.zeros(len(pairs))]),
        bounds=Bounds(np.zeros(count + len(pairs)), upper),
        constraints=LinearConstraint(rows, ub=limit),
        options={"time_limit": _TIME_LIMIT_S},
    )
    if result.status != 0:
        return None
    return [round(value) for value in result.x[:count]]


def _local_cut(count: int, weight: Counter[Edge]) -> list[int]:
    """Best of several one-exchange local optima, from seeded starts."""
    neighbours: list[list[tuple[int, int]]] = [[] for _ in range(count)]
    for (a, b), times in weight.items():
        neighbours[a].append((b, times))
        neighbours[b].append((a, times))
    generator = np.random.default_rng(0)
    best, best_value = [0] * count, -1
    for _ in range(_RESTARTS):
        side = generator.integers(0, 2, count).tolist()
        moved = True
        while moved:
            moved = False
            for k in range(count):
                gain = sum(w if side[k] == side[j] else -w for j, w in neighbours[k])
                if gain > 0:
                    side[k], moved = 1 - side[k], True
        value = sum(w for (a, b), w in weight.items() if side[a] != side[b])
        if value > best_value:
            best, best_value = side, value
    return best
