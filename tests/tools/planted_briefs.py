"""Briefs around a formation that meets them just so, by distances of points from segments alone.

Areas are convex, star-shaped, thin, L-shaped or shallowly dented, from 0.1 m to 100 km in size, at
the origin or on a map grid. Circles touch what they may touch, and the purpose asks for what they
do. Gaps to what is possible are shares: zero, down to 1e-12, or lengths of 0.5 um to 3 mm.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.scenario.brief import Brief
from tests.tools.briefs import brief

MAP_GRID_M = np.array([465_070.0, 5_249_000.0])
"""Place of an area on a map grid such as UTM's."""

ULPS = 4e-15
"""Share by which a planted length gives way to rounding."""


@dataclass(frozen=True, slots=True)
class Planted:
    """A brief, and a formation of circles (n, 2) m, of one radius in m, that meets it."""

    brief: Brief
    centers: Array
    radius: float


def draw_planted(generator: np.random.Generator, *, edge: bool) -> Planted:
    """Return a planted brief; with `edge`, nothing larger or further is possible by up to 1 %."""
    corners, deep = draw_area(generator)
    size = float(np.ptp(corners, axis=0).max())
    count = int(generator.integers(1, 5))
    apart = size * (10.0 ** generator.uniform(-9.0, -2.0) if edge else generator.uniform(0.01, 0.5))
    centers = deep + apart * generator.uniform(-1.0, 1.0, (count, 2))
    centers[0] = deep
    inside = depths(corners, centers) > (0.99 if edge else 0.1) * depths(corners, deep[None])
    centers = centers[inside]
    radius = float(depths(corners, centers).min()) * (1.0 - ULPS)
    if not edge:
        radius *= generator.uniform(0.1, 1.0)
    purpose, radius = _purpose(generator, corners, centers, radius)
    keep_outs = [] if "cover" in purpose else _keep_outs(generator, centers, radius, size)
    least = radius * (1.0 - _gap(generator, radius))
    keys: dict[str, Any] = (
        {"keep_out_m": [polygon.tolist() for polygon in keep_outs]} if keep_outs else {}
    )
    return Planted(
        brief(
            area_m=corners.tolist(),
            vehicle={"speed_mps": 1.0, "min_radius_m": least},
            team={"max": len(centers)},
            purpose=purpose,
            **keys,
        ),
        centers,
        radius,
    )


def draw_impossible(generator: np.random.Generator) -> Brief:
    """Return a brief that asks for 1 % more than any formation can do."""
    corners, deep = draw_area(generator)
    largest = float(depths(corners, deep[None])[0])
    radius, count = 0.3 * largest, int(generator.integers(1, 4))
    edges = np.roll(corners, -1, axis=0) - corners
    around, size = float(np.hypot(*edges.T).sum()), _size(corners)
    purpose: dict[str, Any] = {"keep": {"count": 1, "spread_m": 1.0}}
    kind = generator.integers(4)
    if kind == 0:
        radius = 1.01 * largest
    elif kind == 1:
        turn = generator.uniform(0.0, 2.0 * np.pi)
        point = deep + 2.0 * around * np.array([np.cos(turn), np.sin(turn)])
        away = -float(depths(corners, point[None])[0])
        purpose = {"visit_m": [point.tolist()], "within_m": away / 1.01}
    elif kind == 2:
        strips = 4.0 * np.pi * largest * count
        half = min(largest * 10.0 ** generator.uniform(-1.5, -0.5), 0.9 * size / strips)
        purpose = {"cover": {"share": 1.01 * strips * half / size, "swath_m": 2.0 * half}}
    else:
        # discs of h in radius against the area grown by g = h - r, at most A + P g + pi g^2
        count = 4
        less = around - 2.0 * np.pi * radius
        rest = size - around * radius + np.pi * radius**2
        h = np.roots([np.pi * (count / 1.01 - 1.0), -less, -rest]).max()
        purpose = {"keep": {"count": count, "spread_m": 2.0 * float(h)}}
    return brief(
        area_m=corners.tolist(),
        vehicle={"speed_mps": 1.0, "min_radius_m": radius},
        team={"max": count},
        purpose=purpose,
    )


def draw_area(generator: np.random.Generator) -> tuple[Array, Array]:
    """Return corners (k, 2) m of an area, and a centre (2,) m of a largest circle within it."""
    shape = SHAPES[int(generator.integers(len(SHAPES)))](generator)
    deep = deepest(shape, generator)
    turn = generator.uniform(0.0, 2.0 * np.pi)
    turned = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    size = 10.0 ** generator.uniform(-1.0, 5.0) / np.ptp(shape, axis=0).max()
    place = MAP_GRID_M if generator.random() < 0.5 else np.zeros(2)
    return size * shape @ turned + place, size * deep @ turned + place


def depths(corners: Array, points: Array) -> Array:
    """Return (p,) m how deep points lie within a polygon, negative outside it."""
    starts, ends = corners, np.roll(corners, -1, axis=0)
    away = np.hypot(*_ways(corners, points).T)
    # a ray to the right crosses the boundary an odd number of times
    along, to = ends - starts, points[:, None] - starts
    spans = (starts[:, 1] > points[:, 1:]) != (ends[:, 1] > points[:, 1:])
    left = (along[:, 0] * to[..., 1] - along[:, 1] * to[..., 0] > 0.0) == (along[:, 1] > 0.0)
    return np.asarray(np.where(np.sum(spans & left, axis=1) % 2 == 1, away, -away))


def _ways(corners: Array, points: Array) -> Array:
    """Ways (p, 2) m from points to the nearest places of a polygon's boundary."""
    along, to = np.roll(corners, -1, axis=0) - corners, points[:, None] - corners
    share = np.clip(np.sum(to * along, axis=2) / np.sum(along**2, axis=1), 0.0, 1.0)
    ways = share[..., None] * along - to
    nearest = np.argmin(np.hypot(ways[..., 0], ways[..., 1]), axis=1)
    return np.asarray(ways[np.arange(len(points)), nearest])


def _size(corners: Array) -> float:
    """Size of a polygon in m^2."""
    x, y = (corners - corners[0]).T
    return 0.5 * abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))


def deepest(corners: Array, generator: np.random.Generator) -> Array:
    """Return the point (2,) m furthest within a polygon, by a grid and ever smaller steps."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    grid = np.stack(np.meshgrid(*np.linspace(low, high, 42)[1:-1].T), axis=-1).reshape(-1, 2)
    place, step = grid[np.argmax(depths(corners, grid))], (high - low) / 40.0
    ring = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    while np.max(step / (high - low)) > 1e-12:
        turn = ring + generator.uniform(0.0, 2.0 * np.pi)
        tried = np.vstack([place, place + step * np.column_stack([np.cos(turn), np.sin(turn)])])
        best = int(np.argmax(depths(corners, tried)))
        place, step = tried[best], step if best else 0.8 * step
    return np.asarray(place)


# --- what is asked --------------------------------------------------------------------------------


def _gap(generator: np.random.Generator, length: float) -> float:
    """A share of a length: none, a small one, or one of 0.5 um to 3 mm."""
    share = (
        0.0,
        generator.choice([1e-3, 1e-6, 1e-9]),
        10.0 ** generator.uniform(-12.0, -2.0),
        10.0 ** generator.uniform(np.log10(0.5e-6), np.log10(3e-3)) / length,
    )[int(generator.integers(4))]
    return min(float(share), 0.01)


def _purpose(
    generator: np.random.Generator, corners: Array, centers: Array, radius: float
) -> tuple[dict[str, Any], float]:
    """A purpose that the circles serve just so, and their radius."""
    kind = generator.integers(3)
    less = 1.0 - ULPS - _gap(generator, radius)
    if kind == 0 and len(centers) > 1:
        a, b = np.triu_indices(len(centers), 1)
        spread = float(np.hypot(*(centers[a] - centers[b]).T).min()) * less
        if spread >= 1e-6:
            return {"keep": {"count": len(centers), "spread_m": spread}}, radius
    if kind == 1 and radius > 1e-3:
        # its strip is all within the area: the first circle gives way by half of it
        half = radius * 10.0 ** generator.uniform(-3.0, -0.5)
        share = 4.0 * np.pi * (radius - half) * half / _size(corners)
        return {"cover": {"share": share * less, "swath_m": 2.0 * half}}, radius - half
    # beyond the place where a circle touches the edge
    center = centers[np.argmin(depths(corners, centers))]
    way = _ways(corners, center[None])[0]
    beyond = 1e-6 + radius * (1.0 + 10.0 ** generator.uniform(-3.0, 1.0))
    point = center + beyond / np.hypot(*way) * way
    off = abs(float(np.hypot(*(point - center))) - radius)
    return {"visit_m": [point.tolist()], "within_m": off / less}, radius


def _keep_outs(
    generator: np.random.Generator, centers: Array, radius: float, size: float
) -> list[Array]:
    """Up to two polygons that the circles keep clear of or go round, as large as may be."""
    polygons = []
    for _ in range(int(generator.integers(3))):
        shape = SHAPES[int(generator.integers(len(SHAPES)))](generator)
        shape = shape / np.ptp(shape, axis=0).max()
        if generator.random() < 0.5:
            middle = centers[0] + 0.3 * radius * generator.uniform(-1.0, 1.0, 2)
        else:
            middle = centers[0] + size * generator.uniform(-1.0, 1.0, 2)

        def clear(scale: float, shape: Array = shape, middle: Array = middle) -> bool:
            polygon = middle + scale * shape
            outside = -depths(polygon, centers) >= radius
            far = np.hypot(*(centers[:, None] - polygon).transpose(2, 0, 1)).max(axis=1)
            return bool(np.all(outside | (far <= radius)))

        low, high = 1e-3 * radius, size
        if not clear(low):
            continue
        while high - low > 1e-14 * size:
            scale = 0.5 * (low + high)
            low, high = (scale, high) if clear(scale) else (low, scale)
        polygon = middle + low * (1.0 - ULPS) * shape
        if clear(low * (1.0 - ULPS)) and np.ptp(polygon, axis=0).min() > 1e-4 * size:
            polygons.append(polygon)
    return polygons


# --- shapes ---------------------------------------------------------------------------------------


def _star(generator: np.random.Generator) -> Array:
    count = int(generator.integers(4, 13))
    turn = 2.0 * np.pi * (np.arange(count) + generator.uniform(-0.3, 0.3, count)) / count
    away = generator.uniform(0.3, 1.0, count)
    return np.asarray(away[:, None] * np.column_stack([np.cos(turn), np.sin(turn)]))


def _convex(generator: np.random.Generator) -> Array:
    count = int(generator.integers(3, 10))
    turn = 2.0 * np.pi * (np.arange(count) + generator.uniform(-0.4, 0.4, count)) / count
    return np.column_stack([np.cos(turn), generator.uniform(0.2, 1.0) * np.sin(turn)])


def _thin(generator: np.random.Generator) -> Array:
    width = 10.0 ** generator.uniform(-3.0, -1.0)
    return np.array([[0.0, 0.0], [1.0, 0.0], [1.0, width], [0.0, width]])


def _bent(generator: np.random.Generator) -> Array:
    x, y = generator.uniform(0.1, 0.9, 2)
    return np.array([[0.0, 0.0], [1.0, 0.0], [1.0, y], [x, y], [x, 1.0], [0.0, 1.0]])


def _dented(generator: np.random.Generator) -> Array:
    """A convex polygon whose edges bend in or out by up to some per cent of their length."""
    corners = _convex(generator)
    ends = np.roll(corners, -1, axis=0)
    along = ends - corners
    inwards = np.column_stack([-along[:, 1], along[:, 0]])
    depth = 10.0 ** generator.uniform(-4.0, -1.0, len(corners))[:, None]
    depth *= generator.choice([-1.0, 1.0])
    share = generator.uniform(0.3, 0.7, len(corners))[:, None]
    return np.stack([corners, corners + share * along + depth * inwards], axis=1).reshape(-1, 2)


SHAPES: tuple[Callable[[np.random.Generator], Array], ...] = (
    _star,
    _convex,
    _thin,
    _bent,
    _dented,
)
"""Draws of polygons (k, 2), about 1 in size."""
