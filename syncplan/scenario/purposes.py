"""What circles are flown for: to cover an area, to visit points, or to keep vehicles apart.

A vehicle covers the strip along its circle: the ring between R - w/2 and R + w/2, or the whole disc
where w/2 is at least R. What counts is the share of the rings' union, keep-outs left out. Searches
count points of a grid instead.
"""

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from syncplan.arrays import Array, Index
from syncplan.phrases import percent
from syncplan.scenario.areas import Area
from syncplan.scenario.quantities import (
    Length,
    Many,
    Place,
    Point,
    Polygon,
    Section,
    fault,
    instead_of,
)

MOST_KEPT = 50
"""Largest number of vehicles to keep apart."""

_CUSHION = 0.01
"""Share by which a search covers more than is needed, for the grid's error."""


class Cover(Section):
    """Strips along the circles that together cover a share of the area, keep-outs left out."""

    share: Annotated[float, Field(gt=0, le=1)] = Field(
        description="Share of the area", examples=[0.9]
    )
    swath_m: Length = Field(
        description="Width of the strip that a vehicle covers along its path, half on either side",
        examples=[60.0],
    )


class Keep(Section):
    """Vehicles that stay apart: their circles' centres are that far from each other."""

    count: Annotated[int, Field(ge=1, le=MOST_KEPT)] = Field(
        description="Number of vehicles, the first ones", examples=[4]
    )
    spread_m: Length = Field(description="Least distance of their centres", examples=[80.0])


class Purpose(Section):
    """What the team is there for: one of cover, visit_m and keep."""

    cover: Cover | None = Field(default=None, description="Cover a share of the area")
    visit_m: Many[Point] | None = Field(
        default=None,
        description="Points [x, y], each of which some circle passes",
        examples=[[[40.0, 40.0], [120.0, 60.0]]],
        json_schema_extra={"minItems": 1},
    )
    visit_lat_lon_deg: Many[Place] | None = instead_of("visit_m")
    within_m: Length = Field(
        default=5.0, description="Distance within which a point counts as visited", examples=[5.0]
    )
    keep: Keep | None = Field(default=None, description="Keep so many vehicles apart")

    @model_validator(mode="after")
    def _one(self) -> Self:
        if self.visit_m is not None and not self.visit_m:
            raise fault("visit_m", "is empty: list a point")
        kinds = {"cover": self.cover, "visit_m": self.visit_m, "keep": self.keep}
        named = [key for key, value in kinds.items() if value]
        if not named:
            raise fault(
                "cover",
                "is missing: give cover, visit_m or keep; without a purpose, all "
                "vehicles would gather at the landmarks",
            )
        if len(named) > 1:
            raise fault(named[1], f"can't be combined with {named[0]}; give one of the two")
        return self

    def check_against(self, area: Polygon | None, most: int, limit: str) -> None:
        """Raise a fault for an area that is missing, or for more vehicles than there may be."""
        if self.cover is not None and area is None:
            raise fault("area_m", "is missing: purpose.cover states a share of it")
        if self.keep is not None and self.keep.count > most:
            raise fault("purpose.keep.count", f"is more than {limit}, {most}", self.keep.count)


@dataclass(frozen=True, slots=True)
class PurposeMeasure:
    """Measure of a purpose for any circles.

    Attributes
    ----------
    purpose, area : the purpose, and the area with keep-outs
    field : (p, 2) m, grid points to cover; none for other purposes
    spacing : m, of the grid's points
    """

    purpose: Purpose
    area: Area
    field: Array
    spacing: float

    @classmethod
    def of(cls, purpose: Purpose, area: Area, points: int) -> Self:
        """Return the measure of a purpose, on a grid of about so many points."""
        if not purpose.cover or not points:
            return cls(purpose, area, np.zeros((0, 2)), 0.0)
        return cls(purpose, area, *area.grid(points))

    # --- exactly ----------------------------------------------------------------------------------

    def room(self, centers: Array, radii: Array) -> float:
        """Return what circles (n, 2), (n,) m have beyond what is asked, negative if they miss it.

        In m, or a share of the area.
        """
        purpose, covered = self.purpose, self.covered(centers, radii)
        if purpose.cover is not None and covered is not None:
            return covered - purpose.cover.share
        if purpose.visit_m is not None:
            return purpose.within_m - float(self._off_points(centers, radii).min(axis=1).max())
        assert purpose.keep is not None
        apart = self._kept_apart(centers)
        return float(apart.min(initial=np.inf)) - purpose.keep.spread_m

    def covered(self, centers: Array, radii: Array) -> float | None:
        """Return the share of the area that circles cover; None for other purposes."""
        cover = self.purpose.cover
        if cover is None:
            return None
        return self.area.covered_share(centers, radii, 0.5 * cover.swath_m)

    @property
    def size(self) -> float:
        """What is asked, in the unit of the room."""
        purpose = self.purpose
        if purpose.cover is not None:
            return purpose.cover.share
        return purpose.keep.spread_m if purpose.keep else purpose.within_m

    def worded(self, room: float) -> str:
        """Return what circles reach and what is asked, in words."""
        purpose = self.purpose
        if purpose.cover is not None:
            asked = purpose.cover.share
            return (
                f"{percent(asked + room)} of area_m is covered, purpose.cover asks {percent(asked)}"
            )
        if purpose.keep is not None:
            asked = purpose.keep.spread_m
            return f"centres are {asked + room:.4g} m apart, purpose.keep.spread_m asks {asked:g} m"
        asked = purpose.within_m
        return (
            f"a point of purpose.visit_m is passed at {asked - room:.4g} m, purpose.within_m asks "
            f"{asked:g} m"
        )

    # --- for searches -----------------------------------------------------------------------------

    def shortfall(self, centers: Array, radii: Array) -> float:
        """Return how far circles fall short on the grid, over all that is missed, as a share."""
        purpose = self.purpose
        if purpose.cover is not None:
            asked = min(purpose.cover.share + _CUSHION, 1.0)
            half = 0.5 * purpose.cover.swath_m
            # of squares: distances take most of the time of a search
            x, y = (self.field[:, None] - centers).transpose(2, 0, 1)
            squares, inner = x * x + y * y, np.maximum(radii - half, 0.0)
            near = (squares <= (radii + half) ** 2) & (squares >= inner**2)
            share = near.any(axis=1).mean()
            return max(asked - float(share), 0.0) / asked
        if purpose.visit_m is not None:
            off = self._off_points(centers, radii).min(axis=1)
            missed = np.maximum(off - purpose.within_m, 0.0)
            return float(missed.mean()) / float(radii.mean())
        assert purpose.keep is not None
        short = np.maximum(purpose.keep.spread_m - self._kept_apart(centers), 0.0).sum()
        return float(short) / purpose.keep.spread_m

    def nearest(self, centers: Array, radii: Array) -> Index:
        """Return the (p,) vehicle that passes each point to visit most closely."""
        return np.asarray(self._off_points(centers, radii).argmin(axis=1))

    def kept_pairs(self) -> Index:
        """Return the (g, 2) pairs of vehicles whose centres stay apart."""
        count = self.purpose.keep.count if self.purpose.keep else 0
        return np.column_stack(np.triu_indices(count, 1))

    def _off_points(self, centers: Array, radii: Array) -> Array:
        """Distances (p, n) in m of the points to visit from the circles."""
        points = np.array(self.purpose.visit_m, dtype=float)
        return np.asarray(np.abs(_distances(points, centers) - radii))

    def _kept_apart(self, centers: Array) -> Array:
        a, b = self.kept_pairs().T
        return np.asarray(np.hypot(*(centers[a] - centers[b]).T))


def _distances(points: Array, centers: Array) -> Array:
    return np.asarray(np.hypot(*(points[:, None] - centers[None]).transpose(2, 0, 1)))
