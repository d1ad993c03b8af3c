"""Placement: centres for a formation that gives none, from its links or from the gap of its shape.

From links: any drawing of the graph whose linked circles come within range with a margin, whose
circles all keep apart, and that sights landmarks and stays within areas. From a shape: neighbours'
circles `gap_m` apart. Either is a start for refinement, with its figures computed in NumPy.

Both take the same steps: the scenario's demands, a drawing that should meet them, its certificate.

A first drawing draws each connected component by itself, scales it to the distances wanted, then
turns and shifts it to the best of many poses: two of its circles beside two landmarks, or anywhere
in the area. syncplan.placement.improvement reduces the remaining shortfalls.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np

from syncplan.arrays import Array, Index, as_pairs, short_repr
from syncplan.errors import InputError, NoSolutionError
from syncplan.orbits.circles import turned
from syncplan.orbits.contacts import outer_gaps, smallest_outer_gap
from syncplan.orbits.graphs import drawings
from syncplan.phrases import Places
from syncplan.placement.drawing import LEAST_ROOM, Demands, Drawing, demands_of, draw, hidden_pairs
from syncplan.placement.improvement import improved
from syncplan.placement.infeasibility import complaint, obstacle
from syncplan.results.quantities import plain
from syncplan.results.stories import Grid, Report, Story
from syncplan.runtime.machine import single_threaded_blas
from syncplan.scenario.areas import Area
from syncplan.scenario.formations import SHAPES
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.models import Formation
from syncplan.scenario.specification import Scenario

_SHAPE_ACCURACY = 1e-12


@dataclass(frozen=True, slots=True, repr=False)
class Placement(Report):
    """Scenario with its centres found, and their figures, recomputed from the centres.

    Attributes
    ----------
    scenario : as given, with formation.centers_m instead of a shape; listed links are kept
    centers : (n, 2) m
    margin : m, by which links stay within range if centres were found from them. The neighbours of
        a shape are gap_m apart, whatever the range
    links : (e, 2) pairs a < b: those listed, or else the neighbours of the shape
    gaps : (e,) m, gap of the circles of each link: the least distance its vehicles can come to
    smallest_gap : m, least gap of any two circles; infinite for one
    clearance : m, least distance of any circle from the border of area_m or keep_out_m; infinite
        without
    sightings : (k, 2) vehicle and landmark, two landmarks for each connected group of links
    sighting_distances : (k,) m, least distance of that vehicle's circle from the landmark
    hidden : (h, 2) bodies of links and sightings that obstacles hide from each other whatever the
        phases; landmarks from n on
    starts, iterations : layouts tried, convex problems solved in all; 0 for closed forms
    seed : seed of the layouts
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

    def as_json(self) -> dict[str, Any]:
        """Return the scenario with its centres as JSON values."""
        return self.scenario.model_dump(mode="json", exclude_none=True)

    def body(self) -> Story:
        """Yield the centres and the gaps between their circles."""
        names, places = self.scenario.vehicle_names, Places(self.centers.tolist())
        rows = zip(map(plain, names), map(places.words, self.centers.tolist()), strict=True)
        yield Grid("centres found", ("vehicle", "centre m"), list(rows))
        if len(self.gaps):
            low, high = self.gaps.min(), self.gaps.max()
            yield f"linked circles are {low:.4g} to {high:.4g} m apart"
        if np.isfinite(self.smallest_gap):
            yield f"no two circles are nearer than {self.smallest_gap:.4g} m"

    @property
    def notes(self) -> list[str]:
        """Notes on sight lines that obstacles hide."""
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

    Links stay within range by `margin` m, by default refine.margin_m or else a fiftieth of the
    shortest range. Raises InputError for a formation whose centres are known already, and
    NoSolutionError, naming the links that fail, if no drawing is found.
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
    """Best of the improved layouts, or the first that meets all demands and hides nothing."""
    reason = obstacle(demands)
    if reason:
        raise NoSolutionError(reason)
    best: Drawing | None = None
    least = (np.inf, 0)
    tried = rounds = 0
    for layout in starting_layouts(demands, starts, seed):
        drawing = improved(draw(demands, layout))
        if drawing.missed.total and demands.area.limited:
            tight = replace(demands, room=LEAST_ROOM)
            drawing = improved(draw(tight, drawing.centers))
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
    """Drawing of the shape with neighbours' circles gap_m apart, wherever that puts it."""
    shape, gap, columns = SHAPES[formation.shape or ""], formation.gap_m or 0.0, formation.columns
    centers = shape.gap_centers(demands.radii, gap, columns)
    if centers is not None:
        return draw(demands, centers)
    start = shape.centers(demands.count, 2.0 * float(demands.radii.mean()) + gap, columns)
    unbound = replace(demands, area=Area())
    # first with a loose upper limit: the true one would keep gaps a little below it
    loose = replace(unbound, most=2.0 * demands.most)
    drawing = improved(draw(loose, start), accuracy=_SHAPE_ACCURACY)
    if draw(unbound, drawing.centers).missed.total > 0.0:
        drawing = improved(draw(unbound, start), accuracy=_SHAPE_ACCURACY)
    return replace(draw(demands, _stood(drawing.centers, start)), starts=1, rounds=drawing.rounds)


def _stood(centers: Array, regular: Array) -> Array:
    """Turn centres to agree best with the regular shape, and shift the first to its first."""
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
    return Placement(
        scenario=_placed(scenario, centers),
        centers=centers,
        margin=demands.names.margin,
        links=links,
        gaps=outer_gaps(centers, demands.radii, links),
        smallest_gap=smallest_outer_gap(centers, demands.radii),
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


# --- first drawings -------------------------------------------------------------------------------


_POSES = 300
"""Number of poses tried for each component."""


def starting_layouts(demands: Demands, amount: int, seed: int) -> Iterator[Array]:
    """Yield `amount` layouts (n, 2) m to be improved, the same for the same seed."""
    groups = sorted(demands.groups, key=len, reverse=True)
    streams = [
        _component_drawings(_part(demands, group), amount, seed + k)
        for k, group in enumerate(groups)
    ]
    for child in np.random.SeedSequence(seed).spawn(amount):
        generator = np.random.default_rng(child)
        centers = np.zeros((demands.count, 2))
        settled: Index = np.zeros(0, dtype=np.int64)
        for group, stream in zip(groups, streams, strict=True):
            drawn = next(stream)
            part = _part(demands, group)
            centers[group] = _posed(part, drawn, demands, centers, settled, generator)
            settled = np.concatenate([settled, group])
        yield centers


def _part(demands: Demands, group: Index) -> Demands:
    """The demands of one component alone."""
    inside = np.isin(demands.links[:, 0], group)
    position = np.zeros(demands.count, dtype=np.int64)
    position[group] = np.arange(len(group))
    return replace(
        demands,
        names=replace(demands.names, vehicles=[demands.names.vehicles[k] for k in group]),
        radii=demands.radii[group],
        links=position[demands.links[inside]],
        most=demands.most[inside],
        wanted=demands.wanted[inside],
        sight=demands.sight[group],
        groups=(np.arange(len(group)),),
    )


def _component_drawings(part: Demands, amount: int, seed: int) -> Iterator[Array]:
    """Yield drawings of a component about the origin, scaled to the mean length of its links."""
    edges = [(int(a), int(b)) for a, b in part.links]
    for places in drawings(part.count, edges, amount, seed):
        drawn = places - places.mean(axis=0)
        if edges:
            lengths = outer_gaps(drawn, np.zeros(part.count), part.links)
            wanted = part.wanted + part.radii[part.links].sum(axis=1)
            drawn = drawn * float(np.mean(wanted) / np.mean(lengths))
        yield drawn


def _posed(
    part: Demands,
    drawn: Array,
    demands: Demands,
    centers: Array,
    settled: Index,
    generator: "np.random.Generator",
) -> Array:
    """Pose of a component with least shortfalls, given landmarks, area and settled circles."""
    aside = drawn + _aside(part, drawn, demands, centers, settled)
    if not len(demands.landmarks) and not demands.area.limited:
        return aside
    around = _across(part.count, len(settled))
    radii = np.concatenate([part.radii, demands.radii[settled]])
    best, least = aside, np.inf
    for pose in (aside, *islice(_poses(part, drawn, generator), _POSES)):
        missed = draw(part, pose).missed.total
        if len(settled) and missed < least:
            gaps = outer_gaps(np.concatenate([pose, centers[settled]]), radii, around)
            missed += float(np.sum(np.maximum(demands.least - gaps, 0.0)))
        if missed < least:
            best, least = pose, missed
        if least == 0.0:
            break
    return best


def _across(first: int, second: int) -> Index:
    """All pairs of one of the `first` indices and one of the `second` that follow them."""
    a, b = np.divmod(np.arange(first * second), max(second, 1))
    return np.column_stack([a, first + b])


def _aside(part: Demands, drawn: Array, demands: Demands, centers: Array, settled: Index) -> Array:
    """Shift that sets a component to the right of those settled already."""
    if not len(settled):
        return np.zeros(2)
    right = float(np.max(centers[settled, 0] + demands.radii[settled]))
    left = float(np.min(drawn[:, 0] - part.radii))
    return np.array([right + demands.apart - left, 0.0])


def _poses(part: Demands, drawn: Array, generator: "np.random.Generator") -> Iterator[Array]:
    """Yield turned and shifted drawings without end, beside two landmarks or within the area."""
    marks, area = part.landmarks, part.area
    corners = area.edges()[:, 0] if area.inside is None else area.inside
    low, high = (corners.min(axis=0), corners.max(axis=0)) if len(corners) else (0.0, 0.0)
    if area.inside is not None:
        yield drawn + 0.5 * (low + high)
    while True:
        angle = generator.uniform(0.0, 2.0 * np.pi)
        if not len(marks):
            spread = np.zeros(2) if area.inside is not None else np.ptp(drawn, axis=0) + part.unit
            yield turned(drawn, angle) + generator.uniform(low - spread, high + spread)
            continue
        a, b = _two(len(marks), generator)
        i, j = _two(part.count, generator) if generator.random() < 0.8 else (0, 0)
        aim, held = marks[b] - marks[a], drawn[j] - drawn[i]
        if i != j and a != b:
            angle = np.arctan2(aim[1], aim[0]) - np.arctan2(held[1], held[0])
        posed = turned(drawn, angle)
        # Beside the landmarks, not on them: off by up to a radius and half its sighting range.
        off = generator.uniform(0.0, 1.0) * (part.radii[i] + 0.5 * part.sight[i])
        way = generator.uniform(0.0, 2.0 * np.pi)
        middle = 0.5 * (marks[a] + marks[b]) + off * np.array([np.cos(way), np.sin(way)])
        yield posed + middle - 0.5 * (posed[i] + posed[j])


def _two(count: int, generator: "np.random.Generator") -> tuple[int, int]:
    """Draw two different numbers below `count`, or the same one twice if `count` is 1."""
    a = int(generator.integers(count))
    return a, (a + 1 + int(generator.integers(max(count - 1, 1)))) % count
