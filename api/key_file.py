"""A file of API keys that may be changed while the service runs."""

import logging
import os
import stat
from pathlib import Path

from api.keys import ApiKey, keys_of_lines
from syncplan.errors import InputError

_LARGEST_BYTES = 2**20

_log = logging.getLogger("api.keys")


class KeyFile:
    """The keys in a file, and whether it has changed since it was read last.

    Contents are compared, not times: an edit within one tick of the clock counts as well.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._last: bytes | str | None = None

    def changed(self) -> tuple[ApiKey, ...] | None:
        """Return the keys if the file has changed since the last call, None otherwise.

        Raises InputError, once for each change, if it can't be read or a line is no key.
        """
        content, mode = self._read()
        last, self._last = self._last, content
        if content == last:
            return None
        if isinstance(content, str):
            raise InputError(content, source=str(self.path))
        try:
            keys = keys_of_lines(content.decode())
        except UnicodeDecodeError:
            raise InputError(
                "is not UTF-8; give NAME:KEY, one a line", source=str(self.path)
            ) from None
        except ValueError as error:
            raise InputError(str(error), source=str(self.path)) from None
        self._warn_of_readers(mode)
        return keys

    def _read(self) -> tuple[bytes | str, int]:
        """What is in the file, or in words why that can't be known, and who may read it."""
        try:
            with self.path.open("rb") as file:
                content = file.read(_LARGEST_BYTES + 1)
                mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
        except OSError as error:
            return f"can't be read: {error.strerror or error}", 0
        if len(content) > _LARGEST_BYTES:
            return f"is larger than {_LARGEST_BYTES} bytes; give NAME:KEY, one a line", mode
        return content, mode

    def _warn_of_readers(self, mode: int) -> None:
        if mode & (stat.S_IROTH | stat.S_IWOTH):
            _log.warning(
                "%s: every user of this machine may read or change it (mode %o); chmod 600 it",
                self.path,
                mode,
            )
