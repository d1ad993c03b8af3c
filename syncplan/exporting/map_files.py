"""Files for maps: circles, centres, entries, landmarks and areas as GeoJSON or KML 2.2."""

from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np

from syncplan.arrays import Array
from syncplan.exporting.exported_files import ExportedFile, Written
from syncplan.exporting.fences import polygons_of
from syncplan.exporting.scheduled_plan import ScheduledPlan, moment, start_of
from syncplan.orbits.circles import position, unit
from syncplan.runtime.files import as_text
from syncplan.scenario.ground import DEGREE_DIGITS, lat_lon_of, rings_of

POINTS_PER_TURN = 180


@dataclass(frozen=True, slots=True)
class VehicleTrack:
    """Track of one vehicle on a map, in latitudes and longitudes in degrees.

    Attributes
    ----------
    circle : (181, 2) points from the entry in the direction of flight; the last equals the first
    center, entry : (2,) points
    """

    name: str
    circle: Array
    center: Array
    entry: Array


def tracks_of(flown: ScheduledPlan) -> list[VehicleTrack]:
    """Return the track of each vehicle. Raises InputError without a geo_origin."""
    orbits, origin = flown.plan.orbits, flown.origin
    turn = 2.0 * np.pi / POINTS_PER_TURN * np.arange(POINTS_PER_TURN)
    phases = orbits.phases[:, None] + orbits.senses[:, None] * turn
    points = orbits.centers[:, None] + orbits.radii[:, None, None] * unit(phases)
    circles = lat_lon_of(origin, np.concatenate([points, points[:, :1]], axis=1))
    centers, entries = lat_lon_of(origin, orbits.centers), lat_lon_of(origin, position(orbits, 0.0))
    return [
        VehicleTrack(name, circles[k], centers[k], entries[k]) for k, name in enumerate(flown.names)
    ]


def landmark_places(flown: ScheduledPlan) -> dict[str, Array]:
    """Return latitude and longitude of each landmark by its name."""
    places = lat_lon_of(flown.origin, flown.plan.landmarks)
    return dict(zip(flown.plan.scenario.landmark_names, places, strict=True))


def parted(places: Array) -> list[Array]:
    """Return a line of (k, 2) latitudes and longitudes cut where it crosses the antimeridian.

    Each part ends on one side of it and the next goes on from the other (RFC 7946, section 3.1.9).
    """
    parts: list[list[tuple[float, float]]] = [[]]
    before: tuple[float, float] | None = None
    for latitude, longitude in places.tolist():
        if before is not None and abs(longitude - before[1]) > 180.0:
            side = 180.0 if before[1] > 0.0 else -180.0
            onward = longitude + 2.0 * side
            share = (side - before[1]) / (onward - before[1])
            crossing = before[0] + share * (latitude - before[0])
            parts[-1].append((crossing, side))
            parts.append([(crossing, -side)])
        parts[-1].append((latitude, longitude))
        before = (latitude, longitude)
    return [np.array(part) for part in parts]


# --- GeoJSON ------------------------------------------------------------------------------------


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
            _feature(_line_geometry(track.circle), {"kind": "circle", **about}),
            _feature(_point_geometry(track.center), {"kind": "center", "vehicle": track.name}),
            _feature(
                _point_geometry(track.entry),
                {"kind": "entry", "vehicle": track.name, "time_s": 0.0},
            ),
        ]
    for name, place in landmark_places(flown).items():
        features.append(_feature(_point_geometry(place), {"kind": "landmark", "landmark": name}))
    for polygon in polygons_of(flown):
        features.append(
            _feature(
                _polygon_geometry(rings_of(flown.origin, polygon.corners)), {"kind": polygon.kind}
            )
        )
    collection = {"type": "FeatureCollection", "features": features}
    name = f"{flown.title}.geojson"
    return Written(files=(ExportedFile(name, as_text(collection).encode()),))


def _feature(geometry: dict[str, Any], properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _point_geometry(place: Array) -> dict[str, Any]:
    return {"type": "Point", "coordinates": _position(float(place[0]), float(place[1]))}


def _line_geometry(places: Array) -> dict[str, Any]:
    parts = [[_position(*place) for place in part.tolist()] for part in parted(places)]
    if len(parts) == 1:
        return {"type": "LineString", "coordinates": parts[0]}
    return {"type": "MultiLineString", "coordinates": parts}


def _polygon_geometry(rings: list[Array]) -> dict[str, Any]:
    parts = [[[_position(*place) for place in ring.tolist()]] for ring in rings]
    if len(parts) == 1:
        return {"type": "Polygon", "coordinates": parts[0]}
    return {"type": "MultiPolygon", "coordinates": parts}


def _position(latitude: float, longitude: float) -> list[float]:
    return [round(longitude, DEGREE_DIGITS), round(latitude, DEGREE_DIGITS)]


# --- KML ----------------------------------------------------------------------------------------


KML = "http://www.opengis.net/kml/2.2"
GOOGLE = "http://www.google.com/kml/ext/2.2"

MOST_TRACK_POINTS = 2000
"""Most points of one timed track: more would not be visible."""


def write_kml(flown: ScheduledPlan) -> Written:
    """Return one file with a folder for each vehicle; altitudes are above the ground.

    If the scenario has a start_time, each vehicle also has a track over time, which viewers play.
    Raises InputError without a geo_origin.
    """
    root = Xml.Element("kml", {"xmlns": KML, "xmlns:gx": GOOGLE})
    document = Xml.SubElement(root, "Document")
    _text(document, "name", flown.plan.scenario.name or "plan")
    for k, track in enumerate(tracks_of(flown)):
        folder, height = Xml.SubElement(document, "Folder"), flown.altitudes[k]
        _text(folder, "name", track.name)
        _circle(_placemark(folder, f"{track.name} circle", "circle"), parted(track.circle), height)
        _point(folder, f"{track.name} entry", "entry", track.entry, height)
        _track(folder, flown, k)
    for name, place in landmark_places(flown).items():
        _point(document, name, "landmark", place, 0.0)
    for polygon in polygons_of(flown):
        placemark = _placemark(document, polygon.kind.replace("_", " "), polygon.kind)
        _polygon(placemark, rings_of(flown.origin, polygon.corners))
    Xml.indent(root, space=" ")
    content = Xml.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
    return Written(files=(ExportedFile(f"{flown.title}.kml", content),))


def _circle(placemark: Xml.Element, parts: list[Array], height: float) -> None:
    """Add a circle, in parts where it crosses the antimeridian."""
    parent = placemark if len(parts) == 1 else Xml.SubElement(placemark, "MultiGeometry")
    for part in parts:
        line = Xml.SubElement(parent, "LineString")
        _text(line, "altitudeMode", "relativeToGround")
        _text(line, "coordinates", " ".join(_coordinates(one, height, ",") for one in part))


def _polygon(placemark: Xml.Element, rings: list[Array]) -> None:
    """Add a polygon on the ground, in parts where it crosses the antimeridian."""
    parent = placemark if len(rings) == 1 else Xml.SubElement(placemark, "MultiGeometry")
    for ring in rings:
        boundary = Xml.SubElement(Xml.SubElement(parent, "Polygon"), "outerBoundaryIs")
        line = Xml.SubElement(boundary, "LinearRing")
        _text(line, "coordinates", " ".join(_coordinates(place, 0.0, ",") for place in ring))


def _track(folder: Xml.Element, flown: ScheduledPlan, k: int) -> None:
    """Add the timed track of vehicle k, if the moment of time 0 is known."""
    start = start_of(flown.plan)
    if start is None:
        return
    orbits = flown.plan.orbits
    wanted = int(np.ceil(flown.duration / orbits.period * POINTS_PER_TURN)) + 1
    times = np.linspace(0.0, flown.duration, min(wanted, MOST_TRACK_POINTS))
    places = lat_lon_of(flown.origin, position(orbits, times)[:, k])
    track = Xml.SubElement(_placemark(folder, f"{flown.names[k]} flight", "flight"), "gx:Track")
    _text(track, "altitudeMode", "relativeToGround")
    for time in times.tolist():
        _text(track, "when", moment(start, time))
    for place in places:
        _text(track, "gx:coord", _coordinates(place, flown.altitudes[k], " "))


def _point(parent: Xml.Element, name: str, kind: str, place: Array, height: float) -> None:
    point = Xml.SubElement(_placemark(parent, name, kind), "Point")
    _text(point, "altitudeMode", "relativeToGround")
    _text(point, "coordinates", _coordinates(place, height, ","))


def _placemark(parent: Xml.Element, name: str, kind: str) -> Xml.Element:
    """Add a placemark; `kind` is as in GeoJSON, for programs that read the file."""
    placemark = Xml.SubElement(parent, "Placemark")
    _text(placemark, "name", name)
    data = Xml.SubElement(Xml.SubElement(placemark, "ExtendedData"), "Data", {"name": "kind"})
    _text(data, "value", kind)
    return placemark


def _text(parent: Xml.Element, tag: str, text: str) -> None:
    Xml.SubElement(parent, tag).text = text


def _coordinates(place: Array, height: float, between: str) -> str:
    return between.join([f"{place[1]:.9f}", f"{place[0]:.9f}", f"{height:.3f}"])
