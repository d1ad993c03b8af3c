"""API keys as an operator lists them, each with the name of its owner.

They come from a setting or from a file, which may be changed while the service runs.
"""

import hashlib
import logging
import os
import re
import stat
from collections.abc import Iterable
from pathlib import Path

from pydantic import BaseModel, ConfigDict, SecretStr

from syncplan.errors import InputError

SHORTEST_KEY = 16
_KEY = re.compile(r"[!-+\--~]+")
_NAME = re.compile(r"[A-Za-z0-9._-]{1,64}")


class ApiKey(BaseModel):
    """A key and the name of its owner, under which plans and jobs are kept."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    key: SecretStr


def parsed_keys(text: str) -> tuple[ApiKey, ...]:
    """Return the keys of a list; a bare key is named by its digest, so its owner stays the same."""
    keys = []
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, colon, key = part.partition(":")
        if not colon:
            name, key = "key-" + hashlib.sha256(part.encode()).hexdigest()[:12], part
        keys.append(ApiKey(name=name, key=SecretStr(key)))
    return tuple(keys)


def keys_of_lines(text: str) -> tuple[ApiKey, ...]:
    """Return the keys of a file, NAME:KEY a line; empty lines and # comments are skipped.

    Raises ValueError, which names the line but not the key.
    """
    keys = {}
    for number, line in enumerate(text.splitlines(), 1):
        entry = line.strip()
        if entry and not entry.startswith("#"):
            name, colon, key = entry.partition(":")
            if not colon:
                raise ValueError(f"line {number} has no colon; give NAME:KEY, one a line")
            keys[f"line {number}"] = ApiKey(name=name, key=SecretStr(key))
    _check(keys.items(), "give NAME:KEY, one a line")
    return tuple(keys.values())


def check_keys(keys: Iterable[ApiKey]) -> None:
    """Raise ValueError naming the place of an invalid key, since its apparent name may be a key."""
    _check(
        ((f"entry {place}", entry) for place, entry in enumerate(keys, 1)),
        "give NAME:KEY or KEY, separated by commas",
    )


def _check(keys: Iterable[tuple[str, ApiKey]], remedy: str) -> None:
    seen: dict[str, tuple[str, str]] = {}
    for place, entry in keys:
        key = entry.key.get_secret_value()
        if not _NAME.fullmatch(entry.name):
            raise ValueError(
                f"the name of {place} must be 1 to 64 letters, digits, '.', '_' or '-'; {remedy}"
            )
        if len(key) < SHORTEST_KEY or not _KEY.fullmatch(key):
            raise ValueError(
                f"the key of {place} must be {SHORTEST_KEY} or more printable ASCII characters "
                f"without blanks and commas; {remedy}"
            )
        first, owner = seen.setdefault(key, (place, entry.name))
        if owner != entry.name:
            raise ValueError(
                f"{first} and {place} have the same key and other names; "
                "a name may have several keys, a key one name"
            )


_LARGEST_BYTES = 2**20

_log = logging.getLogger("api.keys")


class KeyFile:
    """File of keys that detects changes since it was last read.

    Contents are compared, not times, so that an edit within one tick of the clock counts as well.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._last: bytes | str | None = None

    def changed(self) -> tuple[ApiKey, ...] | None:
        """Return the keys if the file has changed since the last call, None otherwise.

        Raises InputError, once for each change, if it can't be read or a line holds no key.
        """
        content, mode = self._read()
        last, self._last = self._last, content
        if content == last:
            return None
        if isinstance(content, str):
            raise InputError(content, source=str(self.path))
        try:
            keys = keys_of_lines(content.decode())
        except ValueError as error:
            is_text = not isinstance(error, UnicodeDecodeError)
            problem = str(error) if is_text else "is not UTF-8; give NAME:KEY, one a line"
            raise InputError(problem, source=str(self.path)) from None
        self._warn_of_readers(mode)
        return keys

    def _read(self) -> tuple[bytes | str, int]:
        """Content of the file, or the reason why it can't be read, and its mode."""
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
