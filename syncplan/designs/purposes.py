"""How far circles serve the purpose of a brief: what they cover, visit, or keep apart.

A vehicle covers the strip along its circle: the ring between R - w/2 and R + w/2, or the whole disc
where w/2 is at least R. The search counts a grid of points of the area; the share that counts in
the end is that of the rings' union.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.scenario.areas import Area
from syncplan.scenario.brief import Brief

_POINTS = 3000
"""Number of grid points in the area's bounding box, about."""

_CUSHION = 0.01
"""Share by which a search covers more than is needed, for the grid's error."""


@dataclass(frozen=True, slots=True)
class PurposeMeasure:
    """Measure of a purpose for many candidates of one brief.

    Attributes
    ----------
    brief, area : the brief, and its area with keep-outs
    field : (p, 2) m, grid points to cover; none for other purposes
    """

    brief: Brief
    area: Area
    field: Array

    @classmethod
    def of(cls, brief: Brief) -> "PurposeMeasure":
        """Return the measure of a brief."""
        area = Area.of(brief.area_m, brief.keep_out_m)
        return cls(brief, area, area.grid(_POINTS if brief.purpose.cover else 0))

    def shortfall(self, centers: Array, radii: Array) -> float:
        """Return how far circles (n, 2), (n,) m fall short, as a share of what is asked."""
        purpose = self.brief.purpose
        if purpose.cover is not None:
            asked = min(purpose.cover.share + _CUSHION, 1.0)
            reach = 0.5 * purpose.cover.swath_m
            off = np.abs(_distances(self.field, centers) - radii)
            return max(asked - float((off <= reach).any(axis=1).mean()), 0.0) / asked
        if purpose.visit_m is not None:
            points = np.array(purpose.visit_m, dtype=float)
            off = np.abs(_distances(points, centers) - radii).min(axis=1)
            missed = np.maximum(off - purpose.within_m, 0.0)
            return float(missed.mean()) / float(radii.mean())
        assert purpose.keep is not None
        kept = centers[: purpose.keep.count]
        a, b = np.triu_indices(len(kept), 1)
        apart = np.hypot(*(kept[a] - kept[b]).T)
        short = np.maximum(purpose.keep.spread_m - apart, 0.0).sum() / purpose.keep.spread_m
        return float(short) + purpose.keep.count - len(kept)

    def served(self, centers: Array, radii: Array) -> bool:
        """Return whether circles serve the purpose; what they cover is exact, not the grid's."""
        cover, covered = self.brief.purpose.cover, self.covered(centers, radii)
        if cover is None or covered is None:
            return self.shortfall(centers, radii) <= 0.0
        return covered >= cover.share

    def covered(self, centers: Array, radii: Array) -> float | None:
        """Return the share of the area that circles cover; None for other purposes."""
        cover = self.brief.purpose.cover
        if cover is None:
            return None
        return self.area.covered_share(centers, radii, 0.5 * cover.swath_m)


def _distances(points: Array, centers: Array) -> Array:
    return np.asarray(np.hypot(*(points[:, None] - centers[None]).transpose(2, 0, 1)))
