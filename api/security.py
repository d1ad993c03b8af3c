"""API keys and the owners they stand for; where the service may listen without keys."""

import hashlib
import hmac
import logging
import socket
import time
from collections.abc import Callable, Iterable
from typing import Annotated

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from api.addresses import is_this_machine
from api.key_file import KeyFile
from api.key_throttle import KeyThrottle
from api.keys import ApiKey, check_keys
from api.problems import Unauthorized
from api.settings import Settings
from syncplan.errors import InputError

LOCAL_OWNER = "local"
"""Who owns everything while no keys are configured."""

_BEARER = HTTPBearer(
    auto_error=False,
    scheme_name="ApiKey",
    description="One of the keys that the service was given; not needed where it has none.",
)
_Credentials = Annotated[HTTPAuthorizationCredentials | None, Depends(_BEARER)]

_LOOK_EVERY_S = 1.0

_log = logging.getLogger("api.keys")


class Keyring:
    """The keys of the settings and of their file as digests, each with its owner.

    The file is read again when it has changed, at most once a second; while it can't serve, the
    keys of before stay and the log says why.
    """

    def __init__(self, settings: Settings, clock: Callable[[], float] = time.monotonic) -> None:
        path = settings.api_keys_file
        self._asks = settings.asks_for_keys
        self._given = settings.api_keys
        self._file = None if path is None else KeyFile(path)
        self._clock = clock
        self._look_at = clock() + _LOOK_EVERY_S
        self._owners = _digested(self._given)
        self._version = 0
        if self._file is not None:
            self._use(self._file.changed() or ())

    @property
    def version(self) -> int:
        """How often the keys have changed."""
        self._look()
        return self._version

    def admits(self, owner: str, digest: bytes) -> bool:
        """Return whether the key with a digest still stands for an owner."""
        return not self._asks or (digest, owner) in self._owners

    def owner_of(self, presented: str | None) -> str:
        """Return the owner of a presented key; without configured keys always LOCAL_OWNER.

        Raises Unauthorized for no key and for one that is not known. The time it takes reveals
        nothing about the keys: every digest is compared, to its last byte.
        """
        self._look()
        if not self._asks:
            return LOCAL_OWNER
        offered = _digest(presented or "")
        owner = None
        for digest, name in self._owners:
            if hmac.compare_digest(digest, offered):
                owner = name
        if owner is None:
            raise Unauthorized
        return owner

    def _look(self) -> None:
        """Read the file again if it has changed."""
        if self._file is None or self._clock() < self._look_at:
            return
        self._look_at = self._clock() + _LOOK_EVERY_S
        try:
            found = self._file.changed()
            if found is not None:
                self._use(found)
        except InputError as error:
            _log.error("the keys of before stay: %s", error)

    def _use(self, found: tuple[ApiKey, ...]) -> None:
        """Take over the keys of the file; raises InputError if they can't serve."""
        assert self._file is not None
        keys = (*self._given, *found)
        if not keys:
            raise InputError("has no key; give NAME:KEY, one a line", source=str(self._file.path))
        try:
            check_keys(keys)
        except ValueError:
            raise InputError(
                "has a key of SYNCPLAN_API_KEYS under another name; a key may have one name",
                source=str(self._file.path),
            ) from None
        self._owners = _digested(keys)
        self._version += 1
        owners = len({name for _, name in self._owners})
        _log.info("%d keys of %d owners", len(self._owners), owners)


def _digested(keys: Iterable[ApiKey]) -> tuple[tuple[bytes, str], ...]:
    pairs = ((_digest(entry.key.get_secret_value()), entry.name) for entry in keys)
    return tuple(dict.fromkeys(pairs))


def _digest(key: str) -> bytes:
    return hashlib.sha256(key.encode(errors="surrogatepass")).digest()


async def _current_owner(request: Request, credentials: _Credentials) -> str:
    keyring: Keyring = request.app.state.keyring
    if credentials is None:
        owner = keyring.owner_of(None)
    else:
        throttle: KeyThrottle = request.app.state.key_throttle
        address = request.client.host if request.client else ""
        owner = _owner_at(address, credentials.credentials, keyring, throttle)
    request.state.owner = owner
    return owner


def _owner_at(address: str, presented: str, keyring: Keyring, throttle: KeyThrottle) -> str:
    """The owner of a key that came from an address, unless that has to wait."""
    throttle.admit(address, presented)
    try:
        owner = keyring.owner_of(presented)
    except Unauthorized:
        throttle.refused(address)
        raise
    throttle.accepted(address, presented)
    return owner


CurrentOwner = Annotated[str, Depends(_current_owner)]
"""Parameter type of a route: the owner whose key came with the request, or 401."""


async def _current_key(_owner: CurrentOwner, credentials: _Credentials) -> bytes:
    return _digest(credentials.credentials if credentials else "")


CurrentKey = Annotated[bytes, Depends(_current_key)]
"""Parameter type of a route: the digest of the key that came, for Keyring.admits."""


def refuse_exposure(settings: Settings, *, worker: bool = False) -> None:
    """Raise InputError if others could reach a service, or a worker, that asks for no key."""
    host = settings.worker_host if worker else settings.host
    listens = not worker or settings.worker_port is not None
    if not listens or settings.asks_for_keys or settings.insecure or _is_loopback(host):
        return
    remedy = "SYNCPLAN_INSECURE=true" if worker else "--insecure"
    raise InputError(
        f"{host!r}: can be reached from other machines, and no keys are set; set "
        "SYNCPLAN_API_KEYS or SYNCPLAN_API_KEYS_FILE, "
        f"listen at 127.0.0.1, or allow it with {remedy}",
        key="SYNCPLAN_WORKER_HOST" if worker else "SYNCPLAN_HOST",
    )


def _is_loopback(host: str) -> bool:
    """Whether only this machine reaches `host`; a name counts by all its addresses."""
    if not host:
        return False
    try:
        return is_this_machine(host.removeprefix("[").removesuffix("]"))
    except ValueError:
        pass
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        return False
    return all(is_this_machine(str(entry[4][0])) for entry in found)
