"""Placement: centres for a formation that gives none, from its links or from the gap of its shape.

From links: any drawing of the graph whose linked circles come within range with a margin, whose
circles all keep apart, and that serves landmarks and areas. From a shape: neighbours' circles
`gap_m` apart. Either is a start for refinement, and says in NumPy what it attains.
"""

from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.errors import InputError, NoSolutionError
from syncplan.orbits.graphs import components
from syncplan.orbits.separation import outer_gaps
from syncplan.placement.demands import Demands, shortfalls, sightings
from syncplan.placement.drawing import improve
from syncplan.placement.infeasibility import Names, complaint, obstacle
from syncplan.placement.layouts import starting_layouts
from syncplan.runtime.blas import single_threaded_blas
from syncplan.scenario.areas import Area
from syncplan.scenario.formations import gap_centers, neighbours, shape_centers
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.specification import Scenario, per_vehicle

__all__ = ["MARGIN_SHARE", "Placement", "place"]


MARGIN_SHARE = 0.02
"""Share of the range by which links stay within it where no margin is given."""

_LEAST_SHARE = 0.01
"""Share of the range that circles are kept apart where min_separation_m asks for less."""

_APART_SHARE = 1.1
"""Gap of unlinked circles aimed for, in ranges: just too far to meet."""

_SHAPE_ACCURACY = 1e-12
_GAP_TOLERANCE = 1e-7
_CROSSING = 1e-9


@dataclass(frozen=True, slots=True)
class Placement:
    """A scenario with its centres found, and what they attain, recomputed from the centres.

    Attributes
    ----------
    scenario : as given, with formation.centers_m instead of what led to them
    centers : (n, 2) m
    margin : m; links that centres were found for come within range less this. The neighbours of a
        shape are gap_m apart, whatever the range
    links : (e, 2) pairs a < b: those listed, or else the neighbours of the shape
    gaps : (e,) m, gap of the circles of each link: the least distance its vehicles can come to
    smallest_gap : m, least gap of any two circles; infinite for one
    clearance : m, how far any circle lies from the border of area_m or keep_out_m; infinite
        without
    sightings : (k, 2) vehicle and landmark, two landmarks for each connected group of links
    sighting_distances : (k,) m, least distance of that vehicle's circle from the landmark
    starts, iterations : layouts tried, convex programmes solved in all; 0 for closed forms
    seed : of the layouts
    """

    scenario: Scenario
    centers: Array
    margin: float
    links: Index
    gaps: Array
    smallest_gap: float
    clearance: float
    sightings: Index
    sighting_distances: Array
    starts: int
    iterations: int
    seed: int


@single_threaded_blas
def place(
    scenario: Scenario, *, margin: float | None = None, starts: int = 8, seed: int = 0
) -> Placement:
    """Return centres for a formation given by links alone, or by a shape and a gap.

    `margin` in m is what links stay within range by: refine.margin_m if not given, else a
    fiftieth of the shortest range. Raises InputError for a formation whose centres are known
    already, NoSolutionError where no drawing is found, naming the links that fail.
    """
    formation = scenario.formation
    if formation.placed:
        raise InputError(
            "the centres are given already; plan it as it is, or give links alone (or shape, "
            "count and gap_m) to have them found",
            key="formation.centers_m" if formation.centers_m is not None else "formation.spacing_m",
        )
    if starts < 1:
        raise InputError(f"{starts}: must be at least 1", key="starts")
    if seed < 0:
        raise InputError(f"{seed}: must be 0 or more", key="seed")
    kept = _margin(scenario, margin)
    if formation.shape is not None:
        return _shaped(scenario, kept, seed)
    demands = _demands(scenario, kept)
    names = Names(scenario.vehicle_names, scenario.landmark_names, kept)
    reason = obstacle(demands, names)
    if reason:
        raise NoSolutionError(reason)
    best, missed, iterations, tried = np.zeros((0, 2)), np.inf, 0, 0
    for layout in starting_layouts(demands, starts, seed):
        tried += 1
        drawing = improve(demands, layout)
        iterations += drawing.iterations
        if drawing.missed < missed:
            best, missed = drawing.centers, drawing.missed
        if missed == 0.0:
            break
    if not len(demands.landmarks) and not demands.area.limited:
        best = best - 0.5 * (best.min(axis=0) + best.max(axis=0))
    return _certified(scenario, demands, best, kept, tried, iterations, seed)


# --- the scenario as demands ----------------------------------------------------------------------


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


def _radii(scenario: Scenario) -> Array:
    return np.array(per_vehicle(scenario.orbit.radius_m, scenario.size), dtype=float)


def _ranges(scenario: Scenario) -> Array:
    return np.array([sensor.range_m for sensor in scenario.sensors])


def _listed(scenario: Scenario) -> Index:
    """(e, 2) pairs a < b as listed."""
    index = {name: k for k, name in enumerate(scenario.vehicle_names)}
    pairs = [sorted((index[a], index[b])) for a, b in scenario.formation.links or []]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _demands(scenario: Scenario, margin: float) -> Demands:
    links, ranges = _listed(scenario), _ranges(scenario)
    least = max(scenario.min_separation_m, _LEAST_SHARE * float(ranges.min()))
    most = ranges[links].max(axis=1) - margin
    edges = [(int(a), int(b)) for a, b in links]
    return Demands(
        radii=_radii(scenario),
        links=links,
        least=least,
        most=most,
        wanted=0.5 * (least + most),
        apart=max(_APART_SHARE * float(ranges.max()), least),
        landmarks=np.array(scenario.landmarks, dtype=float).reshape(-1, 2),
        sight=ranges - margin,
        groups=tuple(np.array(part) for part in components(scenario.size, edges)),
        area=Area.of(scenario.area_m, scenario.keep_out_m),
    )


# --- shapes ---------------------------------------------------------------------------------------


def _shaped(scenario: Scenario, margin: float, seed: int) -> Placement:
    """Place a shape whose neighbours' circles are gap_m apart, where the shape is defined."""
    formation, radii = scenario.formation, _radii(scenario)
    shape, gap, columns = formation.shape or "", formation.gap_m or 0.0, formation.columns
    links = neighbours(shape, len(radii), columns)
    if gap < scenario.min_separation_m:
        raise NoSolutionError(
            f"formation.gap_m {gap:g}: less than min_separation_m "
            f"{scenario.min_separation_m:g}; raise the gap or lower the separation"
        )
    most = np.maximum(gap, _ranges(scenario)[links].max(axis=1) - margin)
    demands = Demands(
        radii=radii,
        links=links,
        least=min(gap, max(scenario.min_separation_m, _CROSSING)) * (1.0 - _GAP_TOLERANCE),
        most=most * (1.0 + _GAP_TOLERANCE),
        wanted=np.full(len(links), gap),
        apart=min(gap, max(scenario.min_separation_m, _CROSSING)),
        landmarks=np.zeros((0, 2)),
        sight=np.zeros(len(radii)),
        groups=(),
        area=Area(),
    )
    centers, rounds = gap_centers(shape, radii, gap, columns), 0
    if centers is None:
        start = shape_centers(shape, len(radii), 2.0 * float(radii.mean()) + gap, columns)
        # first without an upper limit, which would hold gaps a little short of itself
        drawing = improve(replace(demands, most=2.0 * most), start, accuracy=_SHAPE_ACCURACY)
        if shortfalls(demands, drawing.centers).total > 0.0:
            drawing = improve(demands, start, accuracy=_SHAPE_ACCURACY)
        centers, rounds = _stood(drawing.centers, start), drawing.iterations
    demands = replace(demands, area=Area.of(scenario.area_m, scenario.keep_out_m))
    return _certified(scenario, demands, centers, margin, int(rounds > 0), rounds, seed)


def _stood(centers: Array, regular: Array) -> Array:
    """Centres turned to agree best with the regular shape, the first where the shape begins."""
    own, aim = centers - centers.mean(axis=0), regular - regular.mean(axis=0)
    dot = float(np.sum(own * aim))
    cross = float(np.sum(own[:, 0] * aim[:, 1] - own[:, 1] * aim[:, 0]))
    c, s = np.array([dot, cross]) / np.hypot(dot, cross)
    turned = own @ np.array([[c, s], [-s, c]])
    return np.asarray(turned - turned[0] + regular[0])


# --- the verdict ----------------------------------------------------------------------------------


def _certified(
    scenario: Scenario,
    demands: Demands,
    centers: Array,
    margin: float,
    starts: int,
    iterations: int,
    seed: int,
) -> Placement:
    """Return the placement if its centres meet all demands, judged afresh."""
    names = Names(scenario.vehicle_names, scenario.landmark_names, margin)
    missed = shortfalls(demands, centers)
    if missed.total > 0.0:
        problem = complaint(demands, names, centers, missed)
        raise NoSolutionError(
            f"no placement found in {starts} starts: {problem}" if starts else problem
        )
    links = _listed(scenario) if scenario.formation.links is not None else demands.links
    served = sightings(demands, centers)
    away = np.hypot(*(centers[served[:, 0]] - demands.landmarks[served[:, 1]]).T)
    a, b = np.triu_indices(demands.count, 1)
    every = outer_gaps(centers, demands.radii, np.column_stack([a, b]))
    return Placement(
        scenario=_placed(scenario, centers),
        centers=centers,
        margin=margin,
        links=links,
        gaps=outer_gaps(centers, demands.radii, links),
        smallest_gap=float(every.min(initial=np.inf)),
        clearance=float(demands.area.clearances(centers, demands.radii).min()),
        sightings=served,
        sighting_distances=np.abs(away - demands.radii[served[:, 0]]),
        starts=starts,
        iterations=iterations,
        seed=seed,
    )


def _placed(scenario: Scenario, centers: Array) -> Scenario:
    """The scenario with these centres, checked as if a user had written them."""
    names = scenario.vehicle_names
    formation: dict[str, object] = {"centers_m": centers.tolist()}
    if scenario.formation.names is not None or names != [f"v{k + 1}" for k in range(len(names))]:
        formation["names"] = names
    if scenario.formation.links is not None:
        formation["links"] = [list(pair) for pair in scenario.formation.links]
    document = scenario.model_dump(mode="json", exclude_unset=True)
    return scenario_from({**document, "formation": formation}, max_vehicles=scenario.size)
