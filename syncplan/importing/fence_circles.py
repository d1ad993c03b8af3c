"""Circular fences as polygons: within the circle where vehicles stay inside, else around it."""

from typing import Any

import numpy as np

from syncplan.importing.features import FeatureList, Section
from syncplan.orbits.circles import unit
from syncplan.scenario.ground import WIDEST_M, lat_lon_of
from syncplan.scenario.models import GeoOrigin

CORNERS = 48


def add_circle(into: FeatureList, name: str, center: Any, radius: Any, section: Section) -> None:
    """Add a circle about a latitude and longitude, with a radius in m."""
    try:
        latitude, longitude, size = float(center[0]), float(center[1]), float(radius)
    except (TypeError, ValueError, IndexError):
        raise into.fault(name, "is a circle without a center and a radius") from None
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and 0.0 < size < WIDEST_M):
        raise into.fault(
            name, f"is no circle on the Earth: {size:g} m about {latitude:g}, {longitude:g}"
        )
    # corners on the circle lie within it; edges that touch it lie around it
    reach = size if section == "area" else size / np.cos(np.pi / CORNERS)
    points = reach * unit(2.0 * np.pi / CORNERS * np.arange(CORNERS))
    places = lat_lon_of(GeoOrigin(lat_deg=latitude, lon_deg=longitude), points)
    into.add("polygon", name, [places[:, ::-1].tolist()], section=section)
