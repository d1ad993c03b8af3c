"""What a flight kept of its plan: tracking and phase, separation, and who met whom.

A meeting of two bodies is planned once a period, where their contact windows of either direction
are; it is kept where a sighting of one by the other is made within half a period of the middle of
the longest of these.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.estimation.filter_setup import FilterSetup
from syncplan.estimation.kernels import kernel
from syncplan.orbits.circles import Orbits, phase, position, wrap
from syncplan.orbits.contacts import Windows


@dataclass(frozen=True, slots=True)
class Meetings:
    """Meetings that a plan has in a run.

    Attributes
    ----------
    pairs : (p, 2) bodies, the first a vehicle; those from n on are landmarks
    first_end : (p,) step at which the first meeting is over
    times : (p,) how many there are, all with a whole period about them in the run
    period : steps, of a period; no whole number
    """

    pairs: Index
    first_end: Array
    times: Index
    period: float


@dataclass(frozen=True, slots=True)
class Nearest:
    """The closest that any two vehicles come in each trial.

    Attributes
    ----------
    distance : (lanes,) m; infinite for one vehicle
    pair : (lanes, 2)
    step : (lanes,)
    """

    distance: Array
    pair: Index
    step: Index


def meetings_of(windows: Windows, sample_time: float, period: float, steps: int) -> Meetings:
    """Return the meetings of a plan in so many steps."""
    longest: dict[tuple[int, int], tuple[float, float]] = {}
    for k, (observer, target) in enumerate(
        zip(windows.observers.tolist(), windows.targets.tolist(), strict=True)
    ):
        pair = (min(observer, target), max(observer, target))
        for start, end in windows.of(k).tolist():
            if end - start > longest.get(pair, (-1.0, 0.0))[0]:
                longest[pair] = (end - start, 0.5 * (start + end))
    pairs = sorted(longest)
    middle = np.array([longest[pair][1] for pair in pairs]) % period
    # from half a period before the middle; the first that is wholly in the run
    end = np.where(middle >= 0.5 * period, middle + 0.5 * period, middle + 1.5 * period)
    length = period / sample_time
    first_end = end / sample_time
    times = np.maximum(np.floor((steps - first_end) / length + 1e-9) + 1.0, 0.0)
    return Meetings(
        np.array(pairs, dtype=np.int64).reshape(-1, 2), first_end, times.astype(np.int64), length
    )


def kept_meetings(
    meetings: Meetings, setup: FilterSetup, sightings: Array, gone: Index
) -> tuple[Array, Index]:
    """Return (p, lanes) how many of each pair's meetings were kept, and (p,) how many there were.

    A meeting that is not over when one of the two is gone, (n + m,) steps, is none.
    """
    count = int(setup.first[-1])
    step = np.repeat(np.arange(len(setup.first) - 1), np.diff(setup.first))
    a = np.minimum(setup.observers[:count], setup.targets[:count])
    b = np.maximum(setup.observers[:count], setup.targets[:count])
    made = np.isfinite(sightings[:count])
    kept = np.zeros((len(meetings.pairs), sightings.shape[1]))
    until = np.minimum(gone[meetings.pairs[:, 0]], gone[meetings.pairs[:, 1]])
    last = np.floor((until - meetings.first_end) / meetings.period) + 1.0
    times = np.minimum(meetings.times, np.maximum(last, 0.0)).astype(np.int64)
    for p, (first, second) in enumerate(meetings.pairs.tolist()):
        rows = np.flatnonzero((a == first) & (b == second))
        begin = meetings.first_end[p] - meetings.period
        number = np.floor((step[rows] - begin) / meetings.period).astype(np.int64)
        for k in range(times[p]):
            kept[p] += made[rows[number == k]].any(axis=0)
    return kept, times


def off_plan(orbits: Orbits, path: Array, time: float) -> tuple[Array, Array]:
    """Return (steps + 1, n, lanes) how far vehicles are from their places, m, and ahead of them, s.

    `path` is (steps + 1, n, 3, lanes), at steps of `time` s. Ahead is by the angle about the
    centre, within half a period.
    """
    times = time * np.arange(len(path))
    off = path[:, :, :2] - position(orbits, times)[..., None]
    arm = path[:, :, :2] - orbits.centers[:, :, None]
    turned = np.arctan2(arm[:, :, 1], arm[:, :, 0]) - phase(orbits, times)[..., None]
    ahead = wrap(turned) * (orbits.senses / orbits.rate)[:, None]
    return np.hypot(off[:, :, 0], off[:, :, 1]), ahead


def nearest(path: Array, there: Flags) -> Nearest:
    """Return the closest that two vehicles come on paths (steps + 1, n, 3, lanes).

    `there` is (steps + 1, n): vehicles that are gone do not count.
    """
    lanes = path.shape[-1]
    squares, pair = np.full(lanes, np.inf), np.zeros((lanes, 2), dtype=np.int64)
    step = np.zeros(lanes, dtype=np.int64)
    _find_nearest(np.ascontiguousarray(path), there, squares, pair, step)
    return Nearest(np.sqrt(squares), pair, step)


@kernel
def _find_nearest(path: Array, there: Flags, squares: Array, pair: Index, step: Index) -> None:
    for k in range(len(path)):
        for i in range(path.shape[1]):
            for j in range(i):
                if not (there[k, i] and there[k, j]):
                    continue
                for lane in range(path.shape[3]):
                    dx = path[k, i, 0, lane] - path[k, j, 0, lane]
                    dy = path[k, i, 1, lane] - path[k, j, 1, lane]
                    square = dx * dx + dy * dy
                    if square < squares[lane]:
                        squares[lane], step[lane] = square, k
                        pair[lane, 0], pair[lane, 1] = j, i
