"""Access control: hosts and pages for a service without keys, and keys with their owners.

A browser lets any page send simple requests anywhere, and a name that switches from its server to
127.0.0.1 (DNS rebinding) lets a page read the answers too. Keys stop both, as no browser adds one
on its own: with keys, `Host` and `Origin` are not checked.
"""

import hashlib
import hmac
import ipaddress
import logging
import math
import socket
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import Annotated

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from starlette.types import ASGIApp, Receive, Scope, Send

from api.keys import ApiKey, KeyFile, check_keys
from api.logs import SeldomLog
from api.problems import ForeignPage, KeysThrottled, Unauthorized, WrongHost
from api.settings import Settings
from syncplan.errors import InputError

# --- addresses of clients -------------------------------------------------------------------------


_ONE_SITE = 64
"""Bits of the IPv6 prefix of one site, which may use any address with that prefix."""


@lru_cache(maxsize=4096)
def network_of(address: str) -> str:
    """Return the network of an address: an IPv4 address itself, an IPv6 address's /64.

    Text that is no address (a Unix socket has none) is returned unchanged.
    """
    try:
        parsed = _parsed(address)
    except ValueError:
        return address
    if parsed.version == 4 or parsed.is_loopback:
        return str(parsed)
    bare = int(parsed) >> _ONE_SITE << _ONE_SITE
    return f"{ipaddress.IPv6Address(bare)}/{_ONE_SITE}"


def is_this_machine(address: str) -> bool:
    """Return whether an IP address is a loopback address; raises ValueError if it is no address."""
    return _parsed(address).is_loopback


def _parsed(address: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    """IP address, without the form in which IPv6 presents one of IPv4."""
    parsed = ipaddress.ip_address(address)
    return getattr(parsed, "ipv4_mapped", None) or parsed


# --- hosts and origins ----------------------------------------------------------------------------


_LOCAL = frozenset({"localhost"})
_LONGEST_SHOWN = 80
_LONGEST = 320
"""Bytes of the longest host or origin that is checked; a name has up to 253."""

_MOST_KEPT = 1024
"""Most spellings of hosts whose verdict is kept."""

_REMEDY = "name it in SYNCPLAN_ALLOWED_HOSTS or set SYNCPLAN_API_KEYS"


class LocalOnly:
    """ASGI middleware that refuses requests for other hosts (421) and from foreign pages (403).

    It accepts localhost, the loopback addresses, the address at which the client reached this
    machine, and the names given. A request without `Origin` does not come from a foreign page.
    Raises WrongHost and ForeignPage, so it belongs inside the middleware that answers with
    problems.
    """

    def __init__(self, app: ASGIApp, names: Iterable[str]) -> None:
        self.app = app
        known = _LOCAL.union(name.lower() for name in names)

        @_kept
        def accepted(host: bytes, own: str) -> bool:
            name = host_name(host.decode("latin-1"))
            return name in known or _is_here(name, own)

        @_kept
        def accepted_origin(origin: bytes, own: str) -> bool:
            scheme, separator, host = origin.partition(b"://")
            return bool(scheme and separator) and accepted(host, own)

        self._accepted, self._accepted_origin = accepted, accepted_origin

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on permitted requests; anything but HTTP goes through untouched."""
        if scope["type"] == "http":
            own = (scope.get("server") or ("",))[0]
            for name, value in scope["headers"]:
                if name == b"host" and not self._accepted(value, own):
                    raise WrongHost(_refused("Host", value))
                if name == b"origin" and not self._accepted_origin(value, own):
                    raise ForeignPage(_refused("Origin", value))
        await self.app(scope, receive, send)


def host_name(host: str) -> str:
    """Return the name or address of `host[:port]` in lower case, without brackets or last dot."""
    if host.startswith("["):
        return host[1:].partition("]")[0].lower()
    return host.partition(":")[0].removesuffix(".").lower()


def _kept(judge: Callable[[bytes, str], bool]) -> Callable[[bytes, str], bool]:
    """`judge` with its verdicts kept; values longer than _LONGEST are rejected without it."""
    judged = lru_cache(maxsize=_MOST_KEPT)(judge)
    return lambda value, own: len(value) <= _LONGEST and judged(value, own)


def _is_here(name: str, own: str) -> bool:
    try:
        return is_this_machine(name) or name == own
    except ValueError:
        return False


def _refused(header: str, value: bytes) -> str:
    shown = value.decode("latin-1")
    if len(shown) > _LONGEST_SHOWN:
        shown = shown[: _LONGEST_SHOWN - 3] + "..."
    return (
        f"{header} {shown!r}: without keys this service answers only as a host of this machine, "
        f"such as localhost or 127.0.0.1; if it is one of yours, {_REMEDY}"
    )


def names_here(hosts: Iterable[str], further: Iterable[str]) -> frozenset[str]:
    """Return the names that lead to a service listening at `hosts`, and the `further` ones.

    Beyond loopback, they include this machine's own name.
    """
    names = set(further)
    for name in map(host_name, hosts):
        try:
            address = ipaddress.ip_address(name)
        except ValueError:
            names.add(name)
            reached = name not in _LOCAL
        else:
            reached = not is_this_machine(name)
            if not address.is_unspecified:
                names.add(name)
        if reached:
            names.add(socket.gethostname().lower())
    return frozenset(names - {""})


# --- refused keys ---------------------------------------------------------------------------------


_MINUTE_S = 60.0
_MOST_ADDRESSES = 10_000
_MOST_PROVEN = 10_000

_log = logging.getLogger("api.keys")


class KeyThrottle:
    """Throttle of refused keys by address; each address regains `per_minute` of them in a minute.

    A key that an address has presented with success passes while others are throttled there, so
    that a client guessing behind a proxy does not lock out those who work behind it. A new client
    behind that proxy has to wait until a try is free. Memory is bounded: the addresses and keys
    seen least recently are forgotten.
    """

    def __init__(self, per_minute: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._most = float(per_minute)
        self._clock = clock
        # address -> when all of its refusals would be forgiven, in s of the clock
        self._forgiven_at: OrderedDict[str, float] = OrderedDict()
        self._proven: OrderedDict[bytes, None] = OrderedDict()
        self._seldom = SeldomLog(_log)

    def admit(self, address: str, presented: str) -> None:
        """Raise KeysThrottled if the address has to wait before it may present this key."""
        wait = self._wait_s(network_of(address))
        if wait > 0.0 and _proof(address, presented) not in self._proven:
            self._seldom.warn("throttled", "keys of an address are throttled", address=address)
            raise KeysThrottled(
                f"too many refused keys from this address (up to {self._most:g} a minute); "
                f"try again in {math.ceil(wait)} s",
                retry_after_s=wait,
            )

    def accepted(self, address: str, presented: str) -> None:
        """Remember that the address has presented a known key."""
        proof = _proof(address, presented)
        self._proven[proof] = None
        self._proven.move_to_end(proof)
        if len(self._proven) > _MOST_PROVEN:
            self._proven.popitem(last=False)

    def refused(self, address: str) -> None:
        """Count a refused key, and log it with its address."""
        _log.warning("key refused", extra={"address": address})
        network, now = network_of(address), self._clock()
        forgiven = max(now, self._forgiven_at.get(network, now)) + _MINUTE_S / self._most
        self._forgiven_at[network] = forgiven
        self._forgiven_at.move_to_end(network)
        if len(self._forgiven_at) > _MOST_ADDRESSES:
            self._forgiven_at.popitem(last=False)

    def _wait_s(self, network: str) -> float:
        """Time until one more refusal is within the limit, in s; 0 if it is now."""
        left = self._forgiven_at.get(network, -math.inf) - self._clock()
        if left <= 0.0:
            self._forgiven_at.pop(network, None)
            return 0.0
        return max(0.0, left - _MINUTE_S + _MINUTE_S / self._most)


def _proof(address: str, key: str) -> bytes:
    return hashlib.sha256(f"{network_of(address)} {key}".encode(errors="surrogatepass")).digest()


# --- owners ---------------------------------------------------------------------------------------


LOCAL_OWNER = "local"
"""Owner of everything while no keys are configured."""

_BEARER = HTTPBearer(
    auto_error=False,
    scheme_name="ApiKey",
    description="One of the keys that the service was given; not needed where it has none.",
)
_Credentials = Annotated[HTTPAuthorizationCredentials | None, Depends(_BEARER)]

_LOOK_EVERY_S = 1.0


class Keyring:
    """Digests of the keys of the settings and of their file, each with its owner.

    The file is read again when it has changed, at most once a second. While it is invalid, the
    previous keys stay and the log says why.
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
        """Number that grows with each change of the keys."""
        self._look()
        return self._version

    def admits(self, owner: str, digest: bytes) -> bool:
        """Return whether the key with a digest still belongs to an owner."""
        return not self._asks or (digest, owner) in self._owners

    def owner_of(self, presented: str | None) -> str:
        """Return the owner of a presented key; without configured keys always LOCAL_OWNER.

        Raises Unauthorized for a missing or unknown key. The time it takes reveals nothing about
        the keys: every digest is compared, to its last byte.
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
        """Adopt the keys of the file; raises InputError if they are invalid."""
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
        throttle.admit(address, credentials.credentials)
        try:
            owner = keyring.owner_of(credentials.credentials)
        except Unauthorized:
            throttle.refused(address)
            raise
        throttle.accepted(address, credentials.credentials)
    request.state.owner = owner
    return owner


CurrentOwner = Annotated[str, Depends(_current_owner)]
"""Parameter type of a route: the owner of the request's key, or 401."""


async def _current_key(_owner: CurrentOwner, credentials: _Credentials) -> bytes:
    return _digest(credentials.credentials if credentials else "")


CurrentKey = Annotated[bytes, Depends(_current_key)]
"""Parameter type of a route: the digest of the request's key, for Keyring.admits."""


def refuse_exposure(settings: Settings, *, worker: bool = False) -> None:
    """Raise InputError if other machines can reach a service, or a worker, without keys."""
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
    """Whether only this machine can reach `host`; all addresses of a name count."""
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
