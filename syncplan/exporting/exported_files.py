"""Exported files: their names, and their bytes in memory, in a folder or in an archive."""

import io
import re
import unicodedata
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from syncplan.errors import InputError
from syncplan.runtime.files import write_bytes

LONGEST_BYTES = 80
"""Longest part of a file's name that comes from the user, in UTF-8."""

_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)


def file_title(title: str) -> str:
    """Return a title as the beginning of a file's name; `plan` if nothing of it remains."""
    name = _safe(title) or "plan"
    return f"{name}_" if _RESERVED.fullmatch(name) else name


def file_names(names: Sequence[str]) -> list[str]:
    """Return each name as part of a file's name: letters and digits of any script, - and _.

    Names that would be equal, regardless of case, get a number.
    """
    return _distinct([_safe(name) or "vehicle" for name in names], "-")


def ros_names(names: Sequence[str]) -> list[str]:
    """Return each name as a token of a ROS 2 topic: ASCII, begins with a letter, no double _.

    Source: ROS 2 design, "Topic and Service name mapping to DDS".
    """
    tokens = []
    for name in names:
        plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
        token = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_")
        tokens.append(token if token[:1].isalpha() else f"vehicle_{token}".rstrip("_"))
    return _distinct(tokens, "_")


def _safe(name: str) -> str:
    """A name without characters unsafe in file systems or shells, cut at LONGEST_BYTES."""
    plain = unicodedata.normalize("NFC", name)
    kept = "".join(c if c.isalnum() or c in "-_" else "_" for c in plain)
    return kept.encode()[:LONGEST_BYTES].decode(errors="ignore").strip("_-")


def _distinct(names: list[str], joint: str) -> list[str]:
    # the first of equal names stays unchanged: only later ones get numbers
    taken: set[str] = set()
    distinct = []
    for name in names:
        chosen, number = name, 2
        while chosen.casefold() in taken:
            chosen, number = f"{name}{joint}{number}", number + 1
        taken.add(chosen.casefold())
        distinct.append(chosen)
    return distinct


# --- files --------------------------------------------------------------------------------------


EARLIEST = (1980, 1, 1, 0, 0, 0)
"""Time of every entry in an archive: the earliest that the format allows."""

_READABLE = 0o644 << 16


@dataclass(frozen=True, slots=True)
class ExportedFile:
    """One file: its path relative to the export's folder, with slashes, and its bytes."""

    name: str
    content: bytes


@dataclass(frozen=True, slots=True)
class Written:
    """Files of a plan in one format.

    Attributes
    ----------
    files : all files
    kind : kind of path that the files give the vehicles
    own_files : file name of each vehicle; empty if they share a file
    topics : ROS topic of each vehicle; empty in other formats
    start_items : number of each vehicle's mission item that begins at time 0, where home is 0
    leg_speeds : speed of each vehicle along the chords between waypoints in m/s; empty without them
    parameters : autopilot parameters of each vehicle that the flight needs; empty without missions
    notes : important notes for the reader
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
    """Files of an export and important notes for the reader; equal input gives equal bytes."""

    format: str
    files: tuple[ExportedFile, ...]
    notes: tuple[str, ...]


def as_archive(export: Export) -> bytes:
    """Return the files as a ZIP archive whose bytes depend only on theirs."""
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
    """Write the files into `folder`, each completely or not at all; create missing folders.

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
