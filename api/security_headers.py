"""Headers that every answer carries, so that browsers keep to this service what it sends."""

from collections.abc import Iterable

HeaderPair = tuple[bytes, bytes]

ALWAYS: tuple[HeaderPair, ...] = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"permissions-policy", b"camera=(), geolocation=(), microphone=(), payment=(), usb=()"),
)
"""Of all answers. Strict-Transport-Security is the matter of the proxy that speaks TLS."""

UNLESS_GIVEN: tuple[HeaderPair, ...] = (
    (b"cache-control", b"private, no-cache"),
    (b"content-security-policy", b"default-src 'none'; frame-ancestors 'none'"),
)
"""Of answers without a rule of their own: nothing in them is run, framed or kept by proxies."""


def with_security(headers: Iterable[HeaderPair]) -> list[HeaderPair]:
    """Return the headers of an answer, names in lower case, with those above."""
    given = list(headers)
    names = {name for name, _ in given}
    return [*given, *ALWAYS, *(pair for pair in UNLESS_GIVEN if pair[0] not in names)]
