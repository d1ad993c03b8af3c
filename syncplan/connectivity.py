"""Connectivity period: the shortest window whose union certifies the team, wherever it starts."""

import numpy as np
from numpy.typing import NDArray

from syncplan.certificate import DISTINCT_LANDMARKS
from syncplan.contacts import Sensors, Windows
from syncplan.graph import disjoint_sets
from syncplan.observability import LINK_TOLERANCE, PairRows, pair_rows
from syncplan.orbits import Orbits
from syncplan.sightings import sample_sightings, steps_within

__all__ = ["connectivity_period"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SEARCHED_PERIODS = 2

_NEVER = np.iinfo(np.int64).max // 4
_BATCH = 20_000


def connectivity_period(
    orbits: Orbits, landmarks: Array, sensors: Sensors, windows: Windows, largest: float
) -> float | None:
    """Return the connectivity period in s, or None if no window of two periods certifies.

    `largest` is the largest singular value of the team's matrix over the scenario's window, what
    a link must not drown beside to count for the certificate.

    For every start just after a sample, each pair's earliest sample is found by which its
    sightings since the start have the rank that the certificate asks for; the certificate then
    holds as soon as those pairs hold together and to two distinct landmarks. The worst start is
    the answer. Between two starts where no pair's earliest sample jumps, the window only shrinks,
    so the graph is looked at where one jumps.
    """
    samples = steps_within(orbits.period, sensors.sample_time) + 1
    ready = _ready_steps(orbits, landmarks, sensors, windows, samples, largest)
    if not ready:
        return None
    table = np.array(list(ready.values()))
    jumps = np.flatnonzero(np.r_[True, (np.diff(table, axis=1) >= 2).any(axis=0)])
    distinct = _distinct_landmarks(landmarks, DISTINCT_LANDMARKS * float(orbits.radii.mean()))
    worst = 0
    for start in jumps:
        end = _first_certified(list(ready), table[:, start], orbits.count, distinct)
        if end is None or end - start + 1 > SEARCHED_PERIODS * samples:
            return None
        worst = max(worst, end - int(start) + 1)
    return round(worst * sensors.sample_time, 9)


def _ready_steps(
    orbits: Orbits,
    landmarks: Array,
    sensors: Sensors,
    windows: Windows,
    samples: int,
    largest: float,
) -> dict[tuple[int, int], Index]:
    """For each pair (a, b): the step by which it certifies when watched from step k on, (k,)."""
    last = (1 + SEARCHED_PERIODS) * samples
    sightings = sample_sightings(windows, orbits.period, sensors.sample_time, 0, last)
    ready = {}
    for pair in pair_rows(orbits, landmarks, sensors, sightings):
        needed = 2 if pair.b >= orbits.count else 3
        ready[pair.a, pair.b] = _ready_of_pair(pair, needed, samples, largest)
    return ready


def _ready_of_pair(pair: PairRows, needed: int, samples: int, largest: float) -> Index:
    """(samples,) the step by which the pair certifies when watched from step k on."""
    steps = pair.steps
    starts = np.searchsorted(steps, np.arange(samples))
    used = np.unique(starts[starts < len(steps)])
    length = _shortest_certified(pair.rows, used, needed, largest)
    end = np.where(length > 0, steps[np.minimum(used + length - 1, len(steps) - 1)], _NEVER)
    table = np.full(len(steps) + 1, _NEVER, dtype=np.int64)
    table[used] = end
    return table[starts]


def _shortest_certified(rows: Array, starts: Index, needed: int, largest: float) -> Index:
    """Fewest consecutive rows from each start whose rank is `needed`; 0 where none suffice."""
    low = np.full(len(starts), needed - 1)
    high = np.full(len(starts), needed)
    room = len(rows) - starts
    open_ = room >= needed
    high[~open_] = 0
    while open_.any():
        full = np.zeros(len(starts), dtype=bool)
        full[open_] = _certified(rows, starts[open_], high[open_], needed, largest)
        fails = open_ & ~full
        spent = fails & (high >= room)
        high[spent] = 0
        low = np.where(fails, high, low)
        open_ = fails & ~spent
        high[open_] = np.minimum(2 * high[open_], room[open_])
    while True:
        wide = (high > 0) & (high - low > 1)
        if not wide.any():
            return high
        middle = (low + high) // 2
        full = _certified(rows, starts[wide], middle[wide], needed, largest)
        high[wide] = np.where(full, middle[wide], high[wide])
        low[wide] = np.where(full, low[wide], middle[wide])


def _certified(
    rows: Array, starts: Index, lengths: Index, needed: int, largest: float
) -> NDArray[np.bool_]:
    """Whether rows[start : start + length] have the rank, many at once by length."""
    result = np.zeros(len(starts), dtype=bool)
    for length in np.unique(lengths):
        chosen = np.flatnonzero(lengths == length)
        for part in np.array_split(chosen, 1 + len(chosen) * int(length) // _BATCH):
            blocks = rows[starts[part, None] + np.arange(length)]
            values = np.linalg.svd(blocks, compute_uv=False)
            result[part] = values[:, needed - 1] > LINK_TOLERANCE * np.maximum(
                values[:, 0], largest
            )
    return result


def _distinct_landmarks(landmarks: Array, distance: float) -> NDArray[np.bool_]:
    """(m, m) whether two landmarks count as distinct."""
    apart = landmarks[:, None] - landmarks[None]
    return np.asarray(np.hypot(apart[..., 0], apart[..., 1]) > distance)


def _first_certified(
    pairs: list[tuple[int, int]], ready: Index, count: int, distinct: NDArray[np.bool_]
) -> int | None:
    """The step by which the certificate holds when each pair counts from its own step on."""
    merged = disjoint_sets(count)
    anchors: dict[int, set[int]] = {k: set() for k in range(count)}
    unheld = count
    for k in np.argsort(ready, kind="stable"):
        if ready[k] >= _NEVER:
            return None
        a, b = pairs[k]
        if b >= count:
            root = merged[a]
            grown = anchors[root] | {b - count}
            unheld -= _holds(grown, distinct) - _holds(anchors[root], distinct)
            anchors[root] = grown
        elif merged[a] != merged[b]:
            parts = anchors[merged[a]], anchors[merged[b]]
            merged.union(a, b)
            anchors[merged[a]] = parts[0] | parts[1]
            lost = 2 - sum(_holds(part, distinct) for part in parts)
            unheld += (1 - _holds(anchors[merged[a]], distinct)) - lost
        if unheld == 0:
            return int(ready[k])
    return None


def _holds(anchors: set[int], distinct: NDArray[np.bool_]) -> int:
    numbers = list(anchors)
    return int(distinct[np.ix_(numbers, numbers)].any()) if len(numbers) > 1 else 0
