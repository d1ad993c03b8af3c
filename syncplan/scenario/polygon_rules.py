"""Rules for the polygons of a scenario; each raises the fault that names the key to mend."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import BeforeValidator

from syncplan.scenario.areas import polygon_fault
from syncplan.scenario.chunked_validation import Many
from syncplan.scenario.quantities import Point, Polygon, fault

MAX_OBSTACLE_CORNERS = 1000
"""Most corners of all obstacles together: each is looked at for every pair that it may hide."""


def _not_one_alone(value: Any) -> Any:
    """Raise the fault if what should be a list of polygons is one of them."""
    corner = value[0] if isinstance(value, list | tuple) and value else None
    if isinstance(corner, list | tuple) and corner and isinstance(corner[0], int | float):
        raise fault("", "is one polygon; give a list of polygons, as [[[x, y], [x, y], [x, y]]]")
    return value


Polygons = Annotated[Many[Polygon], BeforeValidator(_not_one_alone)]


def check_polygons(polygons: Mapping[str, Sequence[Point]]) -> None:
    """Raise the fault if the corners under a key make no polygon."""
    for key, corners in polygons.items():
        problem = polygon_fault(corners)
        if problem:
            raise fault(key, problem)


def check_obstacles(obstacles: Sequence[Sequence[Point]]) -> None:
    """Raise the fault if obstacles have more corners than contact windows can be found among."""
    corners = sum(map(len, obstacles))
    if corners > MAX_OBSTACLE_CORNERS:
        raise fault(
            "obstacles_m",
            f"has {corners} corners in all, more than {MAX_OBSTACLE_CORNERS}; give each obstacle "
            "fewer corners, or leave out those that stand between no circles",
        )
