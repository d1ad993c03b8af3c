"""Area of the circles: inside one polygon, outside others; exact clearances by Shapely.

A circle lies inside an area if its centre does and no edge is nearer than its radius; for a
keep-out, read "outside". One signed number expresses both: the distance to the boundary less the
radius, where the distance is negative if the centre is on the wrong side. A path, unlike the disc
within it, is also clear of a keep-out that it goes round.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from syncplan.arrays import Array, Flags

_ARC_SEGMENTS = 64
"""Segments that approximate a quarter of a circle."""

_ARC_ERROR = 2e-4
"""Largest error of such an arc as a share of its radius: a chord spans up to 1.5 segments."""

_CONVEX = 1e-12
"""Share of its area by which a polygon may fall short of its hull and still count as convex."""


def _buffered(polygon: Any, distance: float) -> Any:
    """Polygon grown by `distance` m, fast.

    GEOS first fills dents of up to 1 % of the distance: growth may come out too large, and what is
    shrunk too small, or even empty.
    """
    return polygon.buffer(distance, quad_segs=_ARC_SEGMENTS)


def _grown(polygon: Any, distance: float) -> Any:
    """Polygon grown by `distance` m edge by edge, where GEOS fills nothing.

    Arcs are polygons within true ones: growth is too small by up to `_ARC_ERROR`, and what is
    shrunk too large.
    """
    import shapely

    corners = shapely.get_coordinates(polygon)
    edges = shapely.linestrings(np.stack([corners[:-1], corners[1:]], axis=1))
    near = shapely.union_all(shapely.buffer(edges, abs(distance), quad_segs=_ARC_SEGMENTS))
    return polygon.union(near) if distance > 0.0 else polygon.difference(near)


@dataclass(frozen=True, slots=True)
class Area:
    """Polygons in m, each (k, 2) corners in order, not closed.

    Attributes
    ----------
    inside : polygon that the circles lie within; None for no limit
    outside : polygons that the circles keep clear of
    """

    inside: Array | None = None
    outside: tuple[Array, ...] = ()

    @classmethod
    def of(
        cls,
        inside: Sequence[tuple[float, float]] | None,
        outside: Sequence[Sequence[tuple[float, float]]] | None,
    ) -> "Area":
        """Return the area with these corners in m, as a scenario states them."""
        return cls(
            None if inside is None else np.array(inside, dtype=float),
            tuple(np.array(corners, dtype=float) for corners in outside or []),
        )

    @property
    def limited(self) -> bool:
        """Whether there is any polygon at all."""
        return self.inside is not None or bool(self.outside)

    def polygons(self) -> list[tuple[str, Array, bool]]:
        """Return (key in the scenario, (k, 2) corners, whether circles lie within it) of each."""
        inner = [] if self.inside is None else [("area_m", self.inside, True)]
        return inner + [(f"keep_out_m[{k}]", one, False) for k, one in enumerate(self.outside)]

    def edges(self) -> Array:
        """Return the (e, 2, 2) start and end in m of every edge of every polygon."""
        polygons = [corners for _, corners, _ in self.polygons()]
        edges = [np.stack([one, np.roll(one, -1, axis=0)], axis=1) for one in polygons]
        return np.concatenate([np.zeros((0, 2, 2)), *edges])

    def clearances(self, centers: Array, radii: Array) -> Array:
        """Return the (n,) clearance of each disc in m, negative where it violates a polygon.

        Infinite where there is no polygon.
        """
        import shapely

        points = shapely.points(centers)
        clear = np.full(len(radii), np.inf)
        for _, corners, within in self.polygons():
            depth = _depths(shapely.Polygon(corners), points)
            clear = np.minimum(clear, (depth if within else -depth) - radii)
        return np.asarray(clear)

    def path_clearances(self, centers: Array, radii: Array) -> Array:
        """Return the (p, n) clearance in m of each circle's path from each polygon of `polygons`.

        Negative where it leaves the area or passes through a keep-out. A circle that goes round a
        keep-out is clear of it by its radius less the distance to the farthest corner.
        """
        import shapely

        points = shapely.points(centers)
        rows = []
        for _, corners, within in self.polygons():
            depth = _depths(shapely.Polygon(corners), points)
            if within:
                rows.append(depth - radii)
            else:
                outside = np.maximum(-depth, 0.0) - radii
                rows.append(np.maximum(outside, radii - _farthest(corners, centers)))
        return np.array(rows).reshape(len(rows), len(radii))

    def goes_round(self, keep_out: int, centers: Array, radii: Array) -> Flags:
        """Return (n,) whether each circle clears a keep-out better by going round than outside."""
        import shapely

        corners = self.outside[keep_out]
        nearest = shapely.distance(shapely.points(centers), shapely.Polygon(corners))
        return np.asarray(radii - _farthest(corners, centers) > nearest - radii)

    def has_room(self, radii: tuple[float, float], lower: Array, upper: Array) -> bool:
        """Return whether a path with a radius in `radii` and its centre in the box can lie clear.

        `radii` are the least and the largest in m. Not exact where they differ: the least is
        tested for passing outside keep-outs, the largest for going round them. False holds despite
        arcs and rounding: circles smaller by 2e-4 of the radius have no room either.
        """
        import shapely

        middle = 0.5 * (lower + upper)
        if self.path_clearances(middle[None], np.array(radii[:1])).min() >= 0.0:
            return True
        least, most = radii[0] * (1.0 - _ARC_ERROR), radii[1] * (1.0 + _ARC_ERROR)
        room = self._room(least, middle, round_them=most, grow=_grown)
        box = (
            shapely.box(*lower, *upper)
            if np.all(lower < upper)
            else shapely.LineString([lower, upper])
        )
        return bool(shapely.intersects(room, box))

    def nearest_clear(self, centers: Array, radii: Array, *, paths: bool = False) -> Array | None:
        """Return the (n, 2) centres in m nearest the given ones whose circles lie clear.

        With `paths`, circles may go round keep-outs. None if some circle fits nowhere.
        """
        import shapely

        moved = np.array(centers, dtype=float)
        clear = (
            self.path_clearances(centers, radii).min(axis=0)
            if paths
            else self.clearances(centers, radii)
        )
        for k in np.flatnonzero(clear < 0.0):
            outside, within = radii[k] * (1.0 + _ARC_ERROR), radii[k] * (1.0 - _ARC_ERROR)
            room = self._room(outside, moved[k], round_them=within if paths else 0.0)
            if room.is_empty:
                return None
            moved[k] = shapely.get_coordinates(
                shapely.shortest_line(room, shapely.Point(moved[k]))
            )[0]
        return moved

    # --- what a design asks of an area ------------------------------------------------------------

    @property
    def corners(self) -> Array:
        """(2, 2) m: least and largest coordinates of the outer polygon."""
        assert self.inside is not None
        return np.stack([self.inside.min(axis=0), self.inside.max(axis=0)])

    def largest_radius(self) -> float:
        """Return the radius in m of the largest circle within the outer polygon, to 1 mm.

        Less where the search for it ends early, as it may in large or intricate polygons.
        """
        import shapely

        return float(shapely.length(shapely.maximum_inscribed_circle(self._outer, 1e-3)))

    def size(self) -> float:
        """Return the size in m^2 without keep-outs."""
        return float(self._open.area)

    def most_size(self, grown: float) -> float:
        """Return an upper limit of the size in m^2 of the outer polygon grown by some m."""
        return float(_grown(self._outer, grown + _ARC_ERROR * max(grown, 0.0)).area)

    def grid(self, count: int) -> tuple[Array, float]:
        """Return the (p, 2) m of a grid, about `count` in the bounding box, that lie open.

        With the distance of neighbours in m.
        """
        import shapely

        west, south, east, north = self._outer.bounds
        step = np.sqrt((east - west) * (north - south) / count)
        x, y = (
            np.arange(low + 0.5 * step, high, step) for low, high in ((west, east), (south, north))
        )
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return np.asarray(points[shapely.contains_xy(self._open, points)]), float(step)

    def covered_share(self, centers: Array, radii: Array, half: float) -> float:
        """Return the share, keep-outs left out, within `half` m of some circle's path."""
        import shapely

        points = shapely.points(centers)
        outer = shapely.buffer(points, radii + half, quad_segs=_ARC_SEGMENTS)
        inner = shapely.buffer(points, np.maximum(radii - half, 0.0), quad_segs=_ARC_SEGMENTS)
        covered = shapely.union_all(shapely.difference(outer, inner))
        return float(shapely.intersection(self._open, covered).area / self._open.area)

    def on_edge(self, shares: Array) -> Array:
        """Return the (k, 2) m at these shares of the way round the outer polygon."""
        import shapely

        found = shapely.line_interpolate_point(self._outer.exterior, shares % 1.0, normalized=True)
        return np.asarray(shapely.get_coordinates(found))

    def nearest(self, places: Array) -> Array:
        """Return the (k, 2) m within the outer polygon that are nearest the given ones."""
        import shapely

        lines = shapely.shortest_line(self._outer, shapely.points(places))
        return np.asarray(shapely.get_coordinates(lines)[::2])

    @property
    def _outer(self) -> Any:
        import shapely

        return shapely.Polygon(self.inside)

    @property
    def _open(self) -> Any:
        import shapely

        closed = shapely.union_all([shapely.Polygon(one) for one in self.outside])
        return shapely.difference(self._outer, closed)

    def _room(
        self, radius: float, near: Array, *, round_them: float, grow: Callable[..., Any] = _buffered
    ) -> Any:
        """Region of the centres whose circles lie clear; around `near` if there is no outer limit.

        Includes the centres of circles of radius `round_them` m that go round a keep-out. By
        `_buffered` it may lack narrow parts.
        """
        import shapely

        corners = np.concatenate([*([] if self.inside is None else [self.inside]), *self.outside])
        reach = 4.0 * (radius + float(np.ptp(np.concatenate([corners, near[None]]), axis=0).max()))
        room = (
            shapely.box(*(near - reach), *(near + reach))
            if self.inside is None
            else grow(self._outer, -radius)
        )
        for one in self.outside:
            closed = grow(shapely.Polygon(one), radius)
            discs = shapely.buffer(shapely.points(one), round_them, quad_segs=_ARC_SEGMENTS)
            orbits = shapely.intersection(room, shapely.intersection_all(discs))
            room = shapely.union(room.difference(closed), orbits)
        return room


def _depths(polygon: Any, points: Any) -> Array:
    """(n,) depth of each point within the polygon in m; negative outside it."""
    import shapely

    away = shapely.distance(points, polygon.exterior)
    return np.asarray(np.where(shapely.covers(polygon, points), away, -away))


def _farthest(corners: Array, centers: Array) -> Array:
    """(n,) distance of each centre from its farthest corner in m."""
    return np.asarray(np.hypot(*(centers[:, None] - corners[None]).T).max(axis=0))


def convex_parts(corners: Array) -> list[Array]:
    """Return convex polygons (k, 2) that make up a polygon: itself if it is convex, else triangles.

    Source: constrained Delaunay triangulation, by GEOS.
    """
    import shapely

    polygon = shapely.Polygon(corners)
    if polygon.convex_hull.area <= polygon.area * (1.0 + _CONVEX):
        return [corners]
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    return [shapely.get_coordinates(one)[:-1] for one in triangles if one.area > 0.0]


def polygon_fault(corners: Sequence[tuple[float, float]]) -> str:
    """Return why corners do not form a simple polygon, or "" if they do."""
    import shapely

    if len(corners) < 3:
        return f"has {len(corners)} corners; a polygon needs at least 3, as [x, y]"
    polygon = shapely.Polygon(corners)
    if polygon.convex_hull.area <= 0.0:
        return "encloses nothing: its corners lie on one line"
    if not polygon.is_valid:
        return f"is not a simple polygon ({shapely.is_valid_reason(polygon)}); edges must not cross"
    return ""


def joined_polygons(polygons: Iterable[Sequence[Any]], tolerance: float) -> list[list[Any]]:
    """Return the polygons that polygons make up along their edges, corners in line left out.

    Each, given or returned, is the (k, 2) corners of its outer ring and those of its holes.
    """
    import shapely

    parts = [shapely.Polygon(outer, holes) for outer, *holes in polygons]
    return [
        [shapely.get_coordinates(ring)[:-1] for ring in (polygon.exterior, *polygon.interiors)]
        for polygon in shapely.get_parts(shapely.union_all(parts).simplify(tolerance))
    ]
