"""Writing results: whole or not at all."""

import contextlib
import json
import os
import tempfile
from pathlib import Path
from typing import Any

from syncplan.errors import InputError

__all__ = ["as_text", "write_text"]


def as_text(values: Any) -> str:
    """Return JSON text, full precision, no NaN or infinity, ending in a newline."""
    return json.dumps(values, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path` by way of a temporary file beside it, so that no half is ever left.

    Raises InputError if the path can't be written; what was there before stays.
    """
    if path.is_dir():
        raise InputError("is a directory; give the name of a file", source=str(path))
    if path.exists() and not path.is_file():
        # a device or a pipe, such as /dev/stdout: nothing to rename over
        try:
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise InputError(f"can't be written: {error.strerror}", source=str(path)) from None
        return
    try:
        handle, name = tempfile.mkstemp(
            dir=path.parent, prefix=f".{path.name[:50]}.", suffix=".tmp"
        )
    except OSError as error:
        raise InputError(f"can't be written: {error.strerror}", source=str(path)) from None
    temporary = Path(name)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        temporary.replace(path)
    except OSError as error:
        raise InputError(f"can't be written: {error.strerror}", source=str(path)) from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
