"""Drawings of linked circles, improved by sequential convex programming.

Each round solves the convex programme about the present drawing (syncplan.placement.layout_qp),
which prices whatever is missed; the step is taken only if the true, curved shortfalls agree, and
the trust region follows how well the two agree.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.separation import outer_gaps
from syncplan.placement.demands import Demands, others, shortfalls, sightings
from syncplan.placement.layout_qp import (
    APART_WEIGHT,
    FIRM,
    PRICE,
    Programme,
    compiled,
    fill,
    solved,
)

__all__ = ["Drawing", "improve"]


_ALL_PAIRS = 40
"""Number of circles up to which every pair is in the programme; beyond it, those nearby."""

_NEARBY = 1.5
"""How much nearer pairs in the programme may come, in typical distances, before others count."""

_TRUST = 0.5
_LEAST_TRUST = 1e-6
_PERFECT = 0.01
"""Charge for each circle below which a drawing is as good as perfect."""

_PATIENCE = {True: 2, False: 5}
"""Rounds of hardly any gain after which to stop, by whether all demands are met."""


@dataclass(frozen=True, slots=True)
class Drawing:
    """Centres (n, 2) m, the sum of what they miss in m, and the rounds it took."""

    centers: Array
    missed: float
    iterations: int


def improve(
    demands: Demands, centers: Array, *, rounds: int = 100, accuracy: float = 1e-3
) -> Drawing:
    """Return a drawing no worse than the given (n, 2) centres.

    Ends when some rounds in turn gain less than `accuracy` of what is still charged, more of them
    where demands are not met yet, or when no step helps.
    """
    unit = demands.unit
    place = np.array(centers, dtype=float)
    worth, missed = _merit(demands, place)
    trust, done, stalled = _TRUST, 0, 0
    programme: Programme | None = None
    while done < rounds and trust >= _LEAST_TRUST and stalled < _PATIENCE[missed == 0.0]:
        done += 1
        if programme is None or _strangers_near(demands, place, programme.free, trust * unit):
            programme = compiled(demands, _near(demands, place, _NEARBY * unit))
        fill(programme, demands, place, trust)
        step, promised = solved(programme)
        if step is None:
            trust *= 0.25
            continue
        tried = place + unit * step
        value, shortfall = _merit(demands, tried)
        gain, hoped = worth - value, worth - promised
        enough = accuracy * (worth + _PERFECT * demands.count)
        stalled = stalled + 1 if max(gain, hoped) < enough else 0
        if gain > 0.05 * hoped and gain > 0.0:
            place, worth, missed = tried, value, shortfall
            trust = min(2.0 * trust, _TRUST) if gain > 0.5 * hoped else trust
        else:
            trust = 0.35 * min(trust, max(float(np.max(np.abs(step))), 1e-9))
    return Drawing(place, missed, done)


# --- the true merit -----------------------------------------------------------------------------


def _merit(demands: Demands, centers: Array) -> tuple[float, float]:
    """What a drawing is charged (in units of a typical distance), and what it misses in m."""
    unit = demands.unit
    missed = shortfalls(demands, centers)
    gaps = outer_gaps(centers, demands.radii, demands.links)
    near = demands.apart - outer_gaps(centers, demands.radii, others(demands.count, demands.links))
    vehicle, landmark = sightings(demands, centers).T
    away = np.hypot(*(centers[vehicle] - demands.landmarks[landmark]).T)
    aim = demands.radii[vehicle] + 0.5 * demands.sight[vehicle]
    soft = (
        np.sum((gaps - demands.wanted) ** 2)
        + APART_WEIGHT * np.sum(np.maximum(near, 0.0) ** 2)
        + APART_WEIGHT * np.sum((away - aim) ** 2)
    )
    firm = missed.total - float(missed.links.sum())
    price = PRICE * (float(missed.links.sum()) + FIRM * firm)
    return float(soft) / unit**2 + price / unit, missed.total


# --- pairs in the programme -----------------------------------------------------------------------


def _near(demands: Demands, centers: Array, slack: float) -> Index:
    """Unlinked pairs within `slack` m of the gap they are wanted to have; all in a small team."""
    free = others(demands.count, demands.links)
    if demands.count <= _ALL_PAIRS:
        return free
    return free[outer_gaps(centers, demands.radii, free) < demands.apart + slack]


def _strangers_near(demands: Demands, centers: Array, known: Index, trust: float) -> bool:
    """Whether a pair that is not in the programme could cross within one step of it."""
    if demands.count <= _ALL_PAIRS:
        return False
    free = others(demands.count, demands.links)
    inside = np.isin(free @ [demands.count, 1], known @ [demands.count, 1])
    reach = demands.least + 2.0 * np.sqrt(2.0) * trust
    return bool(np.any(outer_gaps(centers, demands.radii, free[~inside]) < reach))
