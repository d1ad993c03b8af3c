"""Proofs that no formation can meet a brief: by the vehicles' limits, by rank, or by area.

    limits   the smallest circle that a vehicle can fly lies clear nowhere in the area
    rank     without landmarks the whole team can shift unseen; with one and no compass it can turn
             about it
    area     all strips together are smaller than what is to be covered; a point is too far away
             from the area; discs of half the spread about the centres are larger than their room

A search that finds nothing is no proof.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from syncplan.scenario.areas import Area
from syncplan.scenario.brief import Brief

_ROUNDING_M, _ROUNDING = 2e-3, 1e-3
"""Accuracy of the largest circle, and of areas with rounded corners."""


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
    area = Area.of(brief.area_m, brief.keep_out_m)
    smallest = brief.vehicle.least_radius(brief.vehicle.speeds[0])
    largest = area.largest_radius() + _ROUNDING_M
    if not area.has_room((smallest, max(smallest, largest)), *area.corners):
        return Proof(
            "limits",
            f"a vehicle's smallest circle, {smallest:.4g} m in radius at "
            f"{brief.vehicle.speeds[0]:g} m/s, fits nowhere in the area",
        )
    if brief.landmarks.most == 0:
        return Proof("rank", "without landmarks the whole team can shift unseen")
    if brief.landmarks.most == 1 and brief.heading_sigma_rad is None:
        return Proof("rank", "with one landmark and no compass the team can turn about it unseen")
    return _of_purpose(brief, area, smallest, largest)


def _of_purpose(brief: Brief, area: Area, smallest: float, largest: float) -> Proof | None:
    purpose = brief.purpose
    if purpose.cover is not None:
        asked = purpose.cover.share * area.size()
        outer, half = largest + 0.5 * purpose.cover.swath_m, 0.5 * purpose.cover.swath_m
        strip = np.pi * (outer**2 - max(largest - half, 0.0) ** 2)
        if brief.team.max * strip < asked:
            return Proof(
                "area",
                f"{brief.team.max} strips along circles of at most {largest:.4g} m cover at most "
                f"{brief.team.max * strip:.4g} m2 of the {asked:.4g} m2 asked for",
            )
    points = np.array(purpose.visit_m or [], dtype=float).reshape(-1, 2)
    for k, away in enumerate(np.hypot(*(area.nearest(points) - points).T).tolist()):
        if away > purpose.within_m:
            return Proof("area", f"visit_m[{k}] is {away:.4g} m away from the area")
    if purpose.keep is not None and purpose.keep.count > 1:
        keep = purpose.keep
        room = area.size(grown=0.5 * keep.spread_m - smallest) * (1.0 + _ROUNDING)
        discs = keep.count * np.pi * (0.5 * keep.spread_m) ** 2
        if discs > room:
            return Proof(
                "area",
                f"{keep.count} discs of {0.5 * keep.spread_m:g} m in radius, {discs:.4g} m2, do "
                f"not fit into the {room:.4g} m2 around all possible centres",
            )
    return None
