"""The plane on the Earth, beside geodesics by geographiclib."""

import numpy as np
import pytest
import shapely
from geographiclib.geodesic import Geodesic
from hypothesis import given
from hypothesis import strategies as st

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.scenario.ground import lat_lon_of, map_departure, middle_of, points_of, rings_of
from syncplan.scenario.models import GeoOrigin

EARTH = Geodesic.WGS84
ORIGINS = [
    GeoOrigin(lat_deg=47.4, lon_deg=8.5),
    GeoOrigin(lat_deg=89.9, lon_deg=-120.0),
    GeoOrigin(lat_deg=0.2, lon_deg=179.999),
    GeoOrigin(lat_deg=-54.8, lon_deg=-68.3),
]


def scattered(seed: int, size: float, count: int = 40) -> Array:
    """Points (count, 2) m within a square."""
    return np.random.default_rng(seed).uniform(-0.5 * size, 0.5 * size, (count, 2))


def curvature(origin: GeoOrigin, azimuth: float) -> float:
    """Radius in m of the ellipsoid along an azimuth, by Euler's theorem."""
    squared = EARTH.f * (2.0 - EARTH.f)
    curved = 1.0 - squared * np.sin(np.radians(origin.lat_deg)) ** 2
    across = EARTH.a / np.sqrt(curved)
    along = across * (1.0 - squared) / curved
    return float(1.0 / (np.cos(azimuth) ** 2 / along + np.sin(azimuth) ** 2 / across))


def apart(place: Array, other: Array) -> float:
    """Length in m of the geodesic between two places."""
    return float(EARTH.Inverse(*place, *other, Geodesic.DISTANCE)["s12"])


@pytest.mark.parametrize("origin", ORIGINS, ids=str)
def test_places_of_ten_kilometres_are_those_of_geodesics_to_a_millimetre(origin: GeoOrigin) -> None:
    for point in scattered(1, 10e3):
        azimuth, distance = np.arctan2(*point), np.hypot(*point)
        radius = curvature(origin, azimuth)
        # the plane touches at the origin: a distance d in it is above the arc R atan(d / R)
        arc = radius * np.arctan(distance / radius)
        end = EARTH.Direct(origin.lat_deg, origin.lon_deg, np.degrees(azimuth), arc)
        place = lat_lon_of(origin, point)
        assert apart(place, np.array([end["lat2"], end["lon2"]])) < 1e-3
        assert np.abs(points_of(origin, place) - point).max() < 1e-6


@pytest.mark.parametrize("origin", ORIGINS, ids=str)
@pytest.mark.parametrize("size", [1e3, 10e3, 60e3])
def test_the_departure_of_the_map_is_the_largest_beside_geodesics(
    origin: GeoOrigin, size: float
) -> None:
    points = scattered(2, size)
    places = lat_lon_of(origin, points)
    largest = max(
        abs(np.hypot(*(points[a] - points[b])) - apart(places[a], places[b]))
        for a in range(len(points))
        for b in range(a)
    )
    # geodesics are good to some nanometres
    assert map_departure(origin, points) == pytest.approx(largest, rel=0.02, abs=2e-8)


@given(
    st.floats(-90.0, 90.0),
    st.floats(-180.0, 180.0),
    st.tuples(st.floats(-1e5, 1e5), st.floats(-1e5, 1e5)),
)
def test_degrees_and_metres_are_inverse_anywhere(
    latitude: float, longitude: float, point: tuple[float, float]
) -> None:
    origin = GeoOrigin(lat_deg=latitude, lon_deg=longitude)
    again = points_of(origin, lat_lon_of(origin, np.array(point)))
    assert np.abs(again - point).max() < 1e-6


def test_what_lies_on_the_other_half_of_the_earth_has_no_point() -> None:
    origin = GeoOrigin(lat_deg=47.0, lon_deg=8.0)
    assert np.isnan(points_of(origin, np.array([[-47.0, -172.0]]))).all()


@pytest.mark.parametrize("origin", ORIGINS, ids=str)
def test_the_middle_of_places_is_that_of_their_extent(origin: GeoOrigin) -> None:
    # three corners of four: the mean of the corners is not the middle
    corners = np.array([[-900.0, -400.0], [900.0, -400.0], [900.0, 400.0]])
    places = lat_lon_of(origin, corners)
    points = points_of(middle_of(places), places)
    # axes turn from place to place, most of all near a pole
    assert np.abs(points.min(axis=0) + points.max(axis=0)).max() < 60.0


def test_places_on_two_sides_of_the_earth_have_no_middle() -> None:
    with pytest.raises(InputError, match="no ground"):
        middle_of(np.array([[47.0, 8.0], [-40.0, -150.0]]))


@pytest.mark.parametrize("latitude", [-10.0, 60.0, 89.9])
def test_a_ring_is_cut_at_the_antimeridian_on_its_very_edges(latitude: float) -> None:
    origin = GeoOrigin(lat_deg=latitude, lon_deg=179.99)
    clockwise = 5000.0 * np.array([[-1.0, -1.0], [-0.8, 1.0], [1.0, 0.9], [0.7, -1.1]])
    west, east = sorted(rings_of(origin, clockwise), key=lambda ring: -ring[:, 1].max())
    assert west[:, 1].max() == 180.0
    assert west[:, 1].min() > 0.0
    assert east[:, 1].min() == -180.0
    assert east[:, 1].max() < 0.0
    parts = []
    for ring in (west, east):
        assert np.array_equal(ring[0], ring[-1])
        parts.append(shapely.Polygon(points_of(origin, ring)))
        assert shapely.is_ccw(parts[-1].exterior)
    whole = shapely.Polygon(clockwise)
    assert sum(part.area for part in parts) == pytest.approx(whole.area, rel=1e-9)
    assert shapely.hausdorff_distance(shapely.union_all(parts, grid_size=1e-4), whole) < 1e-3


def test_a_ring_elsewhere_is_whole_and_one_about_a_pole_is_refused() -> None:
    square = 500.0 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    for longitude in (0.0, 8.5):
        (ring,) = rings_of(GeoOrigin(lat_deg=47.4, lon_deg=longitude), square)
        assert len(ring) == 5
    with pytest.raises(InputError, match="holds a pole"):
        rings_of(GeoOrigin(lat_deg=-89.999, lon_deg=20.0), square)
