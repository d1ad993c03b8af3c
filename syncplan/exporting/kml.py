"""Circles, entry points, landmarks and timed tracks as KML 2.2 with Google's tracks."""

from xml.etree import ElementTree as Xml

import numpy as np

from syncplan.arrays import Array
from syncplan.exporting.exported_files import ExportedFile, Written
from syncplan.exporting.geodesy import geodetic
from syncplan.exporting.map_tracks import POINTS_PER_TURN, landmark_places, parted, tracks_of
from syncplan.exporting.scheduled_plan import ScheduledPlan, moment, start_of
from syncplan.orbits.circles import position

KML = "http://www.opengis.net/kml/2.2"
GOOGLE = "http://www.google.com/kml/ext/2.2"

MOST_TRACK_POINTS = 2000
"""Of one timed track: what is beyond would not show."""


def write_kml(flown: ScheduledPlan) -> Written:
    """Return one file with a folder for each vehicle; altitudes are above the ground.

    Where the scenario has a start_time, each vehicle also has a track over time, which viewers
    play. Raises InputError without a geo_origin.
    """
    root = Xml.Element("kml", {"xmlns": KML, "xmlns:gx": GOOGLE})
    document = Xml.SubElement(root, "Document")
    _text(document, "name", flown.plan.scenario.name or "plan")
    for k, track in enumerate(tracks_of(flown)):
        folder, height = Xml.SubElement(document, "Folder"), flown.altitudes[k]
        _text(folder, "name", track.name)
        _circle(_placemark(folder, f"{track.name} circle"), parted(track.circle), height)
        _point(folder, f"{track.name} entry", track.entry, height)
        _track(folder, flown, k)
    for name, place in landmark_places(flown).items():
        _point(document, name, place, 0.0)
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


def _track(folder: Xml.Element, flown: ScheduledPlan, k: int) -> None:
    """Add the timed track of vehicle k, where the moment of time 0 is known."""
    start = start_of(flown.plan)
    if start is None:
        return
    orbits = flown.plan.orbits
    wanted = int(np.ceil(flown.duration / orbits.period * POINTS_PER_TURN)) + 1
    times = np.linspace(0.0, flown.duration, min(wanted, MOST_TRACK_POINTS))
    places = geodetic(flown.origin, position(orbits, times)[:, k])
    track = Xml.SubElement(_placemark(folder, f"{flown.names[k]} flight"), "gx:Track")
    _text(track, "altitudeMode", "relativeToGround")
    for time in times.tolist():
        _text(track, "when", moment(start, time))
    for place in places:
        _text(track, "gx:coord", _coordinates(place, flown.altitudes[k], " "))


def _point(parent: Xml.Element, name: str, place: Array, height: float) -> None:
    point = Xml.SubElement(_placemark(parent, name), "Point")
    _text(point, "altitudeMode", "relativeToGround")
    _text(point, "coordinates", _coordinates(place, height, ","))


def _placemark(parent: Xml.Element, name: str) -> Xml.Element:
    placemark = Xml.SubElement(parent, "Placemark")
    _text(placemark, "name", name)
    return placemark


def _text(parent: Xml.Element, tag: str, text: str) -> None:
    Xml.SubElement(parent, tag).text = text


def _coordinates(place: Array, height: float, between: str) -> str:
    return between.join([f"{place[1]:.9f}", f"{place[0]:.9f}", f"{height:.3f}"])
