"""Rank and certificate of what was seen in windows that slide along any paths.

The closed form of `referred_rows` holds for whatever path a vehicle took: with the slope g of a
sighting by the target's place, and the ways d that both have gone since the window began, a row is

    target    g, g . J d_target              observer    -g, -g . J d_observer + dz / dpsi

with J a quarter turn counter-clockwise. Paths are to be those of odometry, which are smooth: places
from motion capture tremble, and a tremble turns lines of sight that never turned.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.observability.rank import (
    Certificate,
    Observability,
    certify,
    judged_rank,
    link_of,
    rows_by_pair,
)
from syncplan.orbits.circles import perpendicular
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS

Placed = Callable[[int, slice], tuple[Array, Array]]
"""Of a window and its sightings (s,): the places (n, 2) m of vehicles when it begins, and (s, 2, 2)
of observer and target when each sighting was made."""

INVOLVED = 1e-6
"""Share of an unobservable direction above which a vehicle has a part in it."""


@dataclass(frozen=True, slots=True)
class WatchedTeam:
    """Sightings that were made, in the order of their times.

    Attributes
    ----------
    times : (s,) s
    observers, targets : (s,) targets from `count` on are landmarks
    kinds : (s,) places in SIGHTING_KINDS, of a target
    sigmas : (s,) of each, in its kind's unit
    count : number of vehicles
    landmarks : (m, 2) m
    scale : m, that places are measured in
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
    """What the sightings of one window determine of the poses at its beginning.

    Attributes
    ----------
    begin, end : s
    observability, certificate : of them all
    """

    begin: float
    end: float
    observability: Observability
    certificate: Certificate

    @property
    def position_sigma(self) -> float:
        """Of the worst vehicle in m, from this window alone; infinite where not observable."""
        found = self.observability
        if not found.observable:
            return float("inf")
        variances = found.variances.reshape(-1, 3)[:, :2].sum(axis=1)
        return float(found.scale * np.sqrt(variances.max()))


def judged_windows(
    watched: WatchedTeam, placed: Placed, begins: Array, ends: Array
) -> Iterator[SeenWindow]:
    """Yield what was seen in each window, after `begins` and up to `ends` (w,) s."""
    first = np.searchsorted(watched.times, begins, side="right").tolist()
    last = np.searchsorted(watched.times, ends, side="right").tolist()
    for k, (a, b) in enumerate(zip(first, last, strict=True)):
        rows = _rows(watched, *placed(k, slice(a, b)), slice(a, b))
        seen = watched.observers[a:b], watched.targets[a:b], np.arange(a, b)
        links = [link_of(pair) for pair in rows_by_pair(rows, *seen, watched.count)]
        verdict = judged_rank(watched.count, links, watched.scale)
        certificate = certify(watched, verdict, links)
        yield SeenWindow(float(begins[k]), float(ends[k]), verdict, certificate)


def undetermined(verdict: Observability) -> list[int]:
    """Return the vehicles of which some coordinate is not determined."""
    parts = np.abs(verdict.null_space).reshape(len(verdict.null_space), -1, 3)
    return np.flatnonzero((parts > INVOLVED).any(axis=(0, 2))).tolist()


def _rows(watched: WatchedTeam, starts: Array, places: Array, of: slice) -> Array:
    """(s, 6) the observer's three columns and the target's, over sigma, places in the scale."""
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
