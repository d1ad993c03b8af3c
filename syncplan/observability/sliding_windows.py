"""Sliding windows: the shortest that certifies a team, and observability in recorded ones."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.observability import rank
from syncplan.observability.spectrum import Observability
from syncplan.orbits.circles import perpendicular
from syncplan.orbits.graphs import DisjointSets
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS
from syncplan.orbits.sightings import sample_sightings, steps_within

# --- the shortest window --------------------------------------------------------------------------


SEARCHED_PERIODS = 2

CLEARLY = 30.0
"""Factor above the tolerance of a link's rank beyond which rounding cannot matter."""

_NEVER = np.iinfo(np.int64).max // 4
_BATCH = 20_000


def connectivity_period(assessed: rank.Assessment) -> float | None:
    """Return the connectivity period in s, or None if no window of two periods certifies.

    Links are measured against the largest singular value of the team's matrix over the window
    assessed.

    For every start just after a sample, the search finds the earliest sample by which each pair's
    sightings since the start have the rank that the certificate requires. The certificate holds
    once these pairs tie every component to two distinct landmarks. The worst start decides. As long
    as no pair's earliest sample jumps from one start to the next, the window only shrinks, so the
    graph is examined only where one jumps.
    """
    team = assessed.team
    orbits, sample_time = team.orbits, team.sensors.sample_time
    samples = steps_within(orbits.period, sample_time) + 1
    ready = _ready_steps(assessed, samples)
    if not ready:
        return None
    table = np.array(list(ready.values()))
    jumps = np.flatnonzero(np.r_[True, (np.diff(table, axis=1) >= 2).any(axis=0)])
    distinct = _distinct_landmarks(
        team.landmarks, rank.DISTINCT_LANDMARKS * float(orbits.radii.mean())
    )
    worst = 0
    for start in jumps:
        end = _first_certified(list(ready), table[:, start], orbits.count, distinct)
        if end is None or end - start + 1 > SEARCHED_PERIODS * samples:
            return None
        worst = max(worst, end - int(start) + 1)
    return round(worst * sample_time, 9)


def _ready_steps(assessed: rank.Assessment, samples: int) -> dict[tuple[int, int], Index]:
    """Step by which each pair (a, b) certifies when watched from each start, (samples,)."""
    team, period = assessed.team, assessed.team.orbits.period
    last = (1 + SEARCHED_PERIODS) * samples
    sightings = sample_sightings(assessed.windows, period, team.sensors, 0, last)
    pairs = list(rank.pair_rows(team, sightings))
    starts = [np.searchsorted(pair.steps, np.arange(samples)) for pair in pairs]
    used = [np.unique(of[of < len(pair.steps)]) for pair, of in zip(pairs, starts, strict=True)]
    needed = [2 if pair.b >= team.count else 3 for pair in pairs]
    lengths = _shortest_certified([pair.rows for pair in pairs], used, needed, assessed.largest)
    ready = {}
    for pair, of, row, length in zip(pairs, starts, used, lengths, strict=True):
        end = pair.steps[np.minimum(row + length - 1, len(pair.steps) - 1)]
        table = np.full(len(pair.steps) + 1, _NEVER, dtype=np.int64)
        table[row] = np.where(length > 0, end, _NEVER)
        ready[pair.a, pair.b] = table[of]
    return ready


@dataclass(frozen=True, slots=True)
class _Starts:
    """Rows of all pairs, one pair after another, and the possible starts of windows."""

    rows: Array  # (k, 6)
    pair: Index  # (s,) ascending
    row: Index  # (s,) first row of the window
    room: Index  # (s,) rows from there to the pair's last
    needed: Index  # (s,) rank required

    def only(self, chosen: Flags | Index) -> "_Starts":
        """Return the chosen starts."""
        return _Starts(
            self.rows, self.pair[chosen], self.row[chosen], self.room[chosen], self.needed[chosen]
        )


def _shortest_certified(
    rows: list[Array], starts: list[Index], needed: list[int], largest: float
) -> list[Index]:
    """Fewest consecutive rows from each start of each pair that have rank `needed`.

    0 where none suffice. All pairs are searched at once: lengths are doubled until the rank is
    reached, then bisected. A pair is given up if its first window falls short and all its rows
    together are too weak compared with `largest`: fewer rows have no larger singular value.
    """
    if not rows:
        return []
    number = [len(of) for of in starts]
    begin = np.cumsum([0] + [len(of) for of in rows])
    pair = np.repeat(np.arange(len(rows)), number)
    row = np.concatenate(starts) + begin[pair]
    all_ = _Starts(np.concatenate(rows), pair, row, begin[pair + 1] - row, np.array(needed)[pair])
    high = np.where(all_.room >= all_.needed, all_.needed, 0)
    lead = np.cumsum([0, *number[:-1]])
    lead = lead[high[lead] > 0]
    for k in pair[lead[~_certified(all_.only(lead), high[lead], largest)]].tolist():
        value = np.linalg.svd(rows[k], compute_uv=False)[needed[k] - 1]
        if value <= rank.LINK_TOLERANCE * largest:
            high[pair == k] = 0
    short = high > 0
    short[short] = ~_certified(all_.only(short), high[short], largest)
    high[short] = _searched(all_.only(short), largest)
    return np.split(high, np.cumsum(number)[:-1])


def _searched(starts: _Starts, largest: float) -> Index:
    """Fewest rows, more than `needed`, from each start; 0 where none suffice."""
    low, high = starts.needed, np.minimum(2 * starts.needed, starts.room)
    high = np.where(high > low, high, 0)
    open_ = high > 0
    while open_.any():
        fails = open_.copy()
        fails[open_] = ~_certified(starts.only(open_), high[open_], largest)
        low = np.where(fails, high, low)
        open_ = fails & (high < starts.room)
        high = np.where(fails, 0, high)
        high[open_] = np.minimum(2 * low[open_], starts.room[open_])
    while True:
        wide = (high > 0) & (high - low > 1)
        if not wide.any():
            return high
        middle = (low + high) // 2
        full = np.zeros(len(high), dtype=bool)
        full[wide] = _certified(starts.only(wide), middle[wide], largest)
        high = np.where(full, middle, high)
        low = np.where(wide & ~full, middle, low)


def _certified(starts: _Starts, lengths: Index, largest: float) -> Flags:
    """Whether windows of these lengths have the rank; those of one length are batched."""
    result = np.ones(len(lengths), dtype=bool)
    squares = np.cumsum(np.concatenate([[0.0], np.einsum("sc,sc->s", starts.rows, starts.rows)]))
    for length in np.unique(lengths):
        same = np.flatnonzero(lengths == length)
        for whole in np.array_split(same, 1 + len(same) * int(length) // _BATCH):
            part = whole[~_clearly_certified(starts.only(whole), squares, int(length), largest)]
            if not len(part):
                continue
            blocks = starts.rows[starts.row[part, None] + np.arange(length)]
            values = np.linalg.svd(blocks, compute_uv=False)
            counted = values[np.arange(len(part)), starts.needed[part] - 1]
            result[part] = counted > rank.LINK_TOLERANCE * np.maximum(values[:, 0], largest)
    return result


def _clearly_certified(starts: _Starts, squares: Array, length: int, largest: float) -> Flags:
    """Whether windows of `length` rows have the rank beyond doubt, without singular values.

    Three of the rows, or two, have no larger singular values than all. Their Gram matrix G has
    det G = s1^2 s2^2 s3^2 and s1^2 + s2^2 <= tr G, so s3^2 >= det G / (tr G / 2)^2; for two rows
    s2^2 >= det G / tr G. A value above the tolerance by the factor CLEARLY is no rounding error.
    `squares` holds the cumulative sums of squares of the rows.
    """
    first, middle, last = (starts.rows[starts.row + k] for k in (0, length // 2, length - 1))
    aa, cc, ac = (
        np.einsum("sc,sc->s", *of) for of in ((first, first), (last, last), (first, last))
    )
    bb, ab, bc = (
        np.einsum("sc,sc->s", *of) for of in ((middle, middle), (first, middle), (middle, last))
    )
    two = aa * cc - ac * ac
    three = aa * (bb * cc - bc * bc) - ab * (ab * cc - bc * ac) + ac * (ab * bc - bb * ac)
    trace = aa + cc
    with np.errstate(divide="ignore", invalid="ignore"):
        least = np.where(starts.needed == 2, two / trace, three / (0.5 * (trace + bb)) ** 2)
    # sum of squares of all rows: the square of no singular value is larger
    of_all = squares[starts.row + length] - squares[starts.row]
    largest_square = np.maximum(of_all, largest**2)
    return np.asarray(least > (CLEARLY * rank.LINK_TOLERANCE) ** 2 * largest_square)


def _distinct_landmarks(landmarks: Array, distance: float) -> Flags:
    """(m, m) whether two landmarks count as distinct."""
    apart = landmarks[:, None] - landmarks[None]
    return np.asarray(np.hypot(apart[..., 0], apart[..., 1]) > distance)


def _first_certified(
    pairs: list[tuple[int, int]], ready: Index, count: int, distinct: Flags
) -> int | None:
    """First step at which the certificate holds, if each pair counts from its own step on."""
    merged = DisjointSets(count)
    anchors: dict[int, set[int]] = {k: set() for k in range(count)}
    held = [False] * count
    unheld = count
    for k in np.argsort(ready, kind="stable"):
        if ready[k] >= _NEVER:
            return None
        a, b = pairs[k]
        if b >= count:
            root = merged[a]
            anchors[root].add(b - count)
            if not held[root] and _hold(anchors[root], distinct):
                held[root] = True
                unheld -= 1
        elif merged[a] != merged[b]:
            parts = merged[a], merged[b]
            merged.union(a, b)
            root = merged[a]
            unheld -= sum(not held[part] for part in parts)
            anchors[root] = anchors[parts[0]] | anchors[parts[1]]
            held[root] = any(held[part] for part in parts) or _hold(anchors[root], distinct)
            unheld += not held[root]
        if unheld == 0:
            return int(ready[k])
    return None


def _hold(anchors: set[int], distinct: Flags) -> bool:
    """Whether two of the landmarks are distinct."""
    numbers = list(anchors)
    return len(numbers) > 1 and bool(distinct[np.ix_(numbers, numbers)].any())


# --- windows along any paths ----------------------------------------------------------------------
#
# The closed form of `referred_rows` holds for any path. With the slope g of a sighting by the
# target's place, and the displacements d of both since the window began, a row is
#
#     target    g, g . J d_target              observer    -g, -g . J d_observer + dz / dpsi
#
# with J a quarter turn counter-clockwise. Paths should be those of odometry, which are smooth:
# places from motion capture jitter, and jitter turns lines of sight that never turned.


Placed = Callable[[int, slice], tuple[Array, Array]]
"""Function from a window's number and its sightings (s,) to places in m: (n, 2) of vehicles when it
begins, and (s, 2, 2) of observer and target at each sighting."""

INVOLVED = 1e-6
"""Share of an unobservable direction above which a vehicle takes part in it."""


@dataclass(frozen=True, slots=True)
class WatchedTeam:
    """Recorded sightings of a team, in order of time.

    Attributes
    ----------
    times : (s,) s
    observers, targets : (s,) indices; targets from `count` on are landmarks
    kinds : (s,) indices in SIGHTING_KINDS, of kinds that have a target
    sigmas : (s,) standard deviations, in the unit of the kind
    count : number of vehicles
    landmarks : (m, 2) m
    scale : m, unit of positions
    """

    times: Array
    observers: Index
    targets: Index
    kinds: Index
    sigmas: Array
    count: int
    landmarks: Array
    scale: float


@dataclass(frozen=True, slots=True)
class SeenWindow:
    """Observability of the poses at the beginning of one window from its sightings.

    Attributes
    ----------
    begin, end : s
    observability, certificate : verdict and certificate of all its sightings
    """

    begin: float
    end: float
    observability: Observability
    certificate: rank.Certificate

    @property
    def position_sigma(self) -> float:
        """Position sigma in m of the worst vehicle, from this window; infinite if unobservable."""
        found = self.observability
        if not found.observable:
            return float("inf")
        variances = found.variances.reshape(-1, 3)[:, :2].sum(axis=1)
        return float(found.scale * np.sqrt(variances.max()))


def judged_windows(
    watched: WatchedTeam, placed: Placed, begins: Array, ends: Array
) -> Iterator[SeenWindow]:
    """Yield the observability of each window, after `begins` and up to `ends` (w,) s."""
    first = np.searchsorted(watched.times, begins, side="right").tolist()
    last = np.searchsorted(watched.times, ends, side="right").tolist()
    for k, (a, b) in enumerate(zip(first, last, strict=True)):
        rows = _rows(watched, *placed(k, slice(a, b)), slice(a, b))
        seen = watched.observers[a:b], watched.targets[a:b], np.arange(a, b)
        links = [rank.link_of(pair) for pair in rank.rows_by_pair(rows, *seen, watched.count)]
        verdict = rank.judged_rank(watched.count, links, watched.scale)
        certificate = rank.certify(watched, verdict, links)
        yield SeenWindow(float(begins[k]), float(ends[k]), verdict, certificate)


def undetermined(verdict: Observability) -> list[int]:
    """Return the vehicles that have an undetermined coordinate."""
    parts = np.abs(verdict.null_space).reshape(len(verdict.null_space), -1, 3)
    return np.flatnonzero((parts > INVOLVED).any(axis=(0, 2))).tolist()


def _rows(watched: WatchedTeam, starts: Array, places: Array, of: slice) -> Array:
    """Rows (s, 6) over sigma: the observer's three columns, then the target's; unit `scale`."""
    o, t = watched.observers[of], watched.targets[of]
    to_vehicle = t < watched.count
    q = (places[:, 1] - places[:, 0]).T
    weights, slopes = 1.0 / watched.sigmas[of], np.zeros((2, len(o)))
    by_heading = np.zeros(len(o))
    for place, kind in enumerate(SIGHTING_KINDS.values()):
        same = watched.kinds[of] == place
        if kind.of_target and same.any():
            slopes[:, same] = kind.slopes(q[:, same], weights[same])
            by_heading[same] = kind.by_heading * weights[same]
    gone = places[:, 0] - starts[o]
    target_gone = places[:, 1] - starts[np.where(to_vehicle, t, 0)]
    rows = np.zeros((len(o), 6))
    rows[:, :2], rows[:, 3:5] = -watched.scale * slopes.T, watched.scale * slopes.T
    rows[:, 2] = by_heading - np.sum(slopes.T * perpendicular(gone), axis=1)
    rows[:, 5] = np.sum(slopes.T * perpendicular(target_gone), axis=1)
    rows[~to_vehicle, 3:] = 0.0
    return rows
