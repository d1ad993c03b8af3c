"""Circles, centres, entry points and landmarks as GeoJSON (RFC 7946)."""

from typing import Any

from syncplan.arrays import Array
from syncplan.exporting.exported_files import ExportedFile, Written
from syncplan.exporting.map_tracks import landmark_places, parted, tracks_of
from syncplan.exporting.scheduled_plan import ScheduledPlan
from syncplan.runtime.files import as_text

DIGITS = 9
"""Of degrees: a tenth of a millimetre."""


def write_geojson(flown: ScheduledPlan) -> Written:
    """Return one FeatureCollection; a circle that crosses the antimeridian is cut in two there.

    Raises InputError without a geo_origin.
    """
    orbits = flown.plan.orbits
    features = []
    for k, track in enumerate(tracks_of(flown)):
        about = {
            "vehicle": track.name,
            "direction": "ccw" if orbits.senses[k] > 0.0 else "cw",
            "radius_m": float(orbits.radii[k]),
            "speed_mps": float(orbits.speeds[k]),
            "altitude_m": flown.altitudes[k],
        }
        features += [
            _feature(_line(track.circle), {"kind": "circle", **about}),
            _feature(_point(track.center), {"kind": "center", "vehicle": track.name}),
            _feature(_point(track.entry), {"kind": "entry", "vehicle": track.name, "time_s": 0.0}),
        ]
    for name, place in landmark_places(flown).items():
        features.append(_feature(_point(place), {"kind": "landmark", "landmark": name}))
    collection = {"type": "FeatureCollection", "features": features}
    name = f"{flown.title}.geojson"
    return Written(files=(ExportedFile(name, as_text(collection).encode()),))


def _feature(geometry: dict[str, Any], properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _point(place: Array) -> dict[str, Any]:
    return {"type": "Point", "coordinates": _coordinates(float(place[0]), float(place[1]))}


def _line(places: Array) -> dict[str, Any]:
    parts = [[_coordinates(*place) for place in part.tolist()] for part in parted(places)]
    if len(parts) == 1:
        return {"type": "LineString", "coordinates": parts[0]}
    return {"type": "MultiLineString", "coordinates": parts}


def _coordinates(latitude: float, longitude: float) -> list[float]:
    return [round(longitude, DIGITS), round(latitude, DIGITS)]
