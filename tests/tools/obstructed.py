"""Teams among obstacles, and their windows against dense sampling with bisection by Shapely.

The other side knows positions, headings and the exact predicates of GEOS alone.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely

from syncplan.arrays import Array, Flags
from syncplan.orbits.circles import Orbits, heading, position, unit, wrap
from syncplan.orbits.contacts import Windows, find_windows
from syncplan.orbits.team import Sensors, Team
from syncplan.scenario.areas import polygon_fault
from tests.tools.draws import NOISE

SAMPLES = 600
"""A period, evenly spaced."""

SHORT = 1e-5
"""Windows and gaps shorter than this many seconds may be absent."""

EDGE_S, FLAT_M_S = 1e-9, 1e-3
"""An edge is good to the first where the crossing has at least the second as slope."""

_PROBE_S = 1e-6
_BISECTIONS = 55
_ALL_ROUND = 2.0 * np.pi


@dataclass(frozen=True, slots=True)
class Comparison:
    """How the windows of a team compare with sampling.

    Attributes
    ----------
    edges : how many changes were bisected
    at_obstacles : how many of them an obstacle makes
    largest : s, the largest error of an edge whose crossing has slope
    mismatches : in words
    """

    edges: int
    at_obstacles: int
    largest: float
    mismatches: tuple[str, ...]


def draw_obstructed(generator: np.random.Generator) -> Team:
    """Return 2 or 3 vehicles, 2 or 3 landmarks and 1 to 4 obstacles that some paths touch.

    Corners are binary fractions: a landmark in the middle of an edge is on it exactly.
    """
    count = int(generator.integers(2, 4))
    radii = generator.integers(3, 20, count) + generator.choice([0.0, 0.5])
    if generator.random() < 0.3:
        radii[:] = radii[0]
    centers = generator.integers(-25, 26, (count, 2)).astype(float)
    if generator.random() < 0.1:
        centers[1] = centers[0]
        radii[1] = radii[0] * 1.5
    orbits = Orbits(
        centers,
        radii,
        generator.choice([-1.0, 1.0], count),
        generator.uniform(0.0, 2.0 * np.pi, count),
        rate=float(generator.choice([0.2, 1.0])),
    )
    obstacles = [_obstacle(generator, orbits) for _ in range(int(generator.integers(1, 5)))]
    sensors = Sensors(
        generator.uniform(15.0, 90.0, count),
        generator.choice([_ALL_ROUND, _ALL_ROUND, 1.0, 4.0], count),
        generator.uniform(-np.pi, np.pi, count),
        np.full(count, 0.1),
        0.1,
    )
    landmarks = _landmarks(generator, obstacles)
    return Team(orbits, landmarks, sensors, NOISE, obstacles=tuple(obstacles))


def compare(team: Team) -> Comparison:
    """Compare all windows of a team with sampling, and those of obstacles both ways."""
    windows = find_windows(team)
    bodies = team.count + len(team.landmarks)
    solid = [shapely.Polygon(corners) for corners in team.obstacles]
    shapely.prepare(solid)
    edges, at_obstacles, largest, mismatches = 0, 0, 0.0, []
    for a in range(team.count):
        for b in range(bodies):
            if a == b:
                continue
            pair = _Pair(team, solid, a, b)
            exact = _windows_of(windows, a, b)
            found = [f"{a} sees {b}: {text}" for text in _misjudged(pair, exact)]
            for moment in _changes(pair):
                error = _distance_to_edge(exact, moment, pair.period)
                slope, obstructed = pair.slope(moment)
                edges, at_obstacles = edges + 1, at_obstacles + obstructed
                if slope >= FLAT_M_S:
                    largest = max(largest, error)
                # a flatter crossing moves by rounding over its slope
                if not error < EDGE_S * max(1.0, FLAT_M_S / (slope + 1e-12)):
                    found.append(f"{a} sees {b}: edge {moment:.9f} s is {error:.2g} s off")
            mismatches += found
    return Comparison(edges, at_obstacles, largest, tuple(mismatches))


@dataclass(frozen=True, slots=True)
class _Pair:
    """What is known of a pair at an instant."""

    team: Team
    solid: list[shapely.Polygon]
    a: int
    b: int

    @property
    def period(self) -> float:
        return self.team.orbits.period

    def ends(self, t: Array) -> tuple[Array, Array]:
        places, count = position(self.team.orbits, t), self.team.count
        there = (
            places[:, self.b]
            if self.b < count
            else np.broadcast_to(self.team.landmarks[self.b - count], places[:, 0].shape)
        )
        return places[:, self.a], there

    def margins(self, t: Array) -> Array:
        """(k, 2) m: of range, and of the view at the target; negative where it is not seen."""
        here, there = self.ends(t)
        away, sensors = there - here, self.team.sensors
        distance = np.hypot(away[:, 0], away[:, 1])
        look = heading(self.team.orbits, t)[:, self.a] + sensors.boresights[self.a]
        off = np.abs(wrap(np.arctan2(away[:, 1], away[:, 0]) - look))
        half = 0.5 * sensors.fields_of_view[self.a]
        view = np.full(len(t), np.pi) if half >= np.pi else (half - off) * distance
        return np.column_stack([sensors.ranges[self.a] - distance, view])

    def blocked(self, t: Array) -> Flags:
        lines = shapely.linestrings(np.stack(self.ends(t), axis=1))
        found = np.zeros(len(t), dtype=bool)
        for polygon in self.solid:
            found |= shapely.relate_pattern(polygon, lines, "T********")
        return found

    def sees(self, t: Array) -> Flags:
        found = np.asarray((self.margins(t) >= 0.0).all(axis=1))
        found[found] = ~self.blocked(t[found])
        return found

    def slope(self, moment: float) -> tuple[float, bool]:
        """Slowest crossing in m/s of what changes at a moment, and whether an obstacle makes it."""
        either = np.array([moment - _PROBE_S, moment + _PROBE_S])
        rates = np.abs(np.diff(self.margins(either), axis=0))[0] / (2.0 * _PROBE_S)
        near = np.abs(self.margins(np.array([moment]))[0]) < 1e-5
        slopes = rates[near].tolist()
        obstructed = bool(np.diff(self.blocked(either))[0])
        if obstructed:
            slopes += self._slopes_at_obstacles(moment, either)
        return min(slopes, default=0.0), obstructed

    def _slopes_at_obstacles(self, moment: float, either: Array) -> list[float]:
        (start,), (end,) = self.ends(np.array([moment]))
        starts, ends = self.ends(either)
        line = shapely.LineString([start, end])
        slopes = []
        for polygon in self.solid:
            corners = shapely.get_coordinates(polygon)
            others = np.roll(corners[:-1], -1, axis=0)
            for corner, other in zip(corners[:-1], others, strict=True):
                if shapely.distance(line, shapely.Point(corner)) < 1e-5:
                    slopes.append(_turning(starts, ends, corner))
                if np.array_equal(corner, other):
                    continue
                edge = shapely.LineString([corner, other])
                for point, moved in ((start, starts), (end, ends)):
                    if shapely.distance(edge, shapely.Point(point)) < 1e-5:
                        rate = np.diff(_aside(corner, other, moved))[0] / (2.0 * _PROBE_S)
                        slopes.append(abs(float(rate)))
        # an end that stands still on an edge changes nothing
        return [slope for slope in slopes if slope > 0.0]


def _turning(starts: Array, ends: Array, corner: Array) -> float:
    """m/s: how fast a moving line passes a corner."""
    sides = [float(_aside(a, b, corner[None])[0]) for a, b in zip(starts, ends, strict=True)]
    return abs(sides[1] - sides[0]) / (2.0 * _PROBE_S)


def _aside(start: Array, end: Array, points: Array) -> Array:
    """(k,) m: how far points lie to the left of a line."""
    way, away = end - start, points - start
    return np.asarray((way[0] * away[:, 1] - way[1] * away[:, 0]) / np.hypot(*way))


def _windows_of(windows: Windows, a: int, b: int) -> Array:
    chosen = np.flatnonzero((windows.observers == a) & (windows.targets == b))
    return windows.of(int(chosen[0])) if len(chosen) else np.zeros((0, 2))


def _misjudged(pair: _Pair, exact: Array) -> list[str]:
    """Where samples, or the middle and the ends of windows and gaps, disagree."""
    t = np.linspace(0.0, pair.period, SAMPLES + 1)
    wrong = t[pair.sees(t) != covered(exact, t, pair.period)]
    found = [
        f"sample at {moment:.6f} s disagrees"
        for moment in wrong
        if _distance_to_edge(exact, float(moment), pair.period) > _PROBE_S
    ]
    following = np.append(exact[1:, 0], exact[:1, 0] + pair.period)
    gaps = np.column_stack([exact[:, 1], following])
    for spans, expected in ((exact, True), (gaps, False)):
        for begin, end in spans[spans[:, 1] - spans[:, 0] > SHORT]:
            whole = expected and end - begin >= pair.period
            # not in the very middle, where a path that touches a wall may be seen for an instant
            probes = [begin + 0.43 * (end - begin)]
            probes += [] if whole else [begin + 0.3 * SHORT, end - 0.3 * SHORT]
            if np.any(pair.sees(np.array(probes)) != expected):
                found.append(f"{'window' if expected else 'gap'} {begin:.6f} to {end:.6f} s")
    return found


def covered(exact: Array, t: np.ndarray, period: float) -> Flags:
    """Return whether times (k,) of a period are within windows (m, 2)."""
    inside = np.zeros(len(t), dtype=bool)
    for start, end in exact:
        inside |= ((t >= start) & (t <= end)) | ((t + period >= start) & (t + period <= end))
    return inside


def _distance_to_edge(exact: Array, moment: float, period: float) -> float:
    edges = exact.ravel() % period
    away = np.abs((edges - moment + 0.5 * period) % period - 0.5 * period)
    return float(np.min(away, initial=np.inf))


def _changes(pair: _Pair) -> list[float]:
    """Moments at which sampling sees a change, each bisected."""
    t = np.linspace(0.0, pair.period, SAMPLES + 1)
    sampled = pair.sees(t)
    at = np.flatnonzero(sampled[:-1] != sampled[1:])
    return [float(t) for t in _bisected(pair.sees, t[at], t[at + 1], sampled[at])]


def _bisected(seen: Callable[[Array], Flags], low: Array, high: Array, first: Flags) -> Array:
    for _ in range(_BISECTIONS if len(low) else 0):
        middle = 0.5 * (low + high)
        before = seen(middle) == first
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return 0.5 * (low + high)


# --- what is drawn --------------------------------------------------------------------------------


def _obstacle(generator: np.random.Generator, orbits: Orbits) -> Array:
    """(k, 2) m, with corners of few digits: convex, concave or thin, anywhere or about a path."""
    while True:
        vehicle = int(generator.integers(0, orbits.count))
        center, radius = orbits.centers[vehicle], orbits.radii[vehicle]
        kind = generator.choice(["anywhere", "orbited", "passed through", "tangent"])
        size = float(generator.uniform(3.0, 16.0))
        if kind == "anywhere":
            middle = generator.uniform(-30.0, 30.0, 2)
        elif kind == "orbited":
            middle, size = center, 0.7 * radius
        else:
            middle = center + radius * unit(generator.uniform(0.0, 2.0 * np.pi))
        corners = _even(middle + size * _outline(generator))
        if kind == "tangent":
            # one corner where the circle is furthest to one side, the others beyond it
            corners = corners - corners[np.argmin(corners[:, 0])] + center + [radius, 0.0]
        if not polygon_fault([(x, y) for x, y in corners.tolist()]):
            return corners


def _outline(generator: np.random.Generator) -> Array:
    """(k, 2) corners about the origin, of size 1."""
    kind = generator.choice(["star", "wall", "angle"])
    if kind == "star":
        count = int(generator.integers(3, 10))
        turns = np.sort(generator.uniform(0.0, 2.0 * np.pi, count))
        return np.asarray(generator.uniform(0.3, 1.0, count)[:, None] * unit(turns))
    if kind == "wall":
        along = unit(generator.choice([0.0, 0.5, generator.uniform(0.0, 2.0)]) * np.pi)
        across = 0.15 * np.array([-along[1], along[0]])
        return np.array([along + across, -along + across, -along - across, along - across])
    angle = np.array([[-1, -1], [1, -1], [1, -0.4], [-0.4, -0.4], [-0.4, 1], [-1, 1]], dtype=float)
    turn = unit(generator.uniform(0.0, 2.0 * np.pi))
    return np.asarray(angle @ np.array([[turn[0], turn[1]], [-turn[1], turn[0]]]))


def _even(points: Array) -> Array:
    return np.asarray(2.0 * np.round(0.5 * points))


def _landmarks(generator: np.random.Generator, obstacles: list[Array]) -> Array:
    """One anywhere, one on a wall, and at times one at a corner or in an obstacle's middle."""
    corners = obstacles[int(generator.integers(0, len(obstacles)))]
    k = int(generator.integers(0, len(corners)))
    places = [generator.uniform(-40.0, 40.0, 2), 0.5 * (corners[k - 1] + corners[k])]
    chance = generator.random()
    if chance < 0.25:
        places.append(corners[k])
    elif chance < 0.4:
        places.append(corners.mean(axis=0) + 0.01)
    return np.array(places)
