"""Placement: drawings of link graphs, shapes by their gap, and reasons where there is none."""

import itertools
import math
from typing import Any

import numpy as np
import pytest

from syncplan.areas import Area
from syncplan.errors import InputError, NoSolutionError
from syncplan.formation import gap_centers, neighbours, shape_centers
from syncplan.loading import scenario_from
from syncplan.placement import MARGIN_SHARE, Placement, place
from syncplan.planner import plan
from syncplan.scenario import Scenario
from tests.scenarios import document, small

Edges = list[tuple[int, int]]


def path(count: int) -> Edges:
    return [(k, k + 1) for k in range(count - 1)]


def ring(count: int) -> Edges:
    return [*path(count), (0, count - 1)]


def star(leaves: int) -> Edges:
    return [(0, k + 1) for k in range(leaves)]


def shape_edges(shape: str, count: int, columns: int) -> Edges:
    return [(int(a), int(b)) for a, b in neighbours(shape, count, columns)]


def tree(count: int, seed: int, degree: int = 4) -> Edges:
    """A random tree in which no vertex has more than `degree` neighbours."""
    generator = np.random.default_rng(seed)
    free = {0: degree}
    edges = []
    for new in range(1, count):
        old = int(generator.choice([v for v, left in free.items() if left]))
        free[old] -= 1
        free[new] = degree - 1
        edges.append((old, new))
    return edges


def linked(edges: Edges, radius: Any = 20.0, sensed: float = 50.0, **changes: Any) -> Scenario:
    links = [[f"v{a + 1}", f"v{b + 1}"] for a, b in edges]
    return small(
        orbit={"radius_m": radius, "angular_rate_rad_s": 0.2},
        formation={"links": links, **changes.pop("formation", {})},
        sensor={"range_m": sensed, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
        **changes,
    )


def every_gap(placement: Placement) -> dict[tuple[int, int], float]:
    """Gap of each pair of circles, from the scenario as a user would read it."""
    centers = placement.scenario.centers
    radius = placement.scenario.orbit.radius_m
    radii = radius if isinstance(radius, list) else [radius] * len(centers)
    return {
        (a, b): math.dist(centers[a], centers[b]) - radii[a] - radii[b]
        for a, b in itertools.combinations(range(len(centers)), 2)
    }


def assert_drawn(placement: Placement, edges: Edges, sensed: float) -> None:
    gaps = every_gap(placement)
    assert max(gaps[tuple(sorted(edge))] for edge in edges) <= sensed * (1.0 - MARGIN_SHARE)
    assert min(gaps.values()) >= 0.01 * sensed
    assert placement.smallest_gap == pytest.approx(min(gaps.values()), abs=1e-9)
    expected = [gaps[int(a), int(b)] for a, b in placement.links]
    np.testing.assert_allclose(placement.gaps, expected, atol=1e-9)


GRAPHS = {
    "pair": path(2),
    "path": path(9),
    **{f"ring of {count}": ring(count) for count in (3, 4, 5, 7, 12)},
    "grid 3 x 3": shape_edges("grid", 9, 3),
    "grid 6 x 6": shape_edges("grid", 36, 6),
    "hex patch": shape_edges("hex", 14, 4),
    "star of 5": star(5),
    "star of 6": star(6),
    **{f"tree {seed}": tree(20, seed) for seed in range(2)},
}


@pytest.mark.parametrize("name", GRAPHS)
def test_a_graph_that_can_be_drawn_is_drawn(name: str) -> None:
    assert_drawn(place(linked(GRAPHS[name])), GRAPHS[name], 50.0)


@pytest.mark.parametrize("name", ["ring of 12", "grid 3 x 3", "hex patch", "star of 6", "tree 0"])
def test_a_graph_is_drawn_where_circles_are_large_and_the_range_is_short(name: str) -> None:
    placement = place(linked(GRAPHS[name], radius=50.0, sensed=10.0))
    assert_drawn(placement, GRAPHS[name], 10.0)
