"""How much faster exact contact windows are than sampling, and what coarse sampling misses.

A thousand vehicles on a 40 x 25 grid with random phases: every directed pair that can come within
range, over one period, to 1e-9 s. The other side samples and bisects, in two ways. Pair by pair,
as event finders do it: NumPy over the samples of one pair, then over its changes. And all at once,
as fast as NumPy allows: positions of all vehicles at evenly spaced samples, visibility of all
candidate pairs in blocks that stay in the cache, then all changes bisected together. Both look at
the same pairs, and the windows are compared one by one.

    python benchmarks/contacts.py
"""

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.circles import NO_LANDMARKS, Orbits, heading, position
from syncplan.orbits.contacts import Windows, find_windows, reachable_pairs
from syncplan.orbits.noise import Noise
from syncplan.orbits.team import Sensors, Team

Flags = Flags

COLUMNS, ROWS = 40, 25
SPACING_M, RADIUS_M, RANGE_M, RATE = 70.0, 20.0, 50.0, 0.2
SEED = 1
ACCURACY_S = 1e-9
AGREEMENT_S = 1e-8
COARSE, DENSE = 200, 2000
"""Samples per period."""

MOST_SAMPLES = 128_000
"""Where the two sides still differ with this many samples, something is wrong."""

PAIRS_AT_ONCE, LOOKS_AT_ONCE = 64, 500
"""Size of the blocks sampled at once: they stay in the cache."""

PAIRS_ONE_BY_ONE = 400
"""Pairs that are sampled one by one; the time is scaled to all of them."""

CASES = {
    "ccw": ("one sense", False, 360.0),
    "alternate": ("alternating", True, 360.0),
    "ccw_fov": ("one sense, 115 deg", False, 115.0),
    "alternate_fov": ("alternating, 115 deg", True, 115.0),
}
TARGETS_S = {"ccw": 0.1, "alternate": 0.1, "ccw_fov": 0.5, "alternate_fov": 0.5}
RATIO_TARGET = 100.0


def grid(alternating: bool, fov_deg: float) -> tuple[Orbits, Sensors]:
    """Return the orbits, phases drawn from SEED, and the sensors."""
    row, column = (index.ravel() for index in np.indices((ROWS, COLUMNS)))
    count = ROWS * COLUMNS
    orbits = Orbits(
        centers=SPACING_M * np.column_stack([column, row]).astype(float),
        radii=np.full(count, RADIUS_M),
        senses=np.where((row + column) % 2 == 1, -1.0, 1.0) if alternating else np.ones(count),
        phases=np.random.default_rng(SEED).uniform(0.0, 2.0 * np.pi, count),
        rate=RATE,
    )
    sensors = Sensors(
        ranges=np.full(count, RANGE_M),
        fields_of_view=np.full(count, np.radians(fov_deg)),
        boresights=np.zeros(count),
        bearing_sigmas=np.full(count, 0.1),
        sample_time=0.1,
    )
    return orbits, sensors


# --- the other side: sampling and bisection ------------------------------------------------------


def sampled_windows(orbits: Orbits, sensors: Sensors, samples: int) -> Windows:
    """Return the windows found by `samples` looks a period and bisection to ACCURACY_S."""
    a, b = reachable_pairs(orbits, sensors.ranges)
    step = orbits.period / samples
    at_first = _sight(orbits, sensors, a, b, np.zeros(len(a)))
    found = []
    for begin in range(0, samples, LOOKS_AT_ONCE):
        looks = np.arange(begin, min(begin + LOOKS_AT_ONCE, samples) + 1)
        found += _sampled_changes(orbits, sensors, a, b, looks, step)
    pair, look, closing = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort((look, pair))
    pair, look, closing = pair[order], look[order], closing[order]
    low, high = look * step, (look + 1) * step
    for _ in range(max(1, int(np.ceil(np.log2(step / ACCURACY_S))))):
        middle = 0.5 * (low + high)
        before = _sight(orbits, sensors, a[pair], b[pair], middle) == closing
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return _windows(orbits, a, b, at_first, pair, closing, 0.5 * (low + high))


def windows_pair_by_pair(orbits: Orbits, sensors: Sensors, samples: int, pairs: int) -> Windows:
    """Return the windows of the first `pairs` pairs, each sampled and bisected by itself."""
    a, b = (side[:pairs] for side in reachable_pairs(orbits, sensors.ranges))
    step = orbits.period / samples
    times: Array = np.arange(samples + 1, dtype=float) * step
    at_first = np.zeros(len(a), dtype=bool)
    pair, closing, when = [], [], []
    for k in range(len(a)):
        seen = _sight_of_pair(orbits, sensors, int(a[k]), int(b[k]), times)
        at_first[k] = seen[0]
        look = np.flatnonzero(seen[1:] != seen[:-1])
        low, high, kind = times[look], times[look + 1], seen[look]
        for _ in range(max(1, int(np.ceil(np.log2(step / ACCURACY_S))))):
            middle = 0.5 * (low + high)
            before = _sight_of_pair(orbits, sensors, int(a[k]), int(b[k]), middle) == kind
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        pair.append(np.full(len(look), k))
        closing.append(kind)
        when.append(0.5 * (low + high))
    return _windows(
        orbits,
        a,
        b,
        at_first,
        np.concatenate(pair),
        np.concatenate(closing),
        np.concatenate(when),
    )


def _sight_of_pair(orbits: Orbits, sensors: Sensors, a: int, b: int, times: Array) -> Flags:
    """(s,) whether vehicle a sees vehicle b at the times."""
    return _sight(orbits, sensors, np.full(len(times), a), np.full(len(times), b), times)


def _sampled_changes(
    orbits: Orbits, sensors: Sensors, a: Index, b: Index, looks: Index, step: float
) -> list[tuple[Index, Index, Flags]]:
    """Pair, look before it, and kind (closing) of every change between neighbouring looks."""
    times = looks * step
    x, y = np.ascontiguousarray(position(orbits, times).transpose(2, 1, 0))
    limited = bool((sensors.fields_of_view < 2.0 * np.pi).any())
    if limited:
        axis = heading(orbits, times).T + sensors.boresights[:, None]
        ahead_x, ahead_y = np.cos(axis), np.sin(axis)
    found = []
    for begin in range(0, len(a), PAIRS_AT_ONCE):
        block = slice(begin, begin + PAIRS_AT_ONCE)
        i, j = a[block], b[block]
        dx, dy = x[j] - x[i], y[j] - y[i]
        square = dx * dx + dy * dy
        seen = square <= np.square(sensors.ranges[i, None])
        if limited:
            along = dx * ahead_x[i] + dy * ahead_y[i]
            seen &= along >= np.cos(0.5 * sensors.fields_of_view[i, None]) * np.sqrt(square)
        pair, look = np.nonzero(seen[:, 1:] != seen[:, :-1])
        found.append((pair + begin, looks[look], seen[pair, look]))
    return found


def _sight(orbits: Orbits, sensors: Sensors, a: Index, b: Index, times: Array) -> Flags:
    """(s,) whether observer a[s] sees target b[s] at times[s]."""
    turned = orbits.rate * times
    at_a = orbits.phases[a] + orbits.senses[a] * turned
    at_b = orbits.phases[b] + orbits.senses[b] * turned
    c, r = orbits.centers, orbits.radii
    dx = c[b, 0] - c[a, 0] + r[b] * np.cos(at_b) - r[a] * np.cos(at_a)
    dy = c[b, 1] - c[a, 1] + r[b] * np.sin(at_b) - r[a] * np.sin(at_a)
    square = dx * dx + dy * dy
    seen = square <= np.square(sensors.ranges[a])
    half = 0.5 * sensors.fields_of_view[a]
    if (half < np.pi).any():
        axis = at_a + orbits.senses[a] * np.pi / 2.0 + sensors.boresights[a]
        along = dx * np.cos(axis) + dy * np.sin(axis)
        seen &= along >= np.cos(half) * np.sqrt(square)
    return np.asarray(seen)


def _windows(
    orbits: Orbits,
    a: Index,
    b: Index,
    at_first: Flags,
    pair: Index,
    closing: Flags,
    when: Array,
) -> Windows:
    """Pair each opening with the closing that follows it, the last one round the period."""
    number = np.bincount(pair, minlength=len(a))
    first = np.concatenate([[0], np.cumsum(number)])
    following = np.arange(len(pair)) + 1
    wraps = following == first[pair + 1]
    following = np.where(wraps, first[pair], following)
    ends = when[following] + np.where(wraps, orbits.period, 0.0)
    opens = ~closing
    always = np.flatnonzero((number == 0) & at_first)
    owner = np.concatenate([pair[opens], always])
    order = np.argsort(owner, kind="stable")
    starts = np.concatenate([when[opens], np.zeros(len(always))])[order]
    ends = np.concatenate([ends[opens], np.full(len(always), orbits.period)])[order]
    per_pair = np.bincount(owner, minlength=len(a))
    return Windows(a, b, np.concatenate([[0], np.cumsum(per_pair)]), starts, ends)


# --- comparison ----------------------------------------------------------------------------------


def mismatches(exact: Windows, other: Windows, period: float) -> tuple[int, float]:
    """Return how many pairs have other windows than the exact ones, and the largest gap in s.

    A pair agrees when it has as many windows and all edges agree to AGREEMENT_S; the largest gap
    is over the pairs that agree.
    """
    if not (
        np.array_equal(exact.observers, other.observers)
        and np.array_equal(exact.targets, other.targets)
    ):
        raise RuntimeError("the two sides looked at different pairs: nothing to compare")
    wrong, largest = 0, 0.0
    for k in range(len(exact.observers)):
        ours, theirs = exact.of(k), other.of(k)
        if ours.shape != theirs.shape:
            wrong += 1
            continue
        apart = np.abs(ours - theirs)
        gap = float(np.minimum(apart, np.abs(apart - period)).max(initial=0.0))
        if gap > AGREEMENT_S:
            wrong += 1
        else:
            largest = max(largest, gap)
    return wrong, largest


def _best(function: Callable[[], Windows], repeats: int) -> tuple[float, Windows]:
    """Seconds of the fastest of `repeats` calls, and what came back."""
    seconds = float("inf")
    for _ in range(repeats):
        begin = time.perf_counter()
        found = function()
        seconds = min(seconds, time.perf_counter() - begin)
    return seconds, found


def _compare(alternating: bool, fov_deg: float, repeats: int) -> dict[str, float]:
    """Figures of one case; sampling gets denser until it finds every window."""
    orbits, sensors = grid(alternating, fov_deg)
    team = Team(orbits, NO_LANDMARKS, sensors, Noise(0.1, 0.01, 5.0, 0.1))
    find_windows(team)
    seconds, exact = _best(lambda: find_windows(team), repeats)
    result = {
        "exact_s": seconds,
        "pairs": float(len(exact.observers)),
        "windows": float(len(exact.starts)),
        "shortest_s": float((exact.ends - exact.starts).min()),
    }
    samples, enough = COARSE, False
    while samples <= DENSE or not enough:
        if samples > MOST_SAMPLES:
            raise RuntimeError(f"windows differ even from those of {samples // 2} samples a period")
        looked = partial(sampled_windows, orbits, sensors, samples)
        slow, found = _best(looked, 3 if samples <= DENSE else 1)
        wrong, gap = mismatches(exact, found, orbits.period)
        if samples <= DENSE:
            result[f"sampled_{samples}_s"] = slow
            result[f"ratio_{samples}"] = slow / seconds
            result[f"wrong_{samples}"] = float(wrong)
        if wrong == 0 and not enough:
            enough = True
            result |= {"enough": float(samples), "ratio_enough": slow / seconds, "gap_s": gap}
        samples = DENSE if samples < DENSE else 2 * samples
    slow, found = _best(
        lambda: windows_pair_by_pair(orbits, sensors, int(result["enough"]), PAIRS_ONE_BY_ONE), 1
    )
    some = (exact.observers[:PAIRS_ONE_BY_ONE], exact.targets[:PAIRS_ONE_BY_ONE])
    wrong, _ = mismatches(find_windows(team, some), found, orbits.period)
    scaled = slow * len(exact.observers) / PAIRS_ONE_BY_ONE
    result |= {"ratio_pairwise": scaled / seconds, "wrong_pairwise": float(wrong)}
    return result


def main(repeats: int = 7) -> dict[str, float]:
    """Return, for each case: seconds of both sides, ratios, and pairs that sampling got wrong."""
    return {
        f"{case}_{name}": value
        for case, (_, alternating, fov_deg) in CASES.items()
        for name, value in _compare(alternating, fov_deg, repeats).items()
    }


def figures(result: dict[str, float]) -> list[Figure]:
    """Return what is shown of a result."""
    shown = []
    for case, (label, _, _) in CASES.items():
        name = f"windows, {label}"
        shown.append(Figure(f"{name}: exact", result[f"{case}_exact_s"], "s", TARGETS_S[case]))
        enough = result[f"{case}_enough"]
        what = f"{name}: faster than {enough:,.0f} samples pair by pair, 0 pairs missed"
        shown.append(Figure(what, result[f"{case}_ratio_pairwise"], "x", RATIO_TARGET))
        for samples in (COARSE, DENSE):
            wrong = result[f"{case}_wrong_{samples}"]
            what = f"{name}: faster than {samples:,} samples all at once, {wrong:.0f} pairs missed"
            shown.append(Figure(what, result[f"{case}_ratio_{samples}"], "x"))
        if enough > DENSE:
            what = f"{name}: faster than {enough:,.0f} samples all at once, 0 pairs missed"
            shown.append(Figure(what, result[f"{case}_ratio_enough"], "x"))
    return shown


if __name__ == "__main__":
    print_figures(figures(main()))
