"""API keys and the owners they stand for; where the service may listen without keys."""

import hashlib
import hmac
import socket
from typing import Annotated

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from api.addresses import is_this_machine
from api.key_throttle import KeyThrottle
from api.problems import Unauthorized
from api.settings import Settings
from syncplan.errors import InputError

__all__ = ["LOCAL_OWNER", "CurrentOwner", "Keyring", "refuse_exposure"]

LOCAL_OWNER = "local"
"""Who owns everything while no keys are configured."""

_BEARER = HTTPBearer(
    auto_error=False,
    scheme_name="ApiKey",
    description="One of the keys in SYNCPLAN_API_KEYS; not needed while none is set.",
)


class Keyring:
    """The keys of the settings as digests, each with its owner."""

    def __init__(self, settings: Settings) -> None:
        self._owners = tuple(
            (_digest(entry.key.get_secret_value()), entry.name) for entry in settings.api_keys
        )

    def owner_of(self, presented: str | None) -> str:
        """Return the owner of a presented key; without configured keys always LOCAL_OWNER.

        Raises Unauthorized for no key and for one that is not known. The time it takes reveals
        nothing about the keys: every digest is compared, to its last byte.
        """
        if not self._owners:
            return LOCAL_OWNER
        offered = _digest(presented or "")
        owner = None
        for digest, name in self._owners:
            if hmac.compare_digest(digest, offered):
                owner = name
        if owner is None:
            raise Unauthorized
        return owner


def _digest(key: str) -> bytes:
    return hashlib.sha256(key.encode(errors="surrogatepass")).digest()


async def _current_owner(
    request: Request,
    credentials: Annotated[HTTPAuthorizationCredentials | None, Depends(_BEARER)],
) -> str:
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


def refuse_exposure(settings: Settings, *, worker: bool = False) -> None:
    """Raise InputError if others could reach a service, or a worker, that asks for no key."""
    host = settings.worker_host if worker else settings.host
    listens = not worker or settings.worker_port is not None
    if not listens or settings.api_keys or settings.insecure or _is_loopback(host):
        return
    remedy = "SYNCPLAN_INSECURE=true" if worker else "--insecure"
    raise InputError(
        f"{host!r}: can be reached from other machines, and no keys are set; set "
        f"SYNCPLAN_API_KEYS, listen at 127.0.0.1, or allow it with {remedy}",
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
