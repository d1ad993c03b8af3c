"""Child processes and their tasks, pool by pool."""

from collections.abc import Mapping

from api.computing.pool import Pool
from api.metrics import Readings

__all__ = ["PoolReadings"]


class PoolReadings:
    """A source of the figures of this process's pools, by their names."""

    def __init__(self, pools: Mapping[str, Pool]) -> None:
        self._pools = pools

    def __call__(self) -> Readings:
        """Return what the pools do now."""
        running = {name: pool.busy for name, pool in self._pools.items()}
        return {
            "syncplan_processes_busy": {(): sum(running.values())},
            "syncplan_pool_processes": {(name,): pool.size for name, pool in self._pools.items()},
            "syncplan_pool_tasks": {(name, "running"): number for name, number in running.items()},
        }
