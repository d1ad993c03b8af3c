"""Sliding windows: the shortest that certifies a team, and observability in recorded ones."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncplan.arrays import Array, Flags, Index
from syncplan.observability import rank
from syncplan.observability.referred_rows import sighting_rows
from syncplan.observability.spectrum import Observability
from syncplan.orbits.circles import perpendicular
from syncplan.orbits.contacts import Windows
from syncplan.orbits.graphs import DisjointSets
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS
from syncplan.orbits.sightings import Sightings, sample_sightings, steps_within

# --- the shortest window --------------------------------------------------------------------------


SEARCHED_PERIODS = 2

CLEARLY = 30.0
"""Factor above the tolerance of a link's rank beyond which rounding cannot matter."""

_ROUNDING = 1e-9
"""Share of a run by which a window may be longer and still fit."""

_BATCH = 20_000
_BEYOND = np.iinfo(np.int64).max // 2
_PART = 200_000
"""Sightings that are sorted, or whose rows are computed, at once."""


def connectivity_period(assessed: rank.Assessment, run: float = np.inf) -> float | None:
    """Return the connectivity period in s, or None if no window of two periods certifies.

    It is None, too, if it is longer than the `run` in s, of which no window is then sure to
    certify. Links are measured against the largest singular value of the team's matrix over the
    window assessed.

    For a start just after a sample, the window ends where each of some pairs has sightings of the
    rank that the certificate requires, and these pairs tie every component to two distinct
    landmarks. The worst start decides.

    As many sightings as the rank mostly have it, so it is taken for granted at first. Within the
    longest window so far, the pairs that tie the team by their latest sightings serve all starts
    up to the first of these; the next start is examined then. Only the sightings used are checked.
    Where they lack the rank, all windows of the pair are searched, and all starts examined anew.
    """
    sample_time = assessed.team.sensors.sample_time
    samples = steps_within(assessed.team.orbits.period, sample_time) + 1
    if not len(assessed.windows.observers):
        return None
    for periods in range(1, SEARCHED_PERIODS + 1):
        seen = _PairSightings.of(assessed, (1 + periods) * samples)
        longest = seen.longest_window(samples)
        if longest is not None and longest <= SEARCHED_PERIODS * samples:
            certified = round(longest * sample_time, 9)
            return certified if certified <= run * (1.0 + _ROUNDING) else None
    return None


@dataclass(frozen=True, slots=True)
class _PairSightings:
    """Sightings of all pairs, each numbered `code span + step`, with code = a (n + m) + b.

    Attributes
    ----------
    span : number of steps, and one that is never reached
    codes : (p,) of the pairs, ascending
    numbers : (s,) ascending; the last is beyond all sightings
    ends : (s,) number of the sighting with which a window that begins at each has the rank
        required; that of the last step of the span if none has. Ascending
    ways : (s,) twice the kind, and one more if b sights a
    searched : (p,) whether `ends` are known to be right
    """

    assessed: rank.Assessment
    span: int
    codes: Index
    numbers: Index
    ends: Index
    ways: NDArray[np.uint8]
    searched: Flags

    @classmethod
    def of(cls, assessed: rank.Assessment, last: int) -> "_PairSightings":
        """Return the sightings up to step `last`, of which the fewest have the rank required."""
        team, windows, span = assessed.team, assessed.windows, last + 2
        bodies, sensors = team.count + len(team.landmarks), team.sensors
        for kind in SIGHTING_KINDS.values():
            if not kind.of_target and np.any(kind.sigmas(sensors) < np.inf):
                without: dict[str, Any] = {kind.sigma_name: np.array(np.inf)}
                sensors = replace(sensors, **without)
        code = _codes(windows.observers, windows.targets, bodies)
        codes = np.sort(code)[np.flatnonzero(np.diff(np.sort(code), prepend=-1))]
        number = np.diff(windows.first)
        parts = []
        for some in np.array_split(codes, 1 + len(codes) * last // (2 * _PART)):
            kept = (code >= some[0]) & (code <= some[-1])
            within = Windows(
                windows.observers[kept],
                windows.targets[kept],
                np.concatenate([[0], np.cumsum(number[kept])]),
                windows.starts[np.repeat(kept, number)],
                windows.ends[np.repeat(kept, number)],
            )
            made = sample_sightings(within, team.orbits.period, sensors, 0, last)
            base = span * _codes(made.observers, made.targets, bodies)
            order = np.argsort(base + made.steps, kind="stable")
            base, numbers = base[order], (base + made.steps)[order]
            never = base + (span - 1)
            after = np.concatenate([numbers[1:], never[-1:], never[-1:]])
            landmark = made.targets[order] >= team.count
            ends = np.minimum(np.where(landmark, after[:-1], after[1:]), never)
            ways = (2 * made.kinds + (made.observers > made.targets)).astype(np.uint8)
            parts.append((numbers, ends, ways[order]))
        # the last number lies beyond all
        parts.append((np.array([_BEYOND]), np.array([_BEYOND]), np.array([0], dtype=np.uint8)))
        numbers, ends, ways = (np.concatenate(of) for of in zip(*parts, strict=True))
        return cls(assessed, span, codes, numbers, ends, ways, np.zeros(len(codes), dtype=bool))

    def longest_window(self, samples: int) -> int | None:
        """Return the most steps after any of the first `samples` starts; None if none suffice."""
        while True:
            longest, used = self._examined(samples)
            if longest is None:
                return None
            lacking = self._lacking(used)
            if not len(lacking):
                return longest
            for some in np.array_split(lacking, 1 + len(lacking) * self.span // _PART):
                self._search(some)

    def _examined(self, samples: int) -> tuple[int | None, Index]:
        """Most steps after any start, as far as `ends` are right, and the sightings used (k,)."""
        team, base = self.assessed.team, self.span * self.codes
        a, b = np.divmod(self.codes, team.count + len(team.landmarks))
        apart = rank.DISTINCT_LANDMARKS * float(team.orbits.radii.mean())
        between = list(zip(a.tolist(), b.tolist(), strict=True))
        of = between, team.count, _distinct_landmarks(team.landmarks, apart)
        longest, start, used = 0, 0, []
        while start < samples:
            end = min(start + longest, self.span - 1) - 1
            row = np.searchsorted(self.ends, base + end, side="right") - 1
            latest = np.where(row < 0, -1, self.numbers[row] - base)
            order = np.argsort(-latest, kind="stable")[: int(np.sum(latest >= start))]
            pairs = _tying(order, *of)
            if pairs is not None:
                used.append(row[pairs])
                start = int(latest[pairs[-1]]) + 1
                continue
            row = np.searchsorted(self.numbers, base + start)
            ready = self.ends[row] - base
            order = np.argsort(ready, kind="stable")[: int(np.sum(ready < self.span - 1))]
            pairs = _tying(order, *of)
            if pairs is None:
                return None, row[:0]
            longest = int(ready[pairs[-1]]) - start + 1
        return longest, np.concatenate(used)

    def _lacking(self, used: Index) -> Index:
        """Pairs (k,) without the rank required in a window that begins at one of the sightings."""
        pair = np.searchsorted(self.codes, self.numbers[used] // self.span)
        row, pair = used[~self.searched[pair]], pair[~self.searched[pair]]
        lacks = np.zeros(len(self.codes), dtype=bool)
        for some in np.array_split(np.arange(len(row)), 1 + 3 * len(row) // _PART):
            needed = self._needed(pair[some])
            first = np.cumsum(needed) - needed
            which = np.repeat(row[some] - first, needed) + np.arange(int(needed.sum()))
            starts = _Starts(self._rows(which), pair[some], first, needed, needed)
            full = _certified(starts, needed, self.assessed.largest)
            lacks[pair[some][~full]] = True
        return np.flatnonzero(lacks)

    def _search(self, pairs: Index) -> None:
        """Find the `ends` of pairs (k,), ascending, by singular values."""
        base = self.span * self.codes[pairs]
        begin, end = np.searchsorted(self.numbers, [base, base + self.span])
        pair = np.repeat(np.arange(len(pairs)), end - begin)
        place = np.arange(len(pair))
        which = place + (begin - np.cumsum(end - begin) + end - begin)[pair]
        room, needed = end[pair] - which, self._needed(pairs)[pair]
        starts = _Starts(self._rows(which), pair, place, room, needed)
        length = _shortest_certified(starts, self.assessed.largest)
        last = self.numbers[which + np.maximum(length - 1, 0)]
        found = np.where(length > 0, last, base[pair] + self.span - 1)
        # a window has the rank if one within it has
        self.ends[which] = np.minimum.accumulate(found[::-1])[::-1]
        self.searched[pairs] = True

    def _needed(self, pairs: Index) -> Index:
        """Rank (k,) that the certificate requires of pairs (k,)."""
        team = self.assessed.team
        target = self.codes[pairs] % (team.count + len(team.landmarks))
        return np.where(target < team.count, 3, 2)

    def _rows(self, which: Index) -> Array:
        """Rows (k, 6) of the sightings numbered, the columns of a before those of b."""
        team = self.assessed.team
        code, steps = np.divmod(self.numbers[which], self.span)
        a, b = np.divmod(code, team.count + len(team.landmarks))
        kinds, back = np.divmod(self.ways[which].astype(np.int64), 2)
        made = Sightings(steps, np.where(back, b, a), np.where(back, a, b), kinds)
        rows = sighting_rows(team, made)
        return np.where(back[:, None], rows[:, [3, 4, 5, 0, 1, 2]], rows)


def _codes(observers: Index, targets: Index, bodies: int) -> Index:
    return np.asarray(np.minimum(observers, targets) * bodies + np.maximum(observers, targets))


def _tying(
    order: Index, pairs: list[tuple[int, int]], count: int, distinct: Flags
) -> list[int] | None:
    """Those of the pairs (a, b), taken in order, that tie all vehicles to distinct landmarks."""
    merged = DisjointSets(count)
    seen: list[set[int]] = [set() for _ in range(count)]
    held = [False] * count
    unheld, used = count, []
    for pair in order.tolist():
        a, b = pairs[pair]
        part = merged[a]
        other = merged[b] if b < count else part
        if (held[part] and held[other]) or (b < count and part == other):
            continue
        anchors = seen[other] if b < count else {b - count}
        holds = held[part] or held[other]
        holds = holds or any(distinct[one, two] for one in seen[part] for two in anchors)
        unheld -= (not held[part]) + (part != other and not held[other]) - (not holds)
        anchors = seen[part] | anchors
        merged.union(part, other)
        seen[merged[a]], held[merged[a]] = anchors, holds
        used.append(pair)
        if not unheld:
            return used
    return None


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


def _shortest_certified(starts: _Starts, largest: float) -> Index:
    """Fewest consecutive rows from each start, one at every row, that have the rank needed.

    0 where none suffice. All pairs are searched at once: lengths are doubled until the rank is
    reached, then bisected. A pair is given up if its first window falls short and all its rows
    together are too weak compared with `largest`: fewer rows have no larger singular value.
    """
    high = np.where(starts.room >= starts.needed, starts.needed, 0)
    lead = np.flatnonzero((np.diff(starts.pair, prepend=-1) > 0) & (high > 0))
    for k in lead[~_certified(starts.only(lead), high[lead], largest)].tolist():
        rows = starts.rows[k : k + starts.room[k]]
        value = np.linalg.svd(rows, compute_uv=False)[starts.needed[k] - 1]
        if value <= rank.LINK_TOLERANCE * largest:
            high[k : k + len(rows)] = 0
    short = high > 0
    short[short] = ~_certified(starts.only(short), high[short], largest)
    high[short] = _searched(starts.only(short), largest)
    return high


def _searched(starts: _Starts, largest: float) -> Index:
    """Fewest rows, more than `needed`, from each start; 0 where none suffice."""
    low, high = starts.needed.copy(), np.zeros(len(starts.needed), dtype=np.int64)
    while True:
        open_ = np.where(high > 0, high - low > 1, low < starts.room)
        if not open_.any():
            return high
        tried = np.where(high > 0, (low + high) // 2, np.minimum(2 * low, starts.room))[open_]
        full = _certified(starts.only(open_), tried, largest)
        low[open_] = np.where(full, low[open_], tried)
        high[open_] = np.where(full, tried, high[open_])


def _certified(starts: _Starts, lengths: Index, largest: float) -> Flags:
    """Whether windows of these lengths have the rank; those of one length are batched."""
    squares = np.cumsum(np.concatenate([[0.0], np.einsum("sc,sc->s", starts.rows, starts.rows)]))
    result = _clearly_certified(starts, squares, lengths, largest)
    doubtful = np.flatnonzero(~result)
    for length in np.flatnonzero(np.bincount(lengths[doubtful])).tolist():
        same = doubtful[lengths[doubtful] == length]
        for part in np.array_split(same, 1 + len(same) * length // _BATCH):
            blocks = starts.rows[starts.row[part, None] + np.arange(length)]
            values = np.linalg.svd(blocks, compute_uv=False)
            counted = values[np.arange(len(part)), starts.needed[part] - 1]
            result[part] = counted > rank.LINK_TOLERANCE * np.maximum(values[:, 0], largest)
    return result


def _clearly_certified(starts: _Starts, squares: Array, lengths: Index, largest: float) -> Flags:
    """Whether windows of these lengths have the rank beyond doubt, without singular values.

    Three of the rows, or two, have no larger singular values than all. Their Gram matrix G has
    det G = s1^2 s2^2 s3^2 and s1^2 + s2^2 <= tr G, so s3^2 >= det G / (tr G / 2)^2; for two rows
    s2^2 >= det G / tr G. A value above the tolerance by the factor CLEARLY is no rounding error.
    `squares` holds the cumulative sums of squares of the rows.
    """
    first, middle, last = (starts.rows[starts.row + k] for k in (0, lengths // 2, lengths - 1))
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
    of_all = squares[starts.row + lengths] - squares[starts.row]
    largest_square = np.maximum(of_all, largest**2)
    return np.asarray(least > (CLEARLY * rank.LINK_TOLERANCE) ** 2 * largest_square)


def _distinct_landmarks(landmarks: Array, distance: float) -> Flags:
    """(m, m) whether two landmarks count as distinct."""
    apart = landmarks[:, None] - landmarks[None]
    return np.asarray(np.hypot(apart[..., 0], apart[..., 1]) > distance)


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
