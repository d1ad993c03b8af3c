"""How often an address may present a key that is refused, before keys are compared no more."""

import hashlib
import logging
import math
import time
from collections import OrderedDict
from collections.abc import Callable

from api.addresses import network_of
from api.problems import KeysThrottled
from api.seldom_logs import SeldomLog

_MINUTE_S = 60.0
_MOST_ADDRESSES = 10_000
_MOST_PROVEN = 10_000

_log = logging.getLogger("api.keys")


class KeyThrottle:
    """Counts refused keys by address; each address regains `per_minute` of them in a minute.

    A key that an address has presented with success is let through while others are throttled
    there, so who guesses behind a proxy does not lock out those who are at work behind it. A new
    client behind that proxy has to wait for a free second. What is kept is bounded: the addresses
    and keys that were seen least recently are forgotten.
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
        """Remember that the address has a key that is known."""
        proof = _proof(address, presented)
        if proof in self._proven:
            self._proven.move_to_end(proof)
            return
        self._proven[proof] = None
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
        """How long until one more refusal would be within the limit, in s; 0 if it is now."""
        forgiven = self._forgiven_at.get(network)
        if forgiven is None:
            return 0.0
        left = forgiven - self._clock()
        if left <= 0.0:
            del self._forgiven_at[network]
            return 0.0
        return max(0.0, left - _MINUTE_S + _MINUTE_S / self._most)


def _proof(address: str, key: str) -> bytes:
    return hashlib.sha256(f"{network_of(address)} {key}".encode(errors="surrogatepass")).digest()
