"""Whose pages may ask a service without keys: those of this machine, by `Host` and `Origin`.

A browser lets any page send simple requests anywhere, and a name that turns from its server to
127.0.0.1 (DNS rebinding) lets a page read the answers too. Keys stop both: no browser adds one on
its own, so with keys nothing is asked here.
"""

import ipaddress
import socket
from collections.abc import Callable, Iterable
from functools import lru_cache

from starlette.types import ASGIApp, Receive, Scope, Send

from api.addresses import is_this_machine
from api.problems import ForeignPage, WrongHost

_LOCAL = frozenset({"localhost"})
_LONGEST_SHOWN = 80
_LONGEST = 320
"""Bytes of the longest host or origin that is looked at: a name has up to 253."""

_MOST_KEPT = 1024
"""Spellings of hosts whose answer is kept."""

_REMEDY = "name it in SYNCPLAN_ALLOWED_HOSTS or set SYNCPLAN_API_KEYS"


class LocalOnly:
    """ASGI middleware that refuses requests for other hosts (421) and from others' pages (403).

    Accepted are localhost, the loopback addresses, the address at which the client reached this
    machine, and the names given. A request without `Origin` does not come from another's page.
    Raises WrongHost and ForeignPage, so it belongs inside of what answers with problems.
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
        """Pass on a request that may be answered; anything but HTTP goes through untouched."""
        if scope["type"] == "http":
            own = (scope.get("server") or ("",))[0]
            for name, value in scope["headers"]:
                if name == b"host" and not self._accepted(value, own):
                    raise WrongHost(_refused("Host", value))
                if name == b"origin" and not self._accepted_origin(value, own):
                    raise ForeignPage(_refused("Origin", value))
        await self.app(scope, receive, send)


def host_name(host: str) -> str:
    """Return the name or address of `host[:port]` in lower case, brackets and last dot left out."""
    if host.startswith("["):
        return host[1:].partition("]")[0].lower()
    return host.partition(":")[0].removesuffix(".").lower()


def _kept(judge: Callable[[bytes, str], bool]) -> Callable[[bytes, str], bool]:
    """Whether a value is accepted, kept for the next time; a larger one than any is not kept."""
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
    """Return the names that lead to what listens at `hosts`, and the `further` ones.

    Beyond loopback, that is also this machine's own name.
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
