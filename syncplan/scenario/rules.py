"""Rules that span the keys of a scenario; each raises the fault that names the key to correct."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any

from pydantic import BeforeValidator

from syncplan.scenario.areas import polygon_fault
from syncplan.scenario.models import Limits, RefineOptions
from syncplan.scenario.quantities import FURTHEST_M, Many, Pair, Place, Point, Polygon, fault

# --- polygons -------------------------------------------------------------------------------------


MAX_OBSTACLE_CORNERS = 1000
"""Most corners of all obstacles together: each is checked for every pair that it may hide."""


def _not_one_alone(value: Any) -> Any:
    """Raise the fault for a single polygon in place of a list of polygons."""
    corner = value[0] if isinstance(value, list | tuple) and value else None
    if isinstance(corner, list | tuple) and corner and isinstance(corner[0], int | float):
        raise fault("", "is one polygon; give a list of polygons, as [[[x, y], [x, y], [x, y]]]")
    return value


Polygons = Annotated[Many[Polygon], BeforeValidator(_not_one_alone)]
PolygonsOfPlaces = Annotated[Many[Many[Place]], BeforeValidator(_not_one_alone)]


def check_polygons(polygons: Mapping[str, Sequence[Point]]) -> None:
    """Raise the fault if the corners of a key do not form a simple polygon."""
    for key, corners in polygons.items():
        problem = polygon_fault(corners)
        if problem:
            raise fault(key, problem)


def check_corners(key: str, polygons: Sequence[Sequence[Point]]) -> None:
    """Raise the fault if all polygons of a key have more than MAX_OBSTACLE_CORNERS corners."""
    corners = sum(map(len, polygons))
    if corners > MAX_OBSTACLE_CORNERS:
        raise fault(
            key,
            f"has {corners} corners in all, more than {MAX_OBSTACLE_CORNERS}; give each polygon "
            "fewer corners, or leave out those that change nothing",
        )


# --- the rest of a scenario -----------------------------------------------------------------------


MAX_LANDMARKS = 10_000
MAX_SAMPLES = 200_000
"""Most samples in a period, a window or a run."""

MAX_VEHICLE_SAMPLES = 20_000_000
"""Most samples times vehicles in a period, a window or a run."""

MAX_PERIODS = 20_000
"""Most periods in a window or a run."""

SAME_PLACE_M = 1e-6
"""Distance up to which landmarks, or centres of equal circles, count as the same."""

_NAMES_SHOWN = 12
_SLACK = 1e-9


def check_lengths(lists: Mapping[str, object], count: int) -> None:
    """Raise the fault if a value is a list without one value for each vehicle."""
    for key, value in lists.items():
        if isinstance(value, list) and len(value) != count:
            raise fault(key, f"has {len(value)} values for {count} vehicles; give one each")


def check_names(vehicles: Sequence[str], landmarks: Sequence[str]) -> None:
    """Raise the fault if a name occurs twice among vehicles and landmarks."""
    seen: set[str] = set()
    named = [("formation.names", name) for name in vehicles]
    named += [("landmarks_m", name) for name in landmarks]
    for key, name in named:
        if name in seen:
            raise fault(key, "is used twice among vehicles and landmarks; rename one of them", name)
        seen.add(name)


def check_samples(
    sample_times: Iterable[float], durations: Mapping[str, float], period: float, count: int
) -> None:
    """Raise the fault if sensors differ in sample time, or a duration holds too many samples.

    `durations` are in s, by key; `period` is in s; `count` is the number of vehicles.
    """
    times = sorted(set(sample_times))
    if len(times) > 1:
        raise fault(
            "sensor",
            f"has sample times {', '.join(f'{t:g}' for t in times)} s: the central filter needs "
            "one common sample_time_s",
        )
    for key, value in {"orbit": period, **durations}.items():
        problem = excess(value, times[0], period, count)
        if problem:
            raise fault(key, f"a period of {problem}" if key == "orbit" else problem)
    if durations["duration_s"] < times[0]:
        raise fault("duration_s", f"must be at least sample_time_s, {times[0]:g} s")


def excess(duration: float, sample_time: float, period: float, count: int) -> str:
    """Return why `duration` s is too long for `count` vehicles; empty if it is not."""
    most = min(MAX_SAMPLES, MAX_VEHICLE_SAMPLES // count)
    if duration / sample_time > most:
        return (
            f"{duration:g} s at a sample time of {sample_time:g} s makes more than {most} samples "
            f"for {count} vehicles; shorten it or sample less often"
        )
    if duration / period > MAX_PERIODS:
        return f"{duration:g} s holds more than {MAX_PERIODS} periods of {period:g} s; shorten it"
    return ""


def check_extent(key: str, places: Iterable[Point]) -> None:
    """Raise the fault if a place has a coordinate beyond FURTHEST_M."""
    furthest = max((abs(value) for place in places for value in place), default=0.0)
    if furthest > FURTHEST_M:
        raise fault(key, f"puts a coordinate at {furthest:g} m; allowed are up to {FURTHEST_M:g} m")


def check_landmarks(names: Sequence[str], places: Sequence[Point]) -> None:
    """Raise the fault if there are too many landmarks, or two at one place."""
    if len(places) > MAX_LANDMARKS:
        raise fault("landmarks_m", f"has {len(places)} landmarks, more than {MAX_LANDMARKS}")
    for a, b in _near_pairs(places):
        raise fault(
            "landmarks_m",
            f"{names[a]} and {names[b]} are at the same place; remove one of them",
            list(places[a]),
        )


def check_limits(
    limits: Limits,
    refine: RefineOptions | None,
    rate: float,
    radii: Sequence[float],
    names: Sequence[str],
) -> None:
    """Raise the fault if the circles exceed the vehicles' limits, however they are refined."""
    if limits.turn_rate_rad_s is not None and rate > limits.turn_rate_rad_s * (1.0 + _SLACK):
        raise fault(
            "limits.turn_rate_rad_s",
            f"{limits.turn_rate_rad_s:g}: the orbits turn at {rate:g} rad/s; lower their rate",
        )
    if limits.speed_mps is None:
        return
    least, most = limits.speed_mps
    if refine is not None and refine.radius_m is not None:
        slowest, fastest = (rate * radius for radius in refine.radius_m)
        if slowest > most * (1.0 + _SLACK) or fastest < least * (1.0 - _SLACK):
            raise fault(
                "refine.radius_m",
                f"radii of {refine.radius_m[0]:g} to {refine.radius_m[1]:g} m at {rate:g} rad/s "
                f"mean {slowest:g} to {fastest:g} m/s; limits.speed_mps allows {least:g} to "
                f"{most:g}",
            )
        return
    for name, radius in zip(names, radii, strict=True):
        if not least * (1.0 - _SLACK) <= rate * radius <= most * (1.0 + _SLACK):
            raise fault(
                "limits.speed_mps",
                f"{name} flies {rate * radius:g} m/s on its circle of {radius:g} m; allowed are "
                f"{least:g} to {most:g}: change its radius, or let refine vary radii",
            )


def check_link_names(links: Sequence[Pair], names: Sequence[str]) -> None:
    """Raise the fault if a listed link does not name two vehicles, or is listed twice."""
    known = set(names)
    seen: set[frozenset[str]] = set()
    for k, (a, b) in enumerate(links):
        key = f"formation.links[{k}]"
        for name in (a, b):
            if name not in known:
                raise fault(
                    key,
                    f"link {a}-{b}: no vehicle is named {name}; vehicles are {_listed(names)}",
                )
        if a == b:
            raise fault(key, f"link {a}-{b}: a vehicle can't be linked to itself")
        if frozenset((a, b)) in seen:
            raise fault(key, f"link {a}-{b}: is listed twice; remove one of them")
        seen.add(frozenset((a, b)))


def check_links(
    links: Sequence[Pair],
    names: Sequence[str],
    centers: Sequence[Point],
    radii: Sequence[float],
    ranges: Sequence[float],
) -> None:
    """Raise the fault if the circles of a listed link never come within range."""
    index = {name: k for k, name in enumerate(names)}
    for k, (a, b) in enumerate(links):
        i, j = index[a], index[b]
        distance = math.dist(centers[i], centers[j])
        gap = max(distance - radii[i] - radii[j], abs(radii[i] - radii[j]) - distance, 0.0)
        reach = max(ranges[i], ranges[j])
        if gap > reach * (1.0 + 1e-12):
            raise fault(
                f"formation.links[{k}]",
                f"link {a}-{b}: the circles come no nearer than {gap:g} m, out of the sensors' "
                f"range of {reach:g} m; bring the centres nearer, raise range_m, or remove the "
                "link",
            )


def check_shared_circles(
    senses: Sequence[str], names: Sequence[str], centers: Sequence[Point], radii: Sequence[float]
) -> None:
    """Raise the fault if two vehicles turn opposite ways on one circle."""
    for a, b in _near_pairs(centers):
        if abs(radii[a] - radii[b]) <= SAME_PLACE_M and senses[a] != senses[b]:
            raise fault(
                "orbit.direction",
                f"{names[a]} ({senses[a]}) and {names[b]} ({senses[b]}) turn opposite ways on one "
                "circle and would collide; give them the same sense or another centre",
                list(senses),
            )


def _near_pairs(places: Sequence[Point]) -> Iterator[tuple[int, int]]:
    """Pairs of places no further apart than SAME_PLACE_M, which lie in neighbouring cells."""
    order = sorted(range(len(places)), key=lambda k: places[k])
    cells: dict[tuple[int, int], list[int]] = {}
    cell_of = [(math.floor(x / SAME_PLACE_M), math.floor(y / SAME_PLACE_M)) for x, y in places]
    for position, a in enumerate(order):
        cells.setdefault(cell_of[a], []).append(position)
    for position, a in enumerate(order):
        x, y = cell_of[a]
        around = [(x + east, y + north) for east in (-1, 0, 1) for north in (-1, 0, 1)]
        near = [p for cell in around for p in cells.get(cell, ()) if p > position]
        for b in (order[p] for p in sorted(near)):
            if math.dist(places[a], places[b]) <= SAME_PLACE_M:
                yield (a, b) if a < b else (b, a)


def _listed(names: Sequence[str]) -> str:
    if len(names) > 3 and list(names) == [f"v{k + 1}" for k in range(len(names))]:
        return f"{names[0]}..{names[-1]}"
    rest = ", ..." if len(names) > _NAMES_SHOWN else ""
    return ", ".join(names[:_NAMES_SHOWN]) + rest
