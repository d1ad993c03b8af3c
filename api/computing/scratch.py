"""Scratch folders of child processes: owned by the parent, gone however a child ends.

Each is locked while its owner lives; a start removes those that dead processes have left.
"""

import contextlib
import fcntl
import os
import shutil
import tempfile
import time
from pathlib import Path

_PREFIX = "syncplan-scratch-"
_UNLOCKED_S = 60.0
"""Age (s) from which a folder without a lock counts as left behind."""


class Scratch:
    """A new folder for the temporary files of a child."""

    def __init__(self) -> None:
        self.folder = tempfile.mkdtemp(prefix=_PREFIX)
        self._lock = os.open(self.folder, os.O_RDONLY)
        fcntl.flock(self._lock, fcntl.LOCK_EX)

    def remove(self) -> None:
        """Remove the folder with everything in it."""
        shutil.rmtree(self.folder, ignore_errors=True)
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1


def sweep() -> None:
    """Remove the folders of owners that have ended without removing them."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        # folders of others can't be opened, locked ones are in use
        with contextlib.suppress(OSError):
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if time.time() - os.stat(lock).st_mtime > _UNLOCKED_S:
                    shutil.rmtree(folder)
            finally:
                os.close(lock)
