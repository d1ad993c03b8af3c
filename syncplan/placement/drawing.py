"""Drawings of circles: demands, figures, shortfalls, and links that obstacles hide."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index, as_pairs
from syncplan.errors import InputError, NoSolutionError
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import close_pairs, find_windows, outer_gaps
from syncplan.orbits.graphs import components
from syncplan.orbits.team import Sensors, Team, obstacles_of, radii_of
from syncplan.scenario.areas import Area
from syncplan.scenario.formations import SHAPES
from syncplan.scenario.specification import Scenario
from syncplan.synchronisation.contact_tables import seeing_team
from syncplan.synchronisation.sighted_phases import hidden_at_all_phases

# --- demands --------------------------------------------------------------------------------------
#
# Demands are read once from a scenario's links or shape, and stated in SI units. The drawing and
# its certificate see the demands alone.


MARGIN_SHARE = 0.02
"""Margin by which links stay within range if none is given, as a share of the range."""

_LEAST_SHARE = 0.01
"""Least gap of circles, as a share of the range, if min_separation_m is less."""

_APART_SHARE = 1.1
"""Target gap of unlinked circles, in ranges: just too far to meet."""

ROOM_SHARE = 0.05
"""Distance to keep from edges of the area over the radius, as vehicles stray from their circles."""

LEAST_ROOM = 1e-6
"""The same, where there is no more room."""

_GAP_TOLERANCE = 1e-7
_CROSSING = 1e-9


@dataclass(frozen=True, slots=True)
class Names:
    """Names for messages: vehicles, landmarks, and the margin in m that links are to keep."""

    vehicles: Sequence[str]
    landmarks: Sequence[str]
    margin: float

    def link(self, pair: Array | Index) -> str:
        """Return a link as a-b."""
        return f"{self.vehicles[int(pair[0])]}-{self.vehicles[int(pair[1])]}"


@dataclass(frozen=True, slots=True)
class Demands:
    """Hard and soft demands on n circles; lengths in m.

    Attributes
    ----------
    names : names of the vehicles and landmarks
    radii : (n,)
    links : (e, 2) pairs a < b that must come within range
    least : least gap of any two circles
    most : (e,) largest gap of each link
    wanted : (e,) target gap of each link
    apart : least target gap of unlinked circles
    landmarks : (m, 2)
    sight : (n,) largest distance from its circle at which a vehicle sights a landmark
    groups : connected components of the links; each must sight two landmarks, or the only one
    area : where the circles may lie
    room : distance to keep from its edges, as a share of a radius, where that is possible
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
    room: float = ROOM_SHARE

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
    """Demands of a shape: neighbours' circles gap_m apart, whatever the range and landmarks."""
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


# --- a drawing, measured --------------------------------------------------------------------------
#
#     gap = D - R_a - R_b             of two circles: the least distance their vehicles can come to
#     off = |D - R|                   of a circle and a landmark
#     clearance                       of a circle in an area, see syncplan.scenario.areas
#
# All figures are computed here in NumPy from the centres; none is taken from a solver.


@dataclass(frozen=True, slots=True)
class Shortfalls:
    """Shortfalls of a drawing from its demands in m; zero where it meets them.

    Attributes
    ----------
    links : (e,) excess over the largest gap
    pairs : (p, 2) circles nearer than the least gap
    gaps : (p,) how much nearer
    landmarks : (k,) excess distance for each row of the drawing's `sightings`
    area : (n,) how far each circle lies across the area's borders
    """

    links: Array
    pairs: Index
    gaps: Array
    landmarks: Array
    area: Array

    @property
    def total(self) -> float:
        """Sum of all shortfalls in m."""
        return float(self.links.sum() + self.gaps.sum() + self.landmarks.sum() + self.area.sum())


@dataclass(frozen=True, slots=True)
class Drawing:
    """Centres of n circles, with their figures and shortfalls.

    Attributes
    ----------
    demands : demands on the drawing
    centers : (n, 2) m
    link_gaps : (e,) m, gap of the circles of each link
    sightings : (k, 2) vehicle and landmark: for each component the two it sights most easily
    sighted_from : (k,) m, distance of that vehicle's centre from the landmark
    missed : shortfalls from the demands
    starts, rounds : layouts tried and convex problems solved for it; 0 for closed forms
    """

    demands: Demands
    centers: Array
    link_gaps: Array
    sightings: Index
    sighted_from: Array
    missed: Shortfalls
    starts: int = 0
    rounds: int = 0


def draw(demands: Demands, centers: Array) -> Drawing:
    """Return the drawing with these (n, 2) centres in m."""
    pairs = close_pairs(centers, demands.radii, demands.least)
    missing = demands.least - outer_gaps(centers, demands.radii, pairs)
    near = missing > 0.0
    sightings = _sightings(demands, centers)
    vehicle, landmark = sightings.T
    away = np.hypot(*(centers[vehicle] - demands.landmarks[landmark]).T)
    off = np.abs(away - demands.radii[vehicle])
    gaps = outer_gaps(centers, demands.radii, demands.links)
    clear = demands.area.clearances(centers, demands.radii) if demands.area.limited else None
    missed = Shortfalls(
        links=np.maximum(gaps - demands.most, 0.0),
        pairs=pairs[near],
        gaps=missing[near],
        landmarks=np.maximum(off - demands.sight[vehicle], 0.0),
        area=np.zeros(demands.count) if clear is None else np.maximum(-clear, 0.0),
    )
    return Drawing(demands, centers, gaps, sightings, away, missed)


def _sightings(demands: Demands, centers: Array) -> Index:
    """Vehicle and landmark (k, 2): for each component the two it sights most easily."""
    chosen = []
    needed = min(2, len(demands.landmarks))
    for group in demands.groups if needed else ():
        away = np.hypot(*(centers[group][:, None] - demands.landmarks[None]).transpose(2, 0, 1))
        off = away - demands.radii[group][:, None]
        sight = demands.sight[group][:, None]
        cost = np.maximum(np.abs(off) - sight, 0.0) + 0.01 * np.abs(off - 0.5 * sight)
        nearest = np.argmin(cost, axis=0)
        best = cost[nearest, np.arange(len(demands.landmarks))]
        for landmark in np.sort(np.argsort(best, kind="stable")[:needed]):
            chosen.append((int(group[nearest[landmark]]), int(landmark)))
    return as_pairs(chosen)


# --- what obstacles hide --------------------------------------------------------------------------
#
# Obstacles may hide circles within range from each other. The improvement of a drawing ignores
# this; of the drawings that meet all demands, the one with the fewest hidden pairs is taken.


def hidden_pairs(drawing: Drawing, links: Index) -> Index:
    """Return (k, 2) bodies within range that obstacles hide from each other at all phases.

    Candidates are the (e, 2) links and the drawing's sightings; bodies from n on are landmarks.
    """
    demands = drawing.demands
    if not demands.obstacles:
        return np.zeros((0, 2), dtype=np.int64)
    team = _seeing(demands, drawing.centers)
    reach = demands.ranges[links].max(axis=1)
    near = links[outer_gaps(drawing.centers, demands.radii, links) <= reach]
    vehicles, landmarks = drawing.sightings.T
    targets = demands.count + landmarks
    unseen = np.diff(find_windows(team, (vehicles, targets)).first) == 0
    sightings = np.column_stack([vehicles, targets])
    return np.concatenate([near[hidden_at_all_phases(team, near)], sightings[unseen]])


def _seeing(demands: Demands, centers: Array) -> Team:
    """Team with all-round views; its senses and phases are placeholders."""
    count = demands.count
    orbits = Orbits(centers, demands.radii, np.ones(count), np.zeros(count), 1.0)
    sensors = Sensors(
        demands.ranges, np.full(count, 2.0 * np.pi), np.zeros(count), np.ones(count), 1.0
    )
    return seeing_team(orbits, sensors, demands.obstacles, demands.landmarks)
