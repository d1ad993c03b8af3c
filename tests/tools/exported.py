"""What tests of exports share: a team on Earth, and the way back from its places to the plane."""

import json
from functools import cache
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.exporting.formats import Export, ExportOptions
from syncplan.planning.plans import Plan
from tests.tools.on_paper import plan
from tests.tools.scenarios import small

__all__ = ["FORCED", "ORIGIN", "contents", "mixed_team", "sidecar_of", "team", "to_plane"]


ORIGIN = {"lat_deg": 47.3977, "lon_deg": 8.5456, "alt_m": 488.0}
FORCED = ExportOptions(force=True)
START = "2026-05-01T11:00:00.25+02:00"

SEMI_MAJOR, FLATTENING = 6378137.0, 1.0 / 298.257223563
"""WGS 84."""


def team(**changes: Any) -> Plan:
    """Return the plan of three vehicles with different senses and radii, on Earth and dated."""
    values: dict[str, Any] = {
        "name": "team",
        "orbit": {
            "radius_m": [20.0, 30.0, 25.0],
            "angular_rate_rad_s": 0.2,
            "direction": ["ccw", "cw", "ccw"],
            "first_phase_rad": 0.3,
        },
        "formation": {"centers_m": {"left": [-40, 10], "mid": [30, 0], "far out": [90, 40]}},
        "landmarks_m": {"mast": [30, 60], "tower": [-40, 60]},
        "duration_s": 100.0,
        "geo_origin": ORIGIN,
        "start_time": START,
    }
    return plan(small(**{**values, **changes}), bound="never")


@cache
def mixed_team() -> Plan:
    """Return the plan of `team()`, made once."""
    return team()


def contents(made: Export, ending: str) -> dict[str, bytes]:
    """Return the bytes of the files whose names have this ending, by name."""
    return {file.name: file.content for file in made.files if file.name.endswith(ending)}


def sidecar_of(made: Export) -> dict[str, Any]:
    """Return the sidecar of a format."""
    (text,) = contents(made, ".sync.json").values()
    found: dict[str, Any] = json.loads(text)
    return found


def to_plane(places: Any, origin: dict[str, float] = ORIGIN) -> Array:
    """Return (..., 2) east and north in m of (..., 2) latitudes and longitudes in degrees.

    By Earth-centred coordinates in closed form, apart from pymap3d.
    """
    at = np.radians([origin["lat_deg"], origin["lon_deg"]])
    places = np.radians(np.asarray(places, dtype=float))
    offset = _earth_centred(places) - _earth_centred(at)
    (sin_lat, sin_lon), (cos_lat, cos_lon) = np.sin(at), np.cos(at)
    east = np.array([-sin_lon, cos_lon, 0.0])
    north = np.array([-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat])
    return np.stack([offset @ east, offset @ north], axis=-1)


def _earth_centred(places: Array) -> Array:
    latitude, longitude = places[..., 0], places[..., 1]
    eccentricity = FLATTENING * (2.0 - FLATTENING)
    curvature = SEMI_MAJOR / np.sqrt(1.0 - eccentricity * np.sin(latitude) ** 2)
    out, up = curvature * np.cos(latitude), curvature * (1.0 - eccentricity) * np.sin(latitude)
    return np.stack([out * np.cos(longitude), out * np.sin(longitude), up], axis=-1)
