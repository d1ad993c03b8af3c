"""Children of a process that compute just now."""

import contextlib
import time
from collections import Counter
from pathlib import Path

from tests.tools.processes import wait_until
from tests.tools.serving import Process
from tests.tools.survival import Site

__all__ = ["at_work", "busy", "on_duty"]


def at_work(site: Site, process: Process) -> set[int]:
    """Return the children of a process that compute for most of half a second, or would if let."""
    seen: Counter[int] = Counter()
    for _ in range(5):
        seen.update(one for one in site.family(process) if _runs(one))
        time.sleep(0.1)
    return {one for one, times in seen.items() if times >= 3}


def _runs(process: int) -> bool:
    """Whether a thread of a process is running or waits for its turn to."""
    for one in Path(f"/proc/{process}/task").glob("*/stat"):
        with contextlib.suppress(OSError):
            if one.read_text().rpartition(")")[2].split()[0] == "R":
                return True
    return False


def busy(site: Site, process: Process, number: int = 1) -> set[int]:
    """Return the children of a process, once that many of them compute."""
    found: set[int] = set()

    def enough() -> bool:
        found.clear()
        found.update(at_work(site, process))
        return len(found) >= number

    wait_until(enough, otherwise=site.logs)
    return found


def on_duty(site: Site, number: int) -> None:
    """Wait until that many workers have started."""
    log = site.folder / "worker.log"
    wait_until(lambda: log.read_text().count('"syncplan.worker"') >= number, otherwise=site.logs)
