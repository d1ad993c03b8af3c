"""Child processes and their tasks, pool by pool."""

from collections.abc import Callable, Mapping

from api.computing.pool_depth import PoolDepth
from api.metrics import Readings


class PoolReadings:
    """A source of the figures of this process's pools, whose depths are asked for by name."""

    def __init__(self, depths: Mapping[str, Callable[[], PoolDepth]]) -> None:
        self._depths = depths

    def __call__(self) -> Readings:
        """Return what the pools do now."""
        found = {name: depth() for name, depth in self._depths.items()}
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
