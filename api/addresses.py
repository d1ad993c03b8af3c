"""Addresses of clients: which of them count as one, and which are of this machine."""

import ipaddress
from functools import lru_cache

_ONE_SITE = 64
"""Bits of an IPv6 address that one site shares: it may take any of the addresses behind them."""


@lru_cache(maxsize=4096)
def network_of(address: str) -> str:
    """Return what an address counts as: an IPv4 address as itself, an IPv6 address as its /64.

    What is no address (a socket of the file system has none) counts as it is written.
    """
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return address
    mapped = getattr(parsed, "ipv4_mapped", None)
    if mapped is not None:
        return str(mapped)
    if parsed.version == 4 or parsed.is_loopback:
        return str(parsed)
    bare = int(parsed) >> _ONE_SITE << _ONE_SITE
    return f"{ipaddress.IPv6Address(bare)}/{_ONE_SITE}"


def is_this_machine(address: str) -> bool:
    """Return whether an IP address is one of loopback. Raises ValueError if it is none."""
    parsed = ipaddress.ip_address(address)
    mapped = getattr(parsed, "ipv4_mapped", None)
    return bool((mapped or parsed).is_loopback)
