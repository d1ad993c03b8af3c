"""How much memory this process may use, and a limit on it that the operating system keeps."""

import contextlib
import os
import sys
from pathlib import Path

from syncplan.runtime.control_groups import groups_of


def usable_memory(proc: Path = Path("/proc/self")) -> int | None:
    """Return the bytes of memory of this machine, or of its control groups; None if unknown.

    Documentation/admin-guide/cgroup-v2.rst of the kernel, section "Memory Interface Files"
    (`memory.max`), and for version 1 memory.rst (`memory.limit_in_bytes`). `proc` is the folder of
    the process in /proc.
    """
    found = []
    with contextlib.suppress(AttributeError, OSError, ValueError):
        found.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    for folder in groups_of(proc, "memory"):
        for name in ("memory.max", "memory.limit_in_bytes"):
            with contextlib.suppress(OSError, ValueError):
                found.append(int((folder / name).read_text()))
    return min(found, default=None)


def limit_memory(limit_bytes: int) -> None:
    """Let no allocation take this process, or a child of it, above so many bytes, each by itself.

    Data count, not the address space, of which libraries reserve more than they use. What goes
    beyond raises MemoryError. Does nothing where the system keeps no such limit.
    """
    if not sys.platform.startswith("linux"):
        return
    import resource

    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    allowed = limit_bytes if most == resource.RLIM_INFINITY else min(limit_bytes, most)
    resource.setrlimit(resource.RLIMIT_DATA, (allowed, most))
