"""Placement: centres for a formation that gives none, from its links or from the gap of its shape.

From links: any drawing of the graph whose linked circles come within range with a margin, whose
circles all keep apart, and that sights landmarks and stays within areas. From a shape: neighbours'
circles `gap_m` apart. Either is a start for refinement, with what it attains computed in NumPy.

The way is one: the scenario's demands, a drawing that should meet them, its certificate.
"""

from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Index, as_pairs, short_repr
from syncplan.errors import InputError, NoSolutionError
from syncplan.orbits.contacts import outer_gaps
from syncplan.placement.drawing import Demands, Drawing, demands_of, draw, hidden_pairs
from syncplan.placement.improvement import improved
from syncplan.placement.infeasibility import complaint, obstacle
from syncplan.placement.layouts import starting_layouts
from syncplan.runtime.numerics import single_threaded_blas
from syncplan.scenario.areas import Area
from syncplan.scenario.formations import SHAPES
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.models import Formation
from syncplan.scenario.specification import Scenario

_SHAPE_ACCURACY = 1e-12


@dataclass(frozen=True, slots=True, repr=False)
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
    hidden : (h, 2) bodies of links and sightings that obstacles hide from each other whatever the
        phases; landmarks from n on
    starts, iterations : layouts tried, convex problems solved in all; 0 for closed forms
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
    hidden: Index
    starts: int
    iterations: int
    seed: int

    __repr__ = short_repr

    @property
    def notes(self) -> list[str]:
        """What obstacles hide, in words."""
        names = [*self.scenario.vehicle_names, *self.scenario.landmark_names]
        return [
            f"{names[a]} and {names[b]} come within range, but obstacles_m hides them from each "
            "other at all phases; try another seed, other links or another gap"
            for a, b in self.hidden.tolist()
        ]


@single_threaded_blas
def place(
    scenario: Scenario, *, margin: float | None = None, starts: int = 8, seed: int = 0
) -> Placement:
    """Return centres for a formation given by links alone, or by a shape and a gap.

    Links stay within range by `margin` m: refine.margin_m if not given, else a fiftieth of the
    shortest range. Raises InputError for a formation whose centres are known already,
    NoSolutionError where no drawing is found, naming the links that fail.
    """
    formation = scenario.formation
    if formation.placed:
        raise InputError(
            "the centres are already given; plan the scenario as it is, or give links alone (or "
            "shape, count and gap_m) to have centres found",
            key="formation.centers_m" if formation.centers_m is not None else "formation.spacing_m",
        )
    if starts < 1:
        raise InputError(f"{starts}: must be at least 1", key="starts")
    if seed < 0:
        raise InputError(f"{seed}: must be 0 or more", key="seed")
    demands = demands_of(scenario, margin)
    if formation.shape is None:
        drawing = _draw_links(demands, starts, seed)
    else:
        drawing = _draw_shape(demands, formation)
    return _certified(scenario, drawing, seed)


def _draw_links(demands: Demands, starts: int, seed: int) -> Drawing:
    """The best of the layouts, improved; the first that meets all demands and hides nothing."""
    reason = obstacle(demands)
    if reason:
        raise NoSolutionError(reason)
    best: Drawing | None = None
    least = (np.inf, 0)
    tried = rounds = 0
    for layout in starting_layouts(demands, starts, seed):
        drawing = improved(draw(demands, layout))
        tried, rounds = tried + 1, rounds + drawing.rounds
        hidden = 0 if drawing.missed.total else len(hidden_pairs(drawing, demands.links))
        if (drawing.missed.total, hidden) < least:
            best, least = drawing, (drawing.missed.total, hidden)
        if least == (0.0, 0):
            break
    centers = np.zeros((0, 2)) if best is None else best.centers
    if not len(demands.landmarks) and not demands.area.limited:
        centers = centers - 0.5 * (centers.min(axis=0) + centers.max(axis=0))
    return replace(draw(demands, centers), starts=tried, rounds=rounds)


def _draw_shape(demands: Demands, formation: Formation) -> Drawing:
    """The shape with neighbours' circles gap_m apart, wherever that puts it."""
    shape, gap, columns = SHAPES[formation.shape or ""], formation.gap_m or 0.0, formation.columns
    centers = shape.gap_centers(demands.radii, gap, columns)
    if centers is not None:
        return draw(demands, centers)
    start = shape.centers(demands.count, 2.0 * float(demands.radii.mean()) + gap, columns)
    unbound = replace(demands, area=Area())
    # first without an upper limit, which would hold gaps a little short of itself
    loose = replace(unbound, most=2.0 * demands.most)
    drawing = improved(draw(loose, start), accuracy=_SHAPE_ACCURACY)
    if draw(unbound, drawing.centers).missed.total > 0.0:
        drawing = improved(draw(unbound, start), accuracy=_SHAPE_ACCURACY)
    return replace(draw(demands, _stood(drawing.centers, start)), starts=1, rounds=drawing.rounds)


def _stood(centers: Array, regular: Array) -> Array:
    """Centres turned to agree best with the regular shape, the first where the shape begins."""
    own, aim = centers - centers.mean(axis=0), regular - regular.mean(axis=0)
    dot = float(np.sum(own * aim))
    cross = float(np.sum(own[:, 0] * aim[:, 1] - own[:, 1] * aim[:, 0]))
    c, s = np.array([dot, cross]) / np.hypot(dot, cross)
    turned = own @ np.array([[c, s], [-s, c]])
    return np.asarray(turned - turned[0] + regular[0])


# --- the certificate ------------------------------------------------------------------------------


def _certified(scenario: Scenario, drawing: Drawing, seed: int) -> Placement:
    """Return the placement if the drawing meets all demands."""
    demands, centers, tried = drawing.demands, drawing.centers, drawing.starts
    if drawing.missed.total > 0.0:
        problem = complaint(drawing)
        raise NoSolutionError(
            f"no placement found in {tried} starts: {problem}" if tried else problem
        )
    listed = scenario.formation.links is not None
    links = as_pairs(scenario.linked) if listed else demands.links
    every = np.column_stack(np.triu_indices(demands.count, 1))
    return Placement(
        scenario=_placed(scenario, centers),
        centers=centers,
        margin=demands.names.margin,
        links=links,
        gaps=outer_gaps(centers, demands.radii, links),
        smallest_gap=float(outer_gaps(centers, demands.radii, every).min(initial=np.inf)),
        clearance=float(demands.area.clearances(centers, demands.radii).min()),
        sightings=drawing.sightings,
        hidden=hidden_pairs(drawing, links),
        sighting_distances=np.abs(drawing.sighted_from - demands.radii[drawing.sightings[:, 0]]),
        starts=tried,
        iterations=drawing.rounds,
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
