"""How much work a pool has: what metrics show of it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PoolDepth:
    """What a pool is at.

    Attributes
    ----------
    processes : child processes that it keeps, with the extra ones there are now
    running, waiting : tasks
    owners : whose tasks wait
    oldest_s : how long the task has waited that has waited longest, 0 if none waits
    started : child processes started since the pool began
    """

    processes: int
    running: int
    waiting: int
    owners: int
    oldest_s: float
    started: int
