"""Chunks of trials over threads: computed side by side, delivered in order.

Chunks are cut at fixed trial numbers, so neither threads nor division into parts changes a byte;
see `trials`.
"""

import threading
from collections import deque
from collections.abc import Callable, Generator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from syncplan.estimation.trials import CHUNK_TRIALS

Result = TypeVar("Result")


class StoppedError(Exception):
    """The run was interrupted; this chunk will not be read."""


def chunks_in_order(
    compute: Callable[[range, threading.Event], Result], begin: int, end: int, threads: int
) -> Generator[Result]:
    """Return the results of all chunks of the trials, in order, a few computed ahead.

    `compute` takes the trials of a chunk, and an event: where that is set it raises StoppedError.
    Whatever interrupts the caller also stops the threads, each after its present trials.
    """
    pending: deque[Future[Result]] = deque()
    stop = threading.Event()
    with ThreadPoolExecutor(threads) as pool:
        try:
            for start in range(begin, end, CHUNK_TRIALS):
                chunk = range(start, min(start + CHUNK_TRIALS, end))
                pending.append(pool.submit(compute, chunk, stop))
                if len(pending) > 2 * threads:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:
            stop.set()
