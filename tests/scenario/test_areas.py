"""Where circles may lie, against points sampled along their paths."""

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import example as known
from hypothesis import strategies as st

from syncplan.arrays import Array
from syncplan.scenario.areas import Area
from tests.tools.planted_briefs import draw_planted

# lengths to the millimetre: closer corners make shapely divide by zero
COORDINATES = st.integers(-60_000, 60_000).map(lambda mm: mm / 1000.0)
CORNERS = st.lists(st.tuples(COORDINATES, COORDINATES), min_size=3, max_size=7)
RADII = st.integers(2_000, 40_000).map(lambda mm: mm / 1000.0)
PLACES = st.tuples(COORDINATES, COORDINATES)

INNER = [(-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)]
SAMPLES = 2000
ALL_ROUND = np.array([[-200.0, -200.0], [200.0, -200.0], [200.0, 200.0], [-200.0, 200.0]])
ARC_ERROR = 1e-3


def hull_of(corners: Any) -> Array:
    """Corners of the convex hull; assumes that it is no sliver."""
    hull = shapely.MultiPoint(corners).convex_hull
    assume(hull.geom_type == "Polygon" and hull.area >= 1.0)
    return np.array(hull.exterior.coords)[:-1]


def path(center: Any, radius: float) -> Array:
    """(2, SAMPLES) points along a circle."""
    angle = np.linspace(0.0, 2.0 * np.pi, SAMPLES, endpoint=False)
    return np.reshape(center, (2, 1)) + radius * np.array([np.cos(angle), np.sin(angle)])


def crosses(polygon: Array, center: Any, radius: float) -> bool:
    """Whether any of many points on the path is inside the polygon: one that touches it is not."""
    return bool(shapely.contains_xy(shapely.Polygon(polygon), *path(center, radius)).any())


@given(CORNERS, PLACES, RADII)
@known(INNER, (0.0, 0.0), 20.0)
@known([(10.0, -5.0), (30.0, -5.0), (30.0, 5.0), (10.0, 5.0)], (0.0, 0.0), 20.0)
def test_a_path_is_clear_of_a_polygon_by_what_its_points_are(
    corners: Any, center: Any, radius: float
) -> None:
    polygon = hull_of(corners)
    points = shapely.points(path(center, radius).T)
    sampled = float(shapely.distance(points, shapely.Polygon(polygon)).min())
    ((clear,),) = Area(None, (polygon,)).path_clearances(np.array([center]), np.array([radius]))
    # between two samples a path comes nearer by less than half an arc
    slack = radius * np.pi / SAMPLES
    if clear > 0.0:
        assert clear - 1e-9 <= sampled <= clear + slack
    else:
        assert sampled <= slack


@given(CORNERS, PLACES, RADII)
@known(INNER, (0.0, 0.0), 20.0)
@known(INNER, (20.0, 0.0), 20.0)
def test_a_disc_clears_a_keep_out_where_its_path_does_and_it_does_not_go_round_it(
    corners: Any, center: Any, radius: float
) -> None:
    polygon = hull_of(corners)
    area = Area(None, (polygon,))
    centers, radii = np.array([center]), np.array([radius])
    disc, ((clear,),) = area.clearances(centers, radii)[0], area.path_clearances(centers, radii)
    (round_it,) = area.goes_round(0, centers, radii)
    if clear <= 0.0:
        assert disc <= 0.0
    elif round_it:
        assert disc < 0.0
        assert np.all(np.hypot(*(polygon - center).T) < radius)
    else:
        assert disc == clear


@given(CORNERS, PLACES, RADII)
@known(INNER, (0.0, 0.0), 20.0)
@known(INNER, (14.0, 0.0), 20.0)
@known(INNER, (18.0, 0.0), 20.0)
# arcs at corners that hardly turn have chords of up to 1.5 segments
@known([(-0.314, -0.359), (-6.736, -1.819), (-19.261, -5.154)], (-6.736, -1.819), 2.0)
# the path touches a corner
@known([(0.0, 0.0), (0.0, 0.056), (-35.715, 0.0)], (2.0, 0.0), 2.0)
def test_the_nearest_clear_centre_is_clear_and_none_is_nearer(
    corners: Any, center: Any, radius: float
) -> None:
    polygon = hull_of(corners)
    area = Area(ALL_ROUND, (polygon,))
    moved = area.nearest_clear(np.array([center]), np.array([radius]), paths=True)
    assert moved is not None
    assert not crosses(polygon, moved[0], radius)
    assert area.path_clearances(moved, np.array([radius])).min() >= 0.0
    # no smaller step leads to a centre that is clear by more than what arcs are off
    away = float(np.hypot(*(moved[0] - center)))
    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    for share in (0.0, 0.3, 0.7, 0.97) if away > 0.0 else ():
        tried = center + share * away * np.column_stack([np.cos(angle), np.sin(angle)])
        clear = area.path_clearances(tried, np.full(len(tried), radius)).min(axis=0)
        assert clear.max() < ARC_ERROR * radius


@given(CORNERS, PLACES, RADII, st.integers(0, 10_000).map(lambda mm: mm / 1000.0))
@known(INNER, (0.0, 0.0), 20.0, 1.0)
def test_room_is_found_wherever_a_clear_centre_is(
    corners: Any, center: Any, radius: float, box: float
) -> None:
    polygon = hull_of(corners)
    area = Area(ALL_ROUND, (polygon,))
    steps = np.linspace(-box, box, 9)
    tried = center + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    clear = area.path_clearances(tried, np.full(len(tried), radius)).min(axis=0)
    lower, upper = np.array(center) - box, np.array(center) + box
    has_room = area.has_room((radius, radius), lower, upper)
    if clear.max() >= 0.0:
        assert has_room
    elif clear.max() < -0.18 * box - ARC_ERROR * radius:
        # each centre is within an eighth of the box, each way, of one that was tried
        assert not has_room


def test_a_disc_that_fits_nowhere_may_have_room_round_a_keep_out() -> None:
    strip = np.array([[-22.0, -22.0], [22.0, -22.0], [22.0, 22.0], [-22.0, 22.0]])
    area = Area(strip, (np.array(INNER),))
    centers, radii = np.array([[1.0, 1.5]]), np.array([20.0])
    assert area.nearest_clear(centers, radii) is None
    np.testing.assert_array_equal(area.nearest_clear(centers, radii, paths=True), centers)
    assert area.has_room((20.0, 20.0), centers[0] - 1.0, centers[0] + 1.0)
    assert not area.has_room((6.0, 6.0), centers[0] - 1.0, centers[0] + 1.0)


@pytest.mark.parametrize("number", [272, 980])
def test_the_largest_circle_of_an_area_with_shallow_corners_has_room(number: int) -> None:
    planted = draw_planted(np.random.default_rng(number), edge=True)
    area = Area.of(planted.brief.area_m, planted.brief.keep_out_m)
    radius = planted.radius
    assert area.path_clearances(planted.centers[:1], np.array([radius])).min() >= -1e-9
    assert area.has_room((radius, radius), *area.corners)
    assert not area.has_room((1.01 * radius, 1.01 * radius), *area.corners)


@pytest.mark.parametrize("grown", [-4.9, -2.0, -1e-6, 0.0, 1e-6, 3.0, 500.0])
def test_the_most_that_a_grown_rectangle_measures_is_hardly_more_than_it_does(grown: float) -> None:
    area = Area(np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 10.0], [0.0, 10.0]]))
    exact = (20.0 + 2.0 * grown) * (10.0 + 2.0 * grown)
    if grown > 0.0:
        exact -= (4.0 - np.pi) * grown**2
    assert exact * (1.0 - 1e-12) <= area.most_size(grown) <= exact * (1.0 + 1e-3)
