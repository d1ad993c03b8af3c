"""Layouts: first drawings of a graph of circles, set among landmarks, areas and keep-outs.

Each connected component is drawn by itself, scaled to the distances wanted, then turned and
shifted to the best of many poses: two of its circles beside two landmarks, or anywhere in the
area. All that a drawing still misses is left to syncplan.placement.improvement.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import turned
from syncplan.orbits.contacts import outer_gaps
from syncplan.orbits.graphs import drawings
from syncplan.placement.drawing import Demands, draw

_POSES = 300
"""Poses that are tried for each component."""


def starting_layouts(demands: Demands, amount: int, seed: int) -> Iterator[Array]:
    """Yield `amount` layouts (n, 2) m, each to be improved; the same for the same seed."""
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
    """Drawings of a component about the origin, scaled so that links have their mean length."""
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
    generator: np.random.Generator,
) -> Array:
    """The pose of a component that misses least, among landmarks, area and circles settled."""
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
    """Every pair of one of the `first` with one of the `second` that follow them."""
    a, b = np.divmod(np.arange(first * second), max(second, 1))
    return np.column_stack([a, first + b])


def _aside(part: Demands, drawn: Array, demands: Demands, centers: Array, settled: Index) -> Array:
    """Shift that sets a component to the right of those settled already."""
    if not len(settled):
        return np.zeros(2)
    right = float(np.max(centers[settled, 0] + demands.radii[settled]))
    left = float(np.min(drawn[:, 0] - part.radii))
    return np.array([right + demands.apart - left, 0.0])


def _poses(part: Demands, drawn: Array, generator: np.random.Generator) -> Iterator[Array]:
    """Turned and shifted drawings: beside two landmarks, or within the area, without end."""
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
        # Beside the landmarks, not on them: off by up to a radius and half of what it sees.
        off = generator.uniform(0.0, 1.0) * (part.radii[i] + 0.5 * part.sight[i])
        way = generator.uniform(0.0, 2.0 * np.pi)
        middle = 0.5 * (marks[a] + marks[b]) + off * np.array([np.cos(way), np.sin(way)])
        yield posed + middle - 0.5 * (posed[i] + posed[j])


def _two(count: int, generator: np.random.Generator) -> tuple[int, int]:
    """Two different numbers below `count`, the same one twice where there is but one."""
    a = int(generator.integers(count))
    return a, (a + 1 + int(generator.integers(max(count - 1, 1)))) % count
