"""How many cores this process may use, by the scheduler and by the quota of its control group."""

import contextlib
import math
import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

__all__ = ["usable_cores"]


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
    for folder in _groups(proc):
        with contextlib.suppress(OSError, ValueError):
            quota, period = (folder / "cpu.max").read_text().split()
            if quota != "max":
                yield int(quota) / int(period)
        with contextlib.suppress(OSError, ValueError):
            quota_us = int((folder / "cpu.cfs_quota_us").read_text())
            if quota_us > 0:
                yield quota_us / int((folder / "cpu.cfs_period_us").read_text())


def _groups(proc: Path) -> Iterator[Path]:
    """The folders of this process's control groups, each with those above it."""
    try:
        groups = (proc / "cgroup").read_text().splitlines()
        mounts = (proc / "mountinfo").read_text().splitlines()
    except (OSError, UnicodeDecodeError):
        return
    # lines such as 4:cpu,cpuacct:/service, and 0::/service for version 2
    paths = {}
    for line in groups:
        _, controllers, path = line.split(":", 2)
        paths.update(dict.fromkeys(controllers.split(","), PurePosixPath(path)))
    for line in mounts:
        # ... root mount options [fields] - type source options
        place, _, filesystem = line.partition(" - ")
        root, mount = place.split()[3:5]
        kind, _, options = filesystem.split(maxsplit=2)
        controller = "" if kind == "cgroup2" else "cpu"
        if not kind.startswith("cgroup") or (controller and "cpu" not in options.split(",")):
            continue
        group = paths.get(controller)
        if group is None:
            continue
        # a container may see its own group alone, mounted as if it were the topmost
        inside = group.relative_to(root) if group.is_relative_to(root) else PurePosixPath()
        folder = Path(mount, inside)
        yield folder
        yield from (one for one in folder.parents if one.is_relative_to(mount))
