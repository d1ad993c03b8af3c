"""The machine: cores and memory that this process may use, its garbage, and its one BLAS thread.

On Linux, control groups hold the limits of a container.

One thread for linear algebra gives the same bytes under any load, and no contention for cores: a
threaded BLAS splits sums by the number of threads it finds, so its last bits depend on the machine;
and two processes whose BLAS threads wait for each other run many times slower than one thread each.
The matrices here are small: one thread costs nothing until a thousand vehicles.
"""

import contextlib
import ctypes
import gc
import math
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from functools import lru_cache, wraps
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from syncplan.errors import InputError

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

_GARBAGE = 200_000
"""Objects made beyond those freed before garbage is looked for."""

_PYTHONS_GARBAGE = 700
_M_MMAP_THRESHOLD = -3


def defer_garbage() -> None:
    """Hardly look for garbage: while a program is loaded, it makes many objects and no garbage."""
    gc.set_threshold(_GARBAGE)


def keep_loaded() -> None:
    """Look for garbage as Python does, but no more among what is loaded by now and stays.

    What was needed to load it is returned to the system.
    """
    trim_memory()
    gc.freeze()
    gc.set_threshold(_PYTHONS_GARBAGE)


def return_memory() -> None:
    """Return blocks of a megabyte or more to the system as soon as they are freed.

    glibc raises the size from which it does so with each block freed, up to 32 MB, and keeps up to
    twice as much for each thread; see M_MMAP_THRESHOLD in mallopt(3). Does nothing elsewhere.
    """
    if sys.platform.startswith("linux"):
        # other C libraries lack the function
        with contextlib.suppress(AttributeError):
            ctypes.CDLL(None).mallopt(_M_MMAP_THRESHOLD, 2**20)


def trim_memory() -> None:
    """Return all free memory to the system, which takes milliseconds; see malloc_trim(3)."""
    if sys.platform.startswith("linux"):
        with contextlib.suppress(AttributeError):
            ctypes.CDLL(None).malloc_trim(0)


def groups_of(proc: Path, controller: str) -> Iterator[Path]:
    """Yield the folders of a process's control groups, if any, each with those above it.

    `proc` is its folder in /proc. `controller`, such as "cpu" or "memory", counts in version 1 of
    control groups; version 2 has one group for all.
    """
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
        # the source may be empty
        kind, *_, options = filesystem.split()
        wanted = "" if kind == "cgroup2" else controller
        if not kind.startswith("cgroup") or (wanted and wanted not in options.split(",")):
            continue
        group = paths.get(wanted)
        if group is None:
            continue
        # a container may see its own group alone, mounted as if it were the topmost
        inside = group.relative_to(root) if group.is_relative_to(root) else PurePosixPath()
        folder = Path(mount, inside)
        yield folder
        yield from (one for one in folder.parents if one.is_relative_to(mount))


# --- cores --------------------------------------------------------------------------------------


def threads_for(asked: int | None) -> int:
    """Return the number of threads to run: `asked`, or one for each core if None.

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
    """Processor time, in cores, that each limited group allows this process."""
    for folder in groups_of(proc, "cpu"):
        with contextlib.suppress(OSError, ValueError):
            quota, period = (folder / "cpu.max").read_text().split()
            if quota != "max":
                yield int(quota) / int(period)
        with contextlib.suppress(OSError, ValueError):
            quota_us = int((folder / "cpu.cfs_quota_us").read_text())
            if quota_us > 0:
                yield quota_us / int((folder / "cpu.cfs_period_us").read_text())


# --- memory -------------------------------------------------------------------------------------


def usable_memory(proc: Path = Path("/proc/self")) -> int | None:
    """Return the bytes of memory that machine and control groups allow; None if unknown.

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
    """Limit the data of this process, and of each of its children, to so many bytes.

    The limit is on data, not on the address space, of which libraries reserve more than they use.
    Allocations beyond it raise MemoryError. Does nothing on systems without such a limit.
    """
    if not sys.platform.startswith("linux"):
        return
    import resource

    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    allowed = limit_bytes if most == resource.RLIM_INFINITY else min(limit_bytes, most)
    resource.setrlimit(resource.RLIMIT_DATA, (allowed, most))


# --- numerical libraries --------------------------------------------------------------------------


P = ParamSpec("P")
R = TypeVar("R")


def single_threaded_blas(function: Callable[P, R]) -> Callable[P, R]:
    """Return `function` wrapped to use a single BLAS thread and restore the caller's setting."""

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        with blas_threads(1):
            return function(*args, **kwargs)

    return limited


def blas_threads(count: int) -> contextlib.AbstractContextManager[Any]:
    """Return a context in which BLAS uses so many threads."""
    context: contextlib.AbstractContextManager[Any] = _libraries(len(sys.modules)).limit(
        limits=count, user_api="blas"
    )
    return context


@lru_cache(maxsize=1)
def _libraries(modules: int) -> "ThreadpoolController":
    """Linear algebra libraries of a process that has imported so many modules.

    Finding them takes two milliseconds, and only an import can add one.
    """
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


# --- convex problems ----------------------------------------------------------------------------


def load_cvxpy() -> Any:
    """Return the module cvxpy; importing it takes most of a second."""
    import cvxpy

    return cvxpy


def has_solution(problem: Any, **settings: Any) -> bool:
    """Solve a cvxpy problem in place and return whether its variables have values.

    `settings` are those of cvxpy.Problem.solve. A solution of low accuracy counts; the problem's
    status distinguishes it.
    """
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Solution may be inaccurate")
            problem.solve(**settings)
    except load_cvxpy().SolverError:
        return False
    return all(variable.value is not None for variable in problem.variables())
