"""Files written whole or not at all."""

import contextlib
import json
import os
import stat
import tempfile
from pathlib import Path
from typing import Any

from syncplan.errors import InputError

_STREAM_FOLDERS = ("/dev/", "/proc/")
_PREFIX_LENGTH = 50


def as_text(values: Any) -> str:
    """Return JSON text, full precision, no NaN or infinity, ending in a newline."""
    return json.dumps(values, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def write_text(path: Path, text: str) -> None:
    """Write `text`, as UTF-8, to `path` whole or not at all; see write_bytes."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, content: bytes) -> None:
    """Write `content` to `path` through a temporary file beside it, so it is never left partial.

    Links are followed and an existing file keeps its permissions. Devices, pipes and standard
    streams by name are written to directly. Raises InputError if the path can't be written; a file
    that was there before stays.
    """
    try:
        before = _status(path)
        _check(path, before)
        if _is_stream(path, before):
            path.write_bytes(content)
        else:
            _replace(Path(os.path.realpath(path)), content, before)
    except OSError as error:
        raise InputError(f"can't be written: {error.strerror}", source=str(path)) from None


def check_writable(path: Path) -> None:
    """Raise InputError where write_bytes would, as far as can be checked without writing."""
    try:
        _check(path, _status(path))
    except OSError as error:
        raise InputError(f"can't be written: {error.strerror}", source=str(path)) from None


def _check(path: Path, before: os.stat_result | None) -> None:
    if before is not None and stat.S_ISDIR(before.st_mode):
        raise InputError("is a directory; give the name of a file", source=str(path))
    if _is_stream(path, before):
        return
    if before is not None and not os.access(path, os.W_OK):
        raise InputError("can't be written: it is read-only", source=str(path))
    folder = Path(os.path.realpath(path)).parent
    if not folder.is_dir():
        problem = f"can't be written: there is no directory {folder}; make it first"
        raise InputError(problem, source=str(path))
    if not os.access(folder, os.W_OK | os.X_OK):
        problem = f"can't be written: nothing can be written to {folder}; give a file elsewhere"
        raise InputError(problem, source=str(path))


def _is_stream(path: Path, before: os.stat_result | None) -> bool:
    """Whether a path is written to directly."""
    if str(path).startswith(_STREAM_FOLDERS):
        return True
    return before is not None and not stat.S_ISREG(before.st_mode)


def _status(path: Path) -> os.stat_result | None:
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def _replace(path: Path, content: bytes, before: os.stat_result | None) -> None:
    """Write beside `path`, then rename over it."""
    prefix = f".{path.name[:_PREFIX_LENGTH]}."
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=prefix, suffix=".tmp")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(name).chmod(stat.S_IMODE(before.st_mode) if before else _default_mode())
        Path(name).replace(path)
    finally:
        with contextlib.suppress(OSError):
            Path(name).unlink(missing_ok=True)


def _default_mode() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
