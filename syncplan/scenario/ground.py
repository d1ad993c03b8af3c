"""The plane of a scenario on the Earth: metres from its origin, and degrees on the ground.

The plane touches the ellipsoid (WGS 84) at the origin. A place of it stands for the ground along
the ellipsoid's normal, as vehicles fly at constant altitudes. What is d from the origin in it
is d^3 / 3 R^2 nearer on the ground: 8 mm at 10 km.

          plane   o-----------+--------- d
                   \\          |
          ground     \\________|__________
"""

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.scenario.models import GeoOrigin

WIDEST_M = 1e6
"""Largest distance from the origin at which a plane may represent the ground."""

SEMI_MAJOR_M, FLATTENING = 6378137.0, 1.0 / 298.257223563
"""Of the ellipsoid of WGS 84."""

ORIGIN_DIGITS = 7
"""Decimals of degrees of an origin that is not given: a centimetre."""

DEGREE_DIGITS = 9
"""Decimals of degrees that are written: a tenth of a millimetre."""

_HIGH_M = 1e5
"""Height in m of the second point on a normal, which gives its direction."""


def lat_lon_of(origin: GeoOrigin, points: Array) -> Array:
    """Return the (..., 2) latitudes and longitudes in degrees of (..., 2) points in m.

    Raises InputError where a point is further than 1,000 km from the origin.
    """
    from pymap3d import enu2geodetic

    check_near(float(np.max(np.hypot(points[..., 0], points[..., 1]), initial=0.0)))
    east, north = points[..., 0], points[..., 1]
    places = enu2geodetic(east, north, np.zeros_like(east), origin.lat_deg, origin.lon_deg, 0.0)
    return np.stack(places[:2], axis=-1)


def points_of(origin: GeoOrigin, places: Array) -> Array:
    """Return the (..., 2) points in m of (..., 2) latitudes and longitudes: inverse of lat_lon_of.

    Points of the other half of the Earth, which no point of the plane stands for, are NaN.
    """
    from pymap3d import geodetic2enu

    latitudes, longitudes = places[..., 0], places[..., 1]
    low, high = (
        np.stack(geodetic2enu(latitudes, longitudes, height, origin.lat_deg, origin.lon_deg, 0.0))
        for height in (0.0, _HIGH_M)
    )
    # the normal meets the plane where its height above it is 0
    rise = (high - low)[2]
    share = np.where(rise > 0.0, -low[2], np.nan) / np.where(rise > 0.0, rise, 1.0)
    return np.asarray(np.moveaxis(low + share * (high - low), 0, -1)[..., :2])


def check_near(distance: float) -> None:
    """Raise InputError if a place is too far from the origin for the plane, or NaN."""
    if not distance <= WIDEST_M:
        raise InputError(
            f"a point lies {distance / 1000.0:.4g} km from it, where the plane is no ground any "
            f"more; it must be within {WIDEST_M / 1000.0:g} km",
            key="geo_origin",
        )


def middle_of(places: Array) -> GeoOrigin:
    """Return the middle of (k, 2) latitudes and longitudes: that of their extent in the plane.

    The plane touches the Earth below the mean of their directions, so neither poles nor the
    antimeridian matter.
    """
    latitudes, longitudes = np.radians(places).T
    upright = np.cos(latitudes)
    x, y = np.mean(upright * np.cos(longitudes)), np.mean(upright * np.sin(longitudes))
    mean = np.degrees([np.arctan2(np.mean(np.sin(latitudes)), np.hypot(x, y)), np.arctan2(y, x)])
    about = GeoOrigin(lat_deg=float(mean[0]), lon_deg=float(mean[1]))
    points = points_of(about, places)
    check_near(float(np.max(np.hypot(*points.T))))
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    latitude, longitude = np.round(lat_lon_of(about, middle), ORIGIN_DIGITS).tolist()
    return GeoOrigin(lat_deg=latitude, lon_deg=longitude)


def rings_of(origin: GeoOrigin, corners: Array) -> list[Array]:
    """Return the closed rings in degrees of a polygon (k, 2) m of the plane, counter-clockwise.

    There is one, or one for each part on either side of the antimeridian (RFC 7946, section 3.1).
    Raises InputError for a polygon that holds a pole.
    """
    import shapely
    from pymap3d import enu2ecef

    # an edge meets the antimeridian where y of the Earth is 0 and x is negative
    ring = np.concatenate([corners, corners[:1]])
    x, y, _ = enu2ecef(*ring.T, np.zeros(len(ring)), origin.lat_deg, origin.lon_deg, 0.0)
    cut = np.flatnonzero(y[:-1] * y[1:] < 0.0)
    share = y[cut] / (y[cut] - y[cut + 1])
    away = x[cut] + share * (x[cut + 1] - x[cut]) < 0.0
    cut, share = cut[away], share[away, None]
    ring = np.insert(ring, cut + 1, (1.0 - share) * ring[cut] + share * ring[cut + 1], axis=0)
    # longitudes go on beyond 180 degrees
    onward = lat_lon_of(origin, ring)[:, ::-1]
    onward[cut + 1 + np.arange(len(cut)), 0] = 180.0
    onward[:, 0] = np.unwrap(onward[:, 0], period=360.0)
    if abs(onward[-1, 0] - onward[0, 0]) > 180.0:
        raise InputError(
            "a polygon holds a pole, which maps in degrees can't show; take qgc or csv"
        )
    whole, rings = shapely.Polygon(onward), []
    for turn in (-360.0, 0.0, 360.0):
        world = shapely.box(turn - 180.0, -90.0, turn + 180.0, 90.0)
        for part in shapely.get_parts(shapely.orient_polygons(shapely.intersection(whole, world))):
            if part.area > 0.0:
                part_ring = shapely.get_coordinates(part.exterior) - [turn, 0.0]
                rings.append(part_ring[:, ::-1])
    return rings


def map_departure(origin: GeoOrigin, points: Array) -> float:
    """Return the largest difference in m of a distance on the map and on the ground.

    It is that of any two of the points (k, 2) m of the plane, and of any two within their hull. The
    ground is a sphere of the ellipsoid's mean curvature at the origin: good to a per cent.
    """
    import shapely

    corners = shapely.get_coordinates(shapely.convex_hull(shapely.MultiPoint(points)))
    squared = FLATTENING * (2.0 - FLATTENING)
    curved = 1.0 - squared * np.sin(np.radians(origin.lat_deg)) ** 2
    radius = SEMI_MAJOR_M * np.sqrt(1.0 - squared) / curved
    x, y = corners.T
    apart = np.hypot(x[:, None] - x, y[:, None] - y)
    # the angle between two directions from the centre, by its tangent
    across = np.hypot(x[:, None] * y - y[:, None] * x, radius * apart)
    along = x[:, None] * x + y[:, None] * y + radius**2
    return float(np.max(np.abs(apart - radius * np.arctan2(across, along)), initial=0.0))
