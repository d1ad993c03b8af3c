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
        found = {name: pool.depth() for name, pool in self._pools.items()}
        tasks: dict[tuple[str, ...], float] = {}
        for name, depth in found.items():
            tasks[name, "running"] = depth.running
            tasks[name, "waiting"] = depth.waiting
        return {
            "syncplan_processes_busy": {(): sum(one.running for one in found.values())},
            "syncplan_pool_processes": {(name,): one.processes for name, one in found.items()},
            "syncplan_pool_tasks": tasks,
            "syncplan_pool_owners_waiting": {(name,): one.owners for name, one in found.items()},
            "syncplan_pool_oldest_waiting_seconds": {
                (name,): one.oldest_s for name, one in found.items()
            },
            "syncplan_pool_children_started": {(name,): one.started for name, one in found.items()},
        }
