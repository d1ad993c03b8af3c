"""Coordinate descent: starts for phases of many vehicles, one vehicle's phase after the other.

All starts move at once on a grid of phases. What is made small is the sum of exp(-sharpness x
worth) over the pairs of a vehicle, ever sharper, so that in the end the smallest worth decides.
"""

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.graphs import traversal
from syncplan.synchronisation.difference_tables import DifferenceTables

_GRID = 256
_SHARPNESS = (3.0, 6.0, 12.0, 24.0, 48.0, 48.0)
_SWEEPS = 2
_NOT_CLEAR = 1e3
_SEED = 0
_TURN = 2.0 * np.pi


def descended(tables: DifferenceTables, offset: Array, count: int, starts: int) -> Array:
    """Return time-phases (starts, count) rad: local optima of the smallest worth, nearly.

    `offset` (e,) rad is the difference that each pair's rule asks for. Starts are spanning trees
    whose links have their best difference to one side of the rule or the other, and random phases.
    """
    generator = np.random.default_rng(_SEED)
    worth = tables.worth[:, :: max(tables.value.shape[1] // _GRID, 1)]
    grid = worth.shape[1]
    finite = np.where(np.isposinf(worth), 0.0, worth)
    guard = ~tables.links
    phases = np.rint(_starts(tables, offset, count, starts, generator) * (grid / _TURN))
    place = phases.astype(np.int64) % grid
    for sharpness in _SHARPNESS:
        with np.errstate(over="ignore"):
            cost = np.where(finite == -np.inf, _NOT_CLEAR, np.exp(-sharpness * finite))
        cost[guard] -= np.where(finite[guard] == -np.inf, 0.0, 1.0)
        for _ in range(_SWEEPS):
            for vehicle in generator.permutation(count):
                place[:, vehicle] = np.argmin(_by_phase(tables, cost, place, int(vehicle)), axis=1)
    return np.asarray(place * (_TURN / grid))


def _by_phase(tables: DifferenceTables, cost: Array, place: Index, vehicle: int) -> Array:
    """(s, grid) the cost of one vehicle's pairs over its phase, the others at `place` (s, n)."""
    grid = cost.shape[1]
    column = np.arange(grid)
    total = np.zeros((len(place), grid))
    for row in np.flatnonzero(tables.a == vehicle):
        total += cost[row][(column - place[:, tables.b[row], None]) % grid]
    for row in np.flatnonzero(tables.b == vehicle):
        total += cost[row][(place[:, tables.a[row], None] - column) % grid]
    return total


def _starts(
    tables: DifferenceTables,
    offset: Array,
    count: int,
    starts: int,
    generator: np.random.Generator,
) -> Array:
    samples = tables.value.shape[1]
    difference = np.arange(samples) * (_TURN / samples)
    beyond = np.sin(difference - offset[:, None]) >= 0.0
    best = np.stack(
        [
            difference[np.argmax(np.where(side, tables.worth, -np.inf), axis=1)]
            for side in (beyond, ~beyond)
        ]
    )
    links = np.flatnonzero(tables.links)
    tree = traversal(count, [tables.edges[k] for k in links.tolist()])
    depth = np.zeros(count, dtype=np.int64)
    for parent, child, _ in tree:
        depth[child] = depth[parent] + 1
    from_even = depth[tables.a] % 2
    sides = [from_even, 1 - from_even, np.zeros(len(tables), dtype=np.int64)]
    sides += list(generator.integers(0, 2, (max(starts // 2 - len(sides), 0), len(tables))))
    found = [generator.uniform(0.0, _TURN, count) for _ in range(starts - len(sides) - 1)]
    for wanted in [offset, *(best[side, np.arange(len(tables))] for side in sides)]:
        theta = np.zeros(count)
        for parent, child, k in tree:
            row = links[k]
            step = wanted[row]
            theta[child] = theta[parent] + (-step if tables.a[row] == parent else step)
        found.append(theta)
    return np.array(found)
