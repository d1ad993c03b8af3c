"""API keys as an operator lists them: each with the name of the owner it stands for."""

import hashlib
import re

from pydantic import BaseModel, ConfigDict, SecretStr

__all__ = ["ApiKey", "check_keys", "parsed_keys"]

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


def check_keys(keys: tuple[ApiKey, ...]) -> None:
    """Raise ValueError if a key can't serve; by place, for what reads as a name may be a key."""
    names: dict[str, int] = {}
    secrets: dict[str, int] = {}
    for place, entry in enumerate(keys, 1):
        key = entry.key.get_secret_value()
        if not _NAME.fullmatch(entry.name):
            raise ValueError(
                f"the name of key {place} must be 1 to 64 letters, digits, '.', '_' or '-'; "
                "give NAME:KEY or KEY, separated by commas"
            )
        if len(key) < SHORTEST_KEY or not _KEY.fullmatch(key):
            raise ValueError(
                f"key {place} must be {SHORTEST_KEY} or more printable ASCII characters without "
                "blanks and commas; give NAME:KEY or KEY, separated by commas"
            )
        for what, value, seen in (("name", entry.name, names), ("key", key, secrets)):
            if value in seen:
                raise ValueError(
                    f"entries {seen[value]} and {place} have the same {what}; give each its own"
                )
            seen[value] = place
