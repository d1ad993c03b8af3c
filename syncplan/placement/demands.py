"""Demands on a drawing of circles: who must come within range, who must keep clear, by how much.

They are read once from a scenario, from its links or from its shape, and stated in SI units; what
follows, the drawing and its certificate, sees the demands alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index, as_pairs
from syncplan.errors import InputError, NoSolutionError
from syncplan.orbits.graphs import components
from syncplan.orbits.team import obstacles_of, radii_of
from syncplan.scenario.areas import Area
from syncplan.scenario.formations import SHAPES
from syncplan.scenario.specification import Scenario

MARGIN_SHARE = 0.02
"""Share of the range by which links stay within it where no margin is given."""

_LEAST_SHARE = 0.01
"""Share of the range that circles are kept apart where min_separation_m asks for less."""

_APART_SHARE = 1.1
"""Gap of unlinked circles aimed for, in ranges: just too far to meet."""

_GAP_TOLERANCE = 1e-7
_CROSSING = 1e-9


@dataclass(frozen=True, slots=True)
class Names:
    """What messages name: vehicles, landmarks, and the margin in m that links are to keep."""

    vehicles: Sequence[str]
    landmarks: Sequence[str]
    margin: float

    def link(self, pair: Array | Index) -> str:
        """Return a link as a-b."""
        return f"{self.vehicles[int(pair[0])]}-{self.vehicles[int(pair[1])]}"


@dataclass(frozen=True, slots=True)
class Demands:
    """What n circles must fulfil, and what they should; lengths in m.

    Attributes
    ----------
    names : of the vehicles and landmarks
    radii : (n,)
    links : (e, 2) pairs a < b that must come within range
    least : least gap of any two circles
    most : (e,) largest gap of each link
    wanted : (e,) gap of each link aimed for
    apart : gap of unlinked circles aimed for at least
    landmarks : (m, 2)
    sight : (n,) largest distance off its circle at which a vehicle sights a landmark
    groups : connected components of the links; each is to sight two landmarks, or the only one
    area : where the circles may lie
    ranges : (n,)
    obstacles : polygons (k, 2) that block sight
    """

    names: Names
    radii: Array
    links: Index
    least: float
    most: Array
    wanted: Array
    apart: float
    landmarks: Array
    sight: Array
    groups: tuple[Index, ...]
    area: Area
    ranges: Array
    obstacles: tuple[Array, ...]

    @property
    def count(self) -> int:
        """Number of circles."""
        return len(self.radii)

    @property
    def unit(self) -> float:
        """Typical distance of two linked centres in m."""
        return 2.0 * float(np.mean(self.radii)) + float(
            np.mean(self.wanted) if len(self.wanted) else self.apart
        )


def demands_of(scenario: Scenario, margin: float | None) -> Demands:
    """Return the demands of a scenario that gives no centres.

    Raises InputError for a margin beyond the range, NoSolutionError for a gap of a shape below
    the separation.
    """
    ranges = np.array([sensor.range_m for sensor in scenario.sensors])
    names = Names(scenario.vehicle_names, scenario.landmark_names, _margin(scenario, margin))
    if scenario.formation.shape is None:
        return _of_links(scenario, names, ranges)
    return _of_shape(scenario, names, ranges)


def _margin(scenario: Scenario, margin: float | None) -> float:
    shortest = min(sensor.range_m for sensor in scenario.sensors)
    refine = scenario.refine
    if margin is None:
        given = refine.margin_m if refine is not None else None
        margin = MARGIN_SHARE * shortest if given is None else given
    if not 0.0 <= margin < shortest:
        raise InputError(
            f"{margin:g} m: must be at least 0 and less than the range, {shortest:g} m",
            key="margin",
        )
    return margin


def _of_links(scenario: Scenario, names: Names, ranges: Array) -> Demands:
    links = as_pairs(scenario.linked)
    least = max(scenario.separation, _LEAST_SHARE * float(ranges.min()))
    most = ranges[links].max(axis=1) - names.margin
    return Demands(
        names=names,
        radii=radii_of(scenario),
        links=links,
        least=least,
        most=most,
        wanted=0.5 * (least + most),
        apart=max(_APART_SHARE * float(ranges.max()), least),
        landmarks=np.array(scenario.landmarks, dtype=float).reshape(-1, 2),
        sight=ranges - names.margin,
        groups=tuple(np.array(part) for part in components(scenario.size, scenario.linked)),
        area=Area.of(scenario.area_m, scenario.keep_out_m),
        ranges=ranges,
        obstacles=obstacles_of(scenario),
    )


def _of_shape(scenario: Scenario, names: Names, ranges: Array) -> Demands:
    """Neighbours' circles gap_m apart: within range or not, and whatever landmarks there are."""
    formation, radii = scenario.formation, radii_of(scenario)
    gap, separation = formation.gap_m or 0.0, scenario.separation
    links = SHAPES[formation.shape or ""].neighbours(len(radii), formation.columns)
    if gap < separation:
        raise NoSolutionError(
            f"formation.gap_m {gap:g}: less than min_separation_m {separation:g}; raise the gap or "
            "lower the separation"
        )
    most = np.maximum(gap, ranges[links].max(axis=1) - names.margin)
    least = min(gap, max(separation, _CROSSING))
    return Demands(
        names=names,
        radii=radii,
        links=links,
        least=least * (1.0 - _GAP_TOLERANCE),
        most=most * (1.0 + _GAP_TOLERANCE),
        wanted=np.full(len(links), gap),
        apart=least,
        landmarks=np.zeros((0, 2)),
        sight=np.zeros(len(radii)),
        groups=(),
        area=Area.of(scenario.area_m, scenario.keep_out_m),
        ranges=ranges,
        obstacles=obstacles_of(scenario),
    )


def others(count: int, links: Index) -> Index:
    """Return the (p, 2) pairs a < b that are not linked."""
    a, b = np.triu_indices(count, 1)
    linked = np.zeros((count, count), dtype=bool)
    linked[links[:, 0], links[:, 1]] = True
    free = ~linked[a, b]
    return np.column_stack([a[free], b[free]])
