"""Files of a recording: there, no larger than is read, and values within what they can be."""

from pathlib import Path

from syncplan.errors import InputError

MOST_ROBOTS = 200
LARGEST_FILE_BYTES = 256 * 2**20
LARGEST_VALUE = 1e12
"""Larger than any clock in seconds and any coordinate."""


LONGEST_NAME = 64


def name_problem(name: str) -> str:
    """Return what is wrong with the name of a robot or landmark, or "" if nothing is."""
    if not name:
        return "a name is needed"
    if len(name) > LONGEST_NAME:
        return f"a name has at most {LONGEST_NAME} characters"
    if "," in name or not name.isprintable():
        return "a name has neither commas nor control characters"
    return ""


def check_file(path: Path, *, kind: str = "text file", missing: str = "is missing") -> None:
    """Raise InputError if the path is no file, or one that is too large or can't be read."""
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
