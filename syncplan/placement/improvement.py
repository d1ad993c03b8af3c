"""Drawings improved step by step, by sequential convex programming.

Each round solves a QP about the present drawing (syncplan.placement.layout_qp), which prices
whatever is missed; the step is taken only if the true, curved shortfalls agree, and the trust
region follows how well the two agree (Nocedal and Wright, Numerical Optimization, chapter 18).
"""

from dataclasses import replace

import numpy as np

from syncplan.arrays import Index
from syncplan.orbits.contacts import outer_gaps
from syncplan.placement.demands import others
from syncplan.placement.drawing import Drawing, draw
from syncplan.placement.layout_qp import (
    APART_WEIGHT,
    FIRM,
    PRICE,
    LayoutQP,
    compile_qp,
    set_parameters,
    solved,
)

_ALL_PAIRS = 40
"""Number of circles up to which every pair is in the QP; beyond it, those nearby."""

_NEARBY = 1.5
"""How much nearer pairs in the QP may come, in typical distances, before others count."""

_TRUST = 0.5
_LEAST_TRUST = 1e-6
_PERFECT = 0.01
"""Charge for each circle below which a drawing is as good as perfect."""

_PATIENCE = {True: 2, False: 5}
"""Rounds of hardly any gain after which to stop, by whether all demands are met."""


def improved(drawing: Drawing, *, rounds: int = 100, accuracy: float = 1e-3) -> Drawing:
    """Return a drawing no worse than the given one.

    Ends when some rounds in turn gain less than `accuracy` of what is still charged, more of them
    where demands are not met yet, or when no step helps.
    """
    demands, unit = drawing.demands, drawing.demands.unit
    worth = _merit(drawing)
    trust, done, stalled = _TRUST, 0, 0
    qp: LayoutQP | None = None
    while (
        done < rounds and trust >= _LEAST_TRUST and stalled < _PATIENCE[drawing.missed.total == 0.0]
    ):
        done += 1
        if qp is None or _strangers_near(drawing, qp.free, trust * unit):
            qp = compile_qp(demands, _near(drawing, _NEARBY * unit))
        set_parameters(qp, drawing, trust)
        step, promised = solved(qp)
        if step is None:
            trust *= 0.25
            continue
        tried = draw(demands, drawing.centers + unit * step)
        value = _merit(tried)
        gain, hoped = worth - value, worth - promised
        enough = accuracy * (worth + _PERFECT * demands.count)
        stalled = stalled + 1 if max(gain, hoped) < enough else 0
        if gain > 0.05 * hoped and gain > 0.0:
            drawing, worth = tried, value
            trust = min(2.0 * trust, _TRUST) if gain > 0.5 * hoped else trust
        else:
            trust = 0.35 * min(trust, max(float(np.max(np.abs(step))), 1e-9))
    return replace(drawing, rounds=done)


def _merit(drawing: Drawing) -> float:
    """What a drawing is charged: its true, curved misses, in units of a typical distance."""
    demands, missed = drawing.demands, drawing.missed
    unit = demands.unit
    free = others(demands.count, demands.links)
    near = demands.apart - outer_gaps(drawing.centers, demands.radii, free)
    vehicle = drawing.sightings[:, 0]
    aim = demands.radii[vehicle] + 0.5 * demands.sight[vehicle]
    soft = (
        np.sum((drawing.link_gaps - demands.wanted) ** 2)
        + APART_WEIGHT * np.sum(np.maximum(near, 0.0) ** 2)
        + APART_WEIGHT * np.sum((drawing.sighted_from - aim) ** 2)
    )
    firm = missed.total - float(missed.links.sum())
    price = PRICE * (float(missed.links.sum()) + FIRM * firm)
    return float(soft) / unit**2 + price / unit


# --- pairs in the QP ------------------------------------------------------------------------------


def _near(drawing: Drawing, allowance: float) -> Index:
    """Unlinked pairs within `allowance` m of the gap they should have; all in a small team."""
    demands = drawing.demands
    free = others(demands.count, demands.links)
    if demands.count <= _ALL_PAIRS:
        return free
    return free[outer_gaps(drawing.centers, demands.radii, free) < demands.apart + allowance]


def _strangers_near(drawing: Drawing, known: Index, trust: float) -> bool:
    """Whether a pair that is not in the QP could cross within one step of it."""
    demands = drawing.demands
    if demands.count <= _ALL_PAIRS:
        return False
    free = others(demands.count, demands.links)
    inside = np.isin(free @ [demands.count, 1], known @ [demands.count, 1])
    reach = demands.least + 2.0 * np.sqrt(2.0) * trust
    return bool(np.any(outer_gaps(drawing.centers, demands.radii, free[~inside]) < reach))
