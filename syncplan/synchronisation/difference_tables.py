"""Difference tables: worth of pairs of vehicles at every difference of their time-phases.

The worth of a pair is its share of contact or its margin. "Every pair worth at least t, and its
vehicles apart" leaves each pair an interval of differences around the current one. Such a system of
difference constraints low <= theta_a - theta_b <= high is feasible if and only if the graph of its
bounds has no negative cycle; shortest paths then solve it (Bellman-Ford; Cormen et al.,
Introduction to Algorithms, section 24.4). So bisection finds the largest t, globally for the turns
of the start round the cycles.

Those turns come from one of two searches:

Cell search finds the best phases of a few vehicles, globally, by branch and bound. The first
vehicle's time-phase is held; the others' fill a cube, which is cut into cells. In a cell each
difference stays within a window of its table, and the largest worth in that window bounds that of
the pair. Cells whose bound does not exceed the best centre found are dropped; the rest are halved
along every axis (Land and Doig, Econometrica 28, 1960).

Coordinate descent finds starts for many vehicles, one vehicle's phase after the other. All starts
move at once on a grid of phases. It minimises the sum of exp(-sharpness x worth) over the pairs of
a vehicle, with growing sharpness, so that in the end the smallest worth decides.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.circles import wrap
from syncplan.orbits.graphs import traversal
from syncplan.synchronisation.phase_rules import along_forest

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


_TURN = 2.0 * np.pi
_BISECTIONS = 14


def highest_level(
    solved: Callable[[float], Array | None], low: float, high: float, halvings: int
) -> tuple[Array, float] | None:
    """Return the solution at the highest feasible level from `low` to `high`, and that level.

    The level is found by bisection. None if even `low` has no solution.
    """
    theta = solved(low)
    if theta is None:
        return None
    top = solved(high)
    if top is not None:
        return top, high
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        trial = solved(middle)
        if trial is None:
            high = middle
        else:
            low, theta = middle, trial
    return theta, low


@dataclass(frozen=True, slots=True)
class DifferenceTables:
    """Worth and clearance of pairs over the difference theta_a - theta_b of their time-phases.

    Attributes
    ----------
    a, b : (e,) vehicles
    value : (e, k) worth, at differences 2 pi j / k; infinite for pairs that are only kept apart
    clearance : (e, k) m, distance beyond the separation required; infinite where none is
    """

    a: Index
    b: Index
    value: Array
    clearance: Array

    def __len__(self) -> int:
        return len(self.a)

    @property
    def links(self) -> Flags:
        """Whether each pair (e,) is to be served, not only kept apart."""
        return np.asarray(np.isfinite(self.value[:, 0]))

    @property
    def edges(self) -> list[tuple[int, int]]:
        """Pairs (a, b)."""
        return list(zip(self.a.tolist(), self.b.tolist(), strict=True))

    @property
    def worth(self) -> Array:
        """Value (e, k) where the pair is clear; minus infinity elsewhere."""
        return np.where(self.clearance >= 0.0, self.value, -np.inf)

    def only(self, rows: Index) -> "DifferenceTables":
        """Return the tables of the chosen pairs, their vehicles numbered from 0 in order."""
        _, place = np.unique(np.concatenate([self.a[rows], self.b[rows]]), return_inverse=True)
        a, b = place.reshape(2, -1)
        return DifferenceTables(a, b, self.value[rows], self.clearance[rows])

    def without_clearance(self) -> "DifferenceTables":
        """Return the same tables without separations to keep."""
        return replace(self, clearance=np.full_like(self.clearance, np.inf))

    def at(self, theta: Array) -> Array:
        """Return the worth (..., e) at the samples nearest to time-phases (..., n) rad."""
        samples = self.value.shape[1]
        difference = theta[..., self.a] - theta[..., self.b]
        place = np.rint(difference * (samples / _TURN)).astype(np.int64) % samples
        return np.asarray(self.worth[np.arange(len(self)), place])

    def central(self, levels: Array, start: Array) -> Array | None:
        """Return central time-phases with the turns of `start` (n,) and every worth at its level.

        `levels` are (e,); those of pairs that are only kept apart do not matter. None if there
        are no such phases.
        """
        intervals = self._intervals(levels, start)
        return None if intervals is None else central_solution((self.a, self.b), *intervals, start)

    def highest(
        self, start: Array, free: Flags | None = None, levels: Array | None = None
    ) -> tuple[Array, float] | None:
        """Return (theta, t) with the largest t that the worth of every free pair reaches.

        The others keep their `levels` (e,); without `free`, all links are free. None if not even
        the start's worth can be reached with its turns.
        """
        free = self.links if free is None else free
        fixed = np.full(len(self), -np.inf) if levels is None else levels
        low = float(np.min(self.at(start)[free], initial=np.inf))
        high = float(np.min(self.worth[free].max(axis=1), initial=np.inf))

        def central(level: float) -> Array | None:
            return self.central(np.where(free, level, fixed), start)

        if not np.isfinite(high):
            theta = central(low)
            return None if theta is None else (theta, high)
        return highest_level(central, low, high, _BISECTIONS)

    def _intervals(self, levels: Array, start: Array) -> tuple[Array, Array] | None:
        """Lower and upper limits (e,) rad of the differences allowed around the start's."""
        samples = self.value.shape[1]
        levels = np.where(self.links, levels, 0.0)
        lack = np.maximum(levels[:, None] - self.value, -self.clearance)
        difference = start[self.a] - start[self.b]
        here = np.rint(difference * (samples / _TURN)).astype(np.int64)
        # from the nearest allowed sample both ways round the turn
        column = np.arange(samples)
        rows = np.arange(len(self))[:, None]
        ahead = lack[rows, (here[:, None] + column) % samples]
        away = np.where(ahead <= 0.0, np.minimum(column, samples - column), samples)
        near = np.argmin(away, axis=1)
        if np.any(away[rows[:, 0], near] == samples):
            return None
        up = lack[rows, (here[:, None] + near[:, None] + column) % samples]
        down = up[:, (-column) % samples]
        offset = wrap((here + near) * (_TURN / samples) - difference)
        middle = difference + offset
        return middle - _extent(down), middle + _extent(up)


def _extent(lack: Array) -> Array:
    """Extent (e,) in rad from the first sample, which is allowed, to the first lack; at most pi."""
    rows, samples = lack.shape
    outside = np.argmax(lack > 0.0, axis=1)
    row = np.arange(rows)
    beyond, within = lack[row, outside], lack[row, outside - 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.nan_to_num(within / (within - beyond), nan=0.0)
    reached = (outside - 1 + np.clip(share, 0.0, 1.0)) * (_TURN / samples)
    return np.where(outside == 0, np.pi, np.minimum(reached, np.pi))


# --- cell search --------------------------------------------------------------------------------


MOST_VEHICLES = 4
"""Most vehicles for cell search; the number of cells grows exponentially with theirs."""

_FIRST_CELLS = 16
_MOST_CELLS = 40_000
_GAIN = 1e-3
"""Least relative gain for which a cell is searched further."""


def smallest_worth(worth: Array) -> Array:
    """Return the smallest worth (...) over the pairs, from (e, ...)."""
    return np.asarray(worth.min(axis=0, initial=np.inf))


def most_served(floor: float, ramp: float) -> Callable[[Array], Array]:
    """Return the merit function that counts the links with a worth of at least `floor`.

    Links up to `ramp` below it count in part. It is minus infinity where a pair is not clear.
    """

    def merit(worth: Array) -> Array:
        served = np.where(np.isposinf(worth), 0.0, np.clip((worth - floor) / ramp + 1.0, 0.0, 1.0))
        clear = np.all(worth > -np.inf, axis=0)
        return np.where(clear, served.sum(axis=0), -np.inf)

    return merit


def best_phases(
    tables: DifferenceTables, count: int, merit: Callable[[Array], Array] = smallest_worth
) -> tuple[Array, float]:
    """Return time-phases (count,) of the largest merit found, and that merit.

    `merit` takes the worth (e, ...) of all pairs and must not fall where one of them rises; by
    default it is the smallest worth. The search is global to a thousandth of the merit, within the
    resolution of the tables, unless more than 40,000 cells remain; then it follows those of the
    highest bounds. The merit is minus infinity where no phases tried keep all pairs clear. The
    number of samples must be a power of two.
    """
    worth = tables.worth
    samples = worth.shape[1]
    half = samples // (2 * _FIRST_CELLS)
    windows = _largest_within(worth, 2 * half)
    axis = half * (1 + 2 * np.arange(_FIRST_CELLS))
    cells = np.stack(np.meshgrid(*[axis] * (count - 1), indexing="ij"), axis=-1)
    cells = _with_first(cells.reshape(-1, count - 1))
    best, merit_found = cells[0], -np.inf
    both_move = (tables.a > 0) & (tables.b > 0)
    while len(cells):
        place = (cells[:, tables.a] - cells[:, tables.b]).T % samples
        value = merit(np.take_along_axis(worth, place, axis=1))
        k = int(np.argmax(value))
        if value[k] > merit_found:
            best, merit_found = cells[k], float(value[k])
        if half == 1:
            break
        width = np.where(both_move, 2 * half, half)
        bound = merit(
            np.stack([windows[w][e, p] for e, (w, p) in enumerate(zip(width, place, strict=True))])
        )
        promising = bound > merit_found + _GAIN * max(abs(merit_found), 1e-9)
        if not np.isfinite(merit_found):
            promising = bound > -np.inf
        cells = cells[promising]
        if len(cells) * 2 ** (count - 1) > _MOST_CELLS:
            order = np.argsort(-bound[promising], kind="stable")
            cells = cells[np.sort(order[: _MOST_CELLS // 2 ** (count - 1)])]
        half //= 2
        cells = _halved(cells, half, count)
    return best * (2.0 * np.pi / samples), merit_found


def _with_first(cells: Index) -> Index:
    return np.column_stack([np.zeros(len(cells), dtype=np.int64), cells])


def _halved(cells: Index, half: int, count: int) -> Index:
    """Centres of the parts of each cell."""
    signs = np.stack(np.meshgrid(*[[-half, half]] * (count - 1), indexing="ij"), axis=-1)
    parts = _with_first(signs.reshape(-1, count - 1))
    return np.asarray((cells[:, None] + parts).reshape(-1, count))


def _largest_within(worth: Array, widest: int) -> dict[int, Array]:
    """Largest worth (e, k) within w samples either way, for w = 1, 2, 4, ... `widest`."""
    from scipy.ndimage import maximum_filter1d

    widths = [2**k for k in range(widest.bit_length())]
    return {w: maximum_filter1d(worth, 2 * w + 1, axis=1, mode="wrap") for w in widths}


# --- coordinate descent -------------------------------------------------------------------------


_GRID = 256
_SHARPNESS = (3.0, 6.0, 12.0, 24.0, 48.0, 48.0)
_SWEEPS = 2
_NOT_CLEAR = 1e3
_SEED = 0


def descended(tables: DifferenceTables, offset: Array, count: int, starts: int) -> Array:
    """Return time-phases (starts, count) rad close to local optima of the smallest worth.

    `offset` (e,) rad is the difference that each pair's rule requires. Starts are spanning trees
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
    """Cost (s, grid) of one vehicle's pairs over its phase, the others at `place` (s, n)."""
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
    generator: "np.random.Generator",
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
        found.append(along_forest(count, tree, tables.a[links], wanted[links]))
    return np.array(found)
