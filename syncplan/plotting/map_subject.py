"""What maps are drawn of: circles, landmarks and areas, of a plan or of a flight."""

from collections.abc import Sequence
from typing import Protocol

from syncplan.arrays import Array
from syncplan.orbits.circles import Orbits

Corners = Sequence[tuple[float, float]]


class Zones(Protocol):
    """Areas on a map, in m; corners in order, not closed."""

    @property
    def area_m(self) -> Corners | None:
        """The area that paths stay in."""

    @property
    def keep_out_m(self) -> Sequence[Corners] | None:
        """Zones that paths stay out of."""

    @property
    def obstacles_m(self) -> Sequence[Corners] | None:
        """Obstacles to sight."""


class Mapped(Protocol):
    """What a map shows."""

    @property
    def orbits(self) -> Orbits:
        """The circles."""

    @property
    def landmarks(self) -> Array:
        """(m, 2) m."""

    @property
    def scenario(self) -> Zones:
        """What has the areas."""
