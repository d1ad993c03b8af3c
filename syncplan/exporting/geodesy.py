"""Places on Earth of points of the plane, which touches the WGS 84 ellipsoid at its origin."""

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.scenario.models import GeoOrigin

EARTH_RADIUS_M = 6.371e6
WIDEST_M = 1e6
"""Furthest from the origin that a plane may stand for the ground."""


def geodetic(origin: GeoOrigin, points: Array) -> Array:
    """Return the (..., 2) latitudes and longitudes in degrees of (..., 2) points in m.

    The points lie in the plane that touches the ellipsoid at the origin; their geodetic height is
    left out, because what is flown is a constant altitude. Raises InputError where pymap3d is
    missing, or a point is further than 1,000 km from the origin.
    """
    try:
        from pymap3d import enu2geodetic
    except ImportError as error:
        raise InputError("needs pymap3d: pip install 'syncplan[export]'") from error
    far = float(np.max(np.hypot(points[..., 0], points[..., 1]), initial=0.0))
    if far > WIDEST_M:
        raise InputError(
            f"a point lies {far / 1000.0:.4g} km from it, where the plane is no ground any more; "
            f"it must be within {WIDEST_M / 1000.0:g} km",
            key="geo_origin",
        )
    latitude, longitude, _ = enu2geodetic(
        points[..., 0],
        points[..., 1],
        np.zeros_like(points[..., 0]),
        origin.lat_deg,
        origin.lon_deg,
        0.0,
    )
    return np.stack([latitude, longitude], axis=-1)


def ground_error(distance: float) -> float:
    """Return how far, in m, the plane and the ground differ `distance` m from the origin.

    A point of the plane at d lies over the ground at R atan(d / R), which is d^3 / 3 R^2 less.
    """
    return distance**3 / (3.0 * EARTH_RADIUS_M**2)
