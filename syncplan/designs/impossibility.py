"""Proofs that no formation can meet a brief: by the vehicles' limits, by rank, or by area.

    limits   the smallest circle that a vehicle can fly lies clear nowhere in the area
    rank     without landmarks the whole team can shift unseen; with one and no compass it can turn
             about it; where the need must hold after losses, the landmark lost does not count
    area     all strips together are smaller than what is to be covered; a point is too far away
             from the area; discs of half the spread about the centres are larger than their room

A search that finds nothing is no proof.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from syncplan.arrays import Array
from syncplan.scenario.areas import Area
from syncplan.scenario.brief import Brief

_MARGIN = 1e-3
"""Share by which what is asked has to exceed what is possible, of sizes and distances.

What is possible is an upper limit but for rounding. Coordinates count from a corner of the area, so
rounding is about 1e-15 of its size wherever it lies: far less than this share of any length above
1e-9 of that size. The smallest circle has the margin of `Area.has_room`, ranks need none.
"""


@dataclass(frozen=True, slots=True)
class Proof:
    """Why no formation meets a brief.

    Attributes
    ----------
    kind : limits, rank or area
    reason : in words, with the figures that decide
    """

    kind: Literal["limits", "rank", "area"]
    reason: str


def proof_against(brief: Brief) -> Proof | None:
    """Return the first proof that no formation meets a brief; None if there is none."""
    origin = np.array(brief.area_m[0])
    inside, *outside = (
        np.array(corners) - origin for corners in (brief.area_m, *(brief.keep_out_m or []))
    )
    area = Area(inside, tuple(outside))
    smallest = brief.vehicle.least_radius(brief.vehicle.speeds[0])
    largest = _most_radius(area, smallest)
    if not area.has_room((smallest, max(smallest, largest)), *area.corners):
        return Proof(
            "limits",
            f"a vehicle's smallest circle, {smallest:.4g} m in radius at "
            f"{brief.vehicle.speeds[0]:g} m/s, fits nowhere in the area",
        )
    sites = max(brief.landmarks.most - brief.need.losses, 0)
    left = " left after a loss" if sites < brief.landmarks.most else ""
    if sites == 0:
        return Proof("rank", f"without landmarks{left} the whole team can shift unseen")
    if sites == 1 and brief.heading_sigma_rad is None:
        return Proof(
            "rank", f"with one landmark{left} and no compass the team can turn about it unseen"
        )
    points = np.array(brief.purpose.visit_m or [], dtype=float).reshape(-1, 2) - origin
    return _of_purpose(brief, area, points, smallest, largest)


def _most_radius(area: Area, smallest: float) -> float:
    """Radius in m that no circle within the outer polygon exceeds, a little above the largest.

    The search for the largest circle may end early; beyond the radius, nothing is left of the area.
    """
    largest = area.largest_radius()
    excess = _MARGIN * max(largest, smallest)
    while area.most_size(-largest - excess) > 0.0:
        excess *= 2.0
    return largest + excess


def _of_purpose(
    brief: Brief, area: Area, points: Array, smallest: float, largest: float
) -> Proof | None:
    purpose = brief.purpose
    if purpose.cover is not None:
        asked = purpose.cover.share * area.size()
        outer, half = largest + 0.5 * purpose.cover.swath_m, 0.5 * purpose.cover.swath_m
        strip = np.pi * (outer**2 - max(largest - half, 0.0) ** 2)
        if brief.team.max * strip * (1.0 + _MARGIN) < asked:
            return Proof(
                "area",
                f"{brief.team.max} strips along circles of at most {largest:.4g} m cover at most "
                f"{brief.team.max * strip:.4g} m2 of the {asked:.4g} m2 asked for",
            )
    for k, away in enumerate(np.hypot(*(area.nearest(points) - points).T).tolist()):
        if away > purpose.within_m * (1.0 + _MARGIN):
            return Proof("area", f"visit_m[{k}] is {away:.4g} m away from the area")
    if purpose.keep is not None and purpose.keep.count > 1:
        keep = purpose.keep
        room = area.most_size(0.5 * keep.spread_m - smallest)
        discs = keep.count * np.pi * (0.5 * keep.spread_m) ** 2
        if discs > room * (1.0 + _MARGIN):
            return Proof(
                "area",
                f"{keep.count} discs of {0.5 * keep.spread_m:g} m in radius, {discs:.4g} m2, do "
                f"not fit into the {room:.4g} m2 around all possible centres",
            )
    return None
