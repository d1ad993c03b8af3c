"""Imported places as a document: the features of files, what they become, and a scenario."""

from typing import Any

from pydantic import Field

from syncplan import __version__
from syncplan.arrays import Array
from syncplan.documents import DocumentPart, LatLon, VersionedDocument
from syncplan.importing.features import Geometry, Section
from syncplan.importing.imported_places import ImportedPlaces
from syncplan.scenario.ground import DEGREE_DIGITS


class ImportedFeature(DocumentPart):
    """A feature of a file, and what it becomes."""

    file: str
    folder: str = Field(description="Names of the folders that hold it; empty without")
    name: str = Field(description="Its name; landmarks have one that no other has")
    geometry: Geometry
    section: Section = Field(description="What it becomes; none if it is left out")
    reason: str = Field(description="Why, in words", examples=["the largest polygon"])
    lat_lon_deg: list[LatLon] = Field(description="Its places; corners of polygons are not closed")
    holes_lat_lon_deg: list[list[LatLon]] = Field(description="Corners of its holes")


class ImportDocument(VersionedDocument):
    """The features of files of the field, and a scenario of what they become."""

    features: list[ImportedFeature]
    scenario: dict[str, Any] = Field(
        description="A scenario in degrees, whose orbit, formation and sensor are examples"
    )
    notes: list[str] = Field(description="What the files hold besides")


def import_document(places: ImportedPlaces, title: str) -> ImportDocument:
    """Return the document of imported places; raises InputError as `scenario` does."""
    return ImportDocument(
        version=__version__,
        features=[
            ImportedFeature(
                file=each.file,
                folder=each.feature.folder,
                name=each.feature.name,
                geometry=each.feature.geometry,
                section=each.section,
                reason=each.reason,
                lat_lon_deg=_listed(each.feature.places),
                holes_lat_lon_deg=[_listed(hole) for hole in each.feature.holes],
            )
            for each in places.features
        ],
        scenario=places.scenario(title),
        notes=list(places.notes),
    )


def _listed(places: Array) -> list[LatLon]:
    return [(latitude, longitude) for latitude, longitude in places.round(DEGREE_DIGITS).tolist()]
