"""How near a vehicle may come to what it must not touch: as stated, or a share of the mean radius.

One rule for the verdict, which judges it, and for refinement, which keeps it.
"""

from dataclasses import dataclass

from syncplan.arrays import Array
from syncplan.scenario.specification import Scenario

TOLERANCE = 1e-6
"""Share of a limit by which it may be missed and still be met: what a solver's accuracy leaves."""

TOO_NEAR = 0.1
"""Share of the mean radius below which a distance is too small where no least one is stated."""


@dataclass(frozen=True, slots=True)
class DistanceLimit:
    """A least distance.

    Attributes
    ----------
    key : of the scenario, which states it
    stated : m; None where the scenario does not state it
    """

    key: str
    stated: float | None

    def least(self, radii: Array) -> float:
        """Return the least distance in m, for a team of circles of `radii` (n,) m."""
        return TOO_NEAR * float(radii.mean()) if self.stated is None else self.stated

    def worded(self, radii: Array) -> str:
        """Return the limit in words."""
        if self.stated is not None:
            return f"{self.key} {self.stated:g}"
        least = self.least(radii)
        return f"{least:.4g} m, a tenth of the mean radius, as no {self.key} is stated"


def separation_limit(scenario: Scenario) -> DistanceLimit:
    """Return how near two vehicles may come to each other."""
    return DistanceLimit("min_separation_m", scenario.min_separation_m)


def landmark_limit(scenario: Scenario) -> DistanceLimit:
    """Return how near a vehicle may come to a landmark."""
    return DistanceLimit("landmark_clearance_m", scenario.landmark_clearance_m)
