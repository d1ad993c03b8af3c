"""Files of a recording: checks, and unpacking of zip and tar archives.

The size of a file, its values and its names are limited.

Whatever an archive holds, only files of recordings are written, by their own names, into one
folder, and no more than is allowed. An archive with too many members is refused by their number
alone: a zip archive before it is opened, a tar archive, which has no directory, while it is read.
"""

import stat
import tarfile
import zipfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path, PurePosixPath
from typing import IO, BinaryIO

from syncplan.errors import InputError

MOST_ROBOTS = 200
LARGEST_FILE_BYTES = 256 * 2**20
LARGEST_VALUE = 1e12
"""Largest value: beyond any clock in s and any coordinate."""


LONGEST_NAME = 64


def name_problem(name: str) -> str:
    """Return the fault of the name of a robot or landmark, or "" if there is none."""
    if not name:
        return "a name is needed"
    if len(name) > LONGEST_NAME:
        return f"a name has at most {LONGEST_NAME} characters"
    if "," in name or not name.isprintable():
        return "a name has neither commas nor control characters"
    return ""


def check_file(path: Path, *, kind: str = "text file", missing: str = "is missing") -> None:
    """Raise InputError if the path is not a file, or the file is too large or can't be read."""
    try:
        size = path.stat().st_size
    except FileNotFoundError:
        raise InputError(missing, source=str(path)) from None
    except OSError as error:
        raise InputError(f"can't be read: {error.strerror}", source=str(path)) from None
    if not path.is_file():
        found = "a folder" if path.is_dir() else "no file of bytes"
        raise InputError(f"is {found}; a {kind} is needed", source=str(path))
    if size > LARGEST_FILE_BYTES:
        raise InputError(f"is larger than {LARGEST_FILE_BYTES // 2**20} MiB", source=str(path))


# --- archives -----------------------------------------------------------------------------------


MOST_BYTES = 2**30
"""Most bytes of all files together, unpacked."""

MOST_MEMBERS = 2_000
"""Most files and folders. A recording of MOST_ROBOTS robots has some 600 files, and some systems
add a hidden one to each."""

_ZIP_ENTRY = b"PK\x01\x02"
"""Signature of each entry in a zip archive's directory."""

UNNAMED = "recording"
"""Folder for files at the top level of an archive."""

_AT_ONCE = 2**20


@dataclass(frozen=True, slots=True)
class _ArchivedFile:
    """A file of an archive: its name and size as stated there, and whether it is a plain file."""

    name: str
    size: int
    plain: bool
    opened: Callable[[], IO[bytes] | None]


def holds_archive(path: Path) -> bool:
    """Return whether a file is a zip or tar archive; raises OSError if it can't be read."""
    return path.is_file() and (zipfile.is_zipfile(path) or tarfile.is_tarfile(path))


def unpack_files(stream: BinaryIO, into: Path, patterns: Sequence[str], source: str) -> Path:
    """Write an archive's files whose names fit a pattern, and return their folder below `into`.

    Other files, and hidden ones, are left out. The folder is named as in the archive. Raises
    InputError, naming `source`, if the archive is broken or too large, or if its files belong to
    two recordings or would be written elsewhere.
    """
    try:
        return _unpacked(stream, into, patterns, source)
    except InputError:
        raise
    except Exception as error:
        # a broken archive can raise any error, even MemoryError
        problem = f"can't be unpacked: {str(error) or type(error).__name__}"
        raise InputError(problem, source=source) from error


def _unpacked(stream: BinaryIO, into: Path, patterns: Sequence[str], source: str) -> Path:
    home: PurePosixPath | None = None
    written: set[str] = set()
    left = MOST_BYTES
    for member in _members(stream, source):
        left -= member.size
        if left < 0:
            problem = (
                f"holds more than {MOST_BYTES // 2**20} MiB, unpacked; leave out what is no "
                "recording"
            )
            raise InputError(problem, source=source)
        path = PurePosixPath(member.name.replace("\\", "/"))
        if path.is_absolute() or ".." in path.parts:
            problem = f"{member.name!r} would be written elsewhere; name files by where they lie"
            raise InputError(problem, source=source)
        hidden = any(part.startswith((".", "__MACOSX")) for part in path.parts)
        if hidden or not any(fnmatchcase(path.name, pattern) for pattern in patterns):
            continue
        if home not in (None, path.parent) or path.name in written:
            problem = f"{member.name!r} belongs to a second recording; send one"
            raise InputError(problem, source=source)
        if not member.plain:
            raise InputError(f"{member.name!r} is no plain file; send the file", source=source)
        home = path.parent
        written.add(path.name)
        folder = into / (home.name or UNNAMED)
        folder.mkdir(exist_ok=True)
        _write(member, folder / path.name)
    if home is None:
        raise InputError(f"holds none of {', '.join(patterns)}", source=source)
    return folder


def _members(stream: BinaryIO, source: str) -> Iterator[_ArchivedFile]:
    """Files of an archive; those of a tar archive one by one while it is read.

    Raises InputError if there are too many members, including folders.
    """
    if zipfile.is_zipfile(stream):
        _check_count(_zip_entries(stream), source)
        with zipfile.ZipFile(stream) as archive:
            for one in archive.infolist():
                if not one.is_dir():
                    kind = one.external_attr >> 16
                    plain = stat.S_IFMT(kind) in (0, stat.S_IFREG)
                    yield _ArchivedFile(
                        one.filename, one.file_size, plain, partial(archive.open, one)
                    )
        return
    stream.seek(0)
    if not tarfile.is_tarfile(stream):
        raise ValueError("it is neither a zip nor a tar archive")
    stream.seek(0)
    with tarfile.open(fileobj=stream, mode="r:*") as tar:
        for count, entry in enumerate(tar, 1):
            _check_count(count, source)
            if not entry.isdir():
                opened = partial(tar.extractfile, entry)
                yield _ArchivedFile(entry.name, entry.size, entry.isreg(), opened)


def _check_count(count: int, source: str) -> None:
    """Raise InputError if an archive with at least `count` members has too many."""
    if count > MOST_MEMBERS:
        problem = (
            f"holds at least {count} files and folders; allowed is up to {MOST_MEMBERS}; leave out "
            "what is no recording"
        )
        raise InputError(problem, source=source)


def _zip_entries(stream: BinaryIO) -> int:
    """Number of entries in a zip archive's directory, counted by their signature.

    The number that the directory states may be false, and opening the archive reads all of the
    directory. In compressed bytes the signature occurs by chance once in 4 GiB.
    """
    stream.seek(0)
    count, kept = 0, b""
    while part := stream.read(_AT_ONCE):
        part = kept + part
        count += part.count(_ZIP_ENTRY)
        # a signature split between two parts is whole in the second
        kept = part[1 - len(_ZIP_ENTRY) :]
    stream.seek(0)
    return count


def _write(member: _ArchivedFile, path: Path) -> None:
    """Write a member's bytes, up to the size it states."""
    opened = member.opened()
    assert opened is not None
    left = member.size
    with opened as source, path.open("xb") as target:
        while left > 0 and (part := source.read(min(left, _AT_ONCE))):
            left -= len(part)
            target.write(part)
    if left:
        raise EOFError(f"{member.name} is cut off")
