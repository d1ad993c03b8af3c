"""What /proc says of processes: their children, whether they live, how long they have computed."""

import contextlib
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

__all__ = [
    "PATIENCE_S",
    "alive",
    "command",
    "family",
    "memory",
    "memory_given_back",
    "proportional_memory",
    "wait_until",
    "worked",
]

PATIENCE_S = 300.0
"""How long to wait for what comes true in a few seconds, in s: the machine may have other work."""

LARGEST_GROWTH = 1.1
"""Share of the memory held before an attack that may be held after it."""

_TICKS = os.sysconf("SC_CLK_TCK")


def wait_until(
    condition: Callable[[], bool],
    seconds: float = PATIENCE_S,
    otherwise: Callable[[], str] | None = None,
    every_s: float = 0.05,
) -> None:
    """Wait for a condition, looked at every so often; fail if it does not come true in time."""
    deadline = time.monotonic() + seconds
    while not condition():
        problem = otherwise() if otherwise is not None else f"not in {seconds} s"
        assert time.monotonic() < deadline, problem
        time.sleep(every_s)


def alive(process: int) -> bool:
    """Return whether a process is there, and not its exit status alone."""
    fields = _stat(process)
    return bool(fields) and fields[0] != "Z"


def command(process: int) -> str:
    """Return the command line of a process; nothing if there is none."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{process}/cmdline").read_text()
    return ""


def family(process: int, generations: int = 100) -> list[int]:
    """Return a process and all that come of it, of so many generations at most."""
    parents = {int(entry): _stat(int(entry)) for entry in os.listdir("/proc") if entry.isdigit()}
    members, newest = [process], [process]
    for _ in range(generations):
        newest = [child for child, fields in parents.items() if fields and int(fields[1]) in newest]
        members += newest
    return members


def memory(process: int) -> int:
    """Return the bytes of memory that a process holds (RSS)."""
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def proportional_memory(process: int) -> int:
    """Return a process's bytes of memory, shared ones divided among their holders (PSS)."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{process}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return int(line.split()[1]) * 2**10
    return 0


@contextlib.contextmanager
def memory_given_back(process: int) -> Iterator[None]:
    """Fail if a process holds a tenth more memory after what is done within than before."""
    before = memory(process)
    yield
    after = memory(process)
    growth = f"{before / 2**20:.0f} MiB before, {after / 2**20:.0f} MiB after"
    assert after < LARGEST_GROWTH * before, growth


def worked(process: int) -> float:
    """Return the processor time in s that a process and all that come of it have taken."""
    fields = filter(None, map(_stat, family(process)))
    return sum(int(one[11]) + int(one[12]) for one in fields) / _TICKS


def _stat(process: int) -> list[str]:
    """The fields of /proc/PID/stat from the state on; none if there is no such process."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return []
