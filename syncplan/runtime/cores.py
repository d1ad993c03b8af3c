"""How many cores this process may use, by the scheduler and by the quota of its control group; and
how many threads of its own it runs.
"""

import contextlib
import math
import os
from collections.abc import Iterator
from pathlib import Path

from syncplan.errors import InputError
from syncplan.runtime.control_groups import groups_of


def threads_for(asked: int | None) -> int:
    """Return how many threads to run: as many as are asked for, one for each core if None.

    Raises InputError, key `threads`, for fewer than 1.
    """
    if asked is not None and asked < 1:
        raise InputError(f"{asked} given, at least 1 is needed", key="threads")
    return usable_cores() if asked is None else asked


def usable_cores(proc: Path = Path("/proc/self")) -> int:
    """Return the number of cores that this process may use, at least 1.

    The scheduler's affinity bounds it, and so does the quota of processor time of its control
    group and of every group above, rounded up: Documentation/admin-guide/cgroup-v2.rst of the
    kernel, section "CPU Interface Files" (`cpu.max`), and for version 1 scheduler/sched-bwc.rst.
    `proc` is the folder of the process in /proc.
    """
    affinity = getattr(os, "sched_getaffinity", None)
    cores = len(affinity(0)) if affinity is not None else os.cpu_count() or 1
    return max(1, min([cores, *map(math.ceil, _quotas(proc))]))


def _quotas(proc: Path) -> Iterator[float]:
    """The cores' worth of time that each group allows this process; none where none is limited."""
    for folder in groups_of(proc, "cpu"):
        with contextlib.suppress(OSError, ValueError):
            quota, period = (folder / "cpu.max").read_text().split()
            if quota != "max":
                yield int(quota) / int(period)
        with contextlib.suppress(OSError, ValueError):
            quota_us = int((folder / "cpu.cfs_quota_us").read_text())
            if quota_us > 0:
                yield quota_us / int((folder / "cpu.cfs_period_us").read_text())
