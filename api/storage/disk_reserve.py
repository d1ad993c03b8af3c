"""A little room kept beside SQLite's file, so that it can be opened on a disk that has filled up.

SQLite keeps two files beside a database that is open. Where the last process that used it has ended
in good order they are gone, and on a full disk they can't be made, even to read.
"""

import contextlib
import os
from pathlib import Path

_SIZE = 2**17


def keep_reserve(database: Path) -> None:
    """Keep room for a database, if there is any and none is kept yet."""
    reserve = _reserve_of(database)
    with contextlib.suppress(OSError):
        opened = os.open(reserve, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
        try:
            os.posix_fallocate(opened, 0, _SIZE)
        except OSError:
            reserve.unlink()
        finally:
            os.close(opened)


def release_reserve(database: Path) -> bool:
    """Give the room up; return whether any was kept."""
    try:
        _reserve_of(database).unlink()
    except OSError:
        return False
    return True


def _reserve_of(database: Path) -> Path:
    return database.with_name(f"{database.name}-reserve")
