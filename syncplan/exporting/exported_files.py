"""Exported files: in memory first, then in a folder or an archive."""

import io
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from syncplan.errors import InputError
from syncplan.runtime.files import write_bytes

EARLIEST = (1980, 1, 1, 0, 0, 0)
"""The time that every entry of an archive bears: the earliest that the format knows."""

_READABLE = 0o644 << 16


@dataclass(frozen=True, slots=True)
class ExportedFile:
    """One file: its path relative to the export's folder, with slashes, and its bytes."""

    name: str
    content: bytes


@dataclass(frozen=True, slots=True)
class Written:
    """What a format makes of a flown.

    Attributes
    ----------
    files : all of them
    kind : what the files hold, as the vehicles fly it
    own_files : name of the file of each vehicle; empty where they share
    topics : ROS topic of each vehicle; empty elsewhere
    start_items : number of the mission's item that begins at time 0, home being 0, of each vehicle
    leg_speeds : speed along the chords between waypoints, m/s, of each vehicle; empty elsewhere
    parameters : autopilot parameters of each vehicle that the flight rests on; empty elsewhere
    notes : what the reader must not miss
    """

    files: tuple[ExportedFile, ...]
    kind: Literal["loiter_turns", "waypoints", "trajectories", "track"] = "track"
    own_files: tuple[str, ...] = ()
    topics: tuple[str, ...] = ()
    start_items: tuple[int, ...] = ()
    leg_speeds: tuple[float, ...] = ()
    parameters: tuple[tuple[tuple[str, float], ...], ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Export:
    """The files of an export and what the reader must not miss; equal input, equal bytes."""

    format: str
    files: tuple[ExportedFile, ...]
    notes: tuple[str, ...]


def as_archive(export: Export) -> bytes:
    """Return the files as a ZIP archive whose bytes depend on nothing but theirs."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in export.files:
            entry = zipfile.ZipInfo(file.name, EARLIEST)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = _READABLE
            archive.writestr(entry, file.content)
    return stream.getvalue()


def write_files(export: Export, folder: Path) -> None:
    """Write the files into `folder`, each whole or not at all; missing folders are made.

    Raises InputError if one can't be written.
    """
    for file in export.files:
        path = folder / file.name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"can't be made a folder: {error.strerror}", source=str(path.parent)
            ) from None
        write_bytes(path, file.content)
