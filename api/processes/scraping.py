"""Scrapes of several processes: whoever is scraped gets a sample of every process.

    member 1: scrape --> round: sample? to all --> sampled, sampled, ... --> scraped to member 1

A process that does not answer in time counts with its last sample, one that has ended with what it
had counted by then, so that no counter falls.
"""

import itertools
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from api.metrics import Collected, counted, merged, own

_PATIENCE_S = 1.5


@dataclass(slots=True, eq=False)
class _Round:
    """A scrape that waits for samples of those missing, until its deadline."""

    asker: int
    asked_as: int
    missing: set[int]
    deadline: float
    samples: list[Collected] = field(default_factory=list)


class Scrapes:
    """The scrapes under way, and what is known of every process.

    Parameters
    ----------
    send : sends a process, by its number, a kind of message and a value
    clock : s
    """

    def __init__(
        self,
        send: Callable[[int, str, object], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._send = send
        self._clock = clock
        self._numbers = itertools.count()
        self._rounds: dict[int, _Round] = {}
        self._last: dict[int, Collected] = {}
        self._departed: Collected = []

    @property
    def deadline(self) -> float | None:
        """When `conclude_due` is to be called next, in s of the clock; None if never."""
        return min((one.deadline for one in self._rounds.values()), default=None)

    def ask(self, asker: int, asked_as: int, present: Collection[int]) -> None:
        """Begin a scrape for a process, which knows it by a number of its own."""
        number = next(self._numbers)
        deadline = self._clock() + _PATIENCE_S
        self._rounds[number] = _Round(asker, asked_as, set(present), deadline)
        for member in present:
            self._send(member, "sample", number)

    def sampled(self, member: int, number: int, metrics: Collected) -> None:
        """Take the sample of a process."""
        self._last[member] = metrics
        found = self._rounds.get(number)
        if found is not None and member in found.missing:
            found.missing.remove(member)
            found.samples.append(metrics)
            if not found.missing:
                self._conclude(number)

    def ended(self, member: int) -> None:
        """Keep what a process has counted that is gone."""
        gone = counted(self._last.pop(member, ()))
        self._departed = merged([self._departed, gone])
        for number, one in list(self._rounds.items()):
            one.missing.discard(member)
            if one.asker == member:
                del self._rounds[number]
            elif not one.missing:
                self._conclude(number)

    def conclude_due(self) -> None:
        """Answer the scrapes that have waited long enough."""
        now = self._clock()
        for number in [number for number, one in self._rounds.items() if one.deadline <= now]:
            self._conclude(number)

    def _conclude(self, number: int) -> None:
        one = self._rounds.pop(number)
        late = [own(self._last.get(member, ())) for member in one.missing]
        samples = [*one.samples, *late, self._departed]
        self._send(one.asker, "scraped", (one.asked_as, samples))
