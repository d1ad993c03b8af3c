"""Runs whose trials can be computed in parts, on any number of processes and machines."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from typing import Any


class RunOfTrials(ABC):
    """Set-up of a run, whose trials can be computed in parts, anywhere and in any order."""

    __slots__ = ()

    options: Any

    @property
    def trials(self) -> int:
        """Number of trials."""
        return int(self.options.trials)

    @property
    @abstractmethod
    def effort(self) -> float:
        """Approximate work of a trial, relative to other runs."""

    @abstractmethod
    def part(
        self,
        first_trial: int,
        trials: int,
        *,
        threads: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> Any:
        """Return `trials` trials from `first_trial` on, a multiple of CHUNK_TRIALS."""

    @abstractmethod
    def concluded(self, parts: Sequence[Any]) -> Any:
        """Return the result from all parts, in order; its `result` has the trials.

        The bytes do not depend on the division into parts. Raises InputError if parts are missing,
        and NoSolutionError if the filter diverged.
        """

    @staticmethod
    @abstractmethod
    def pack(part: Any) -> bytes:
        """Return a part as bytes, without loss."""

    @staticmethod
    @abstractmethod
    def unpack(data: bytes) -> Any:
        """Return the part that `pack` turned into bytes; raises InputError for other bytes."""

    def whole(
        self, *, threads: int | None = None, progress: Callable[[int], None] | None = None
    ) -> Any:
        """Return the result of all trials."""
        return self.concluded([self.part(0, self.trials, threads=threads, progress=progress)])


def results_of(
    runs: Iterable[RunOfTrials],
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> list[Any]:
    """Return the results of runs, one after the other; `progress` gets the trials done in all."""
    results: list[Any] = []
    before = 0

    def heard(done: int) -> None:
        if progress is not None:
            progress(before + done)

    for run in runs:
        results.append(run.whole(threads=threads, progress=heard))
        before += run.trials
    return results
