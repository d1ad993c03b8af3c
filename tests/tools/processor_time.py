"""Where processor time goes: of a command with all it starts, or of tests as a plugin for pytest.

    python -m tests.tools.processor_time make check
    python -m pytest -p tests.tools.processor_time --numprocesses 3 -m "not long"

The plugin shows folders, files and tests. Its times are of the process and of its children that
have ended, so that servers and browsers count where they end, and what a killed server had started
counts nowhere. Of a command, that counts as well: orphans become children of this process (Linux).
"""

import ctypes
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest

SHOWN = 50
_PR_SET_CHILD_SUBREAPER = 36

_spent: dict[str, Any] = {"folder": Counter(), "file": Counter(), "test": Counter()}
_before = 0.0


def pytest_runtest_logstart() -> None:
    """Begin to count."""
    global _before
    _before = sum(os.times()[:4])


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport() -> Iterator[None]:
    """Note in a report how long its phase took: set-up with fixtures, the test, tear-down."""
    global _before
    outcome: Any = yield
    now = sum(os.times()[:4])
    outcome.get_result().processor_s = now - _before
    _before = now


def pytest_runtest_logreport(report: Any) -> None:
    """Add up what reports say, those of other processes too."""
    file, _, _ = report.nodeid.partition("::")
    parts = {"folder": "/".join(file.split("/")[:2]), "file": file, "test": report.nodeid}
    for kind, name in parts.items():
        _spent[kind][name] += getattr(report, "processor_s", 0.0)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print what took longest."""
    for kind, spent in _spent.items():
        terminalreporter.section(f"processor time by {kind}, {spent.total():.0f} s in all")
        for name, seconds in spent.most_common(SHOWN):
            terminalreporter.write_line(f"{seconds:8.2f} s  {name}")


def main(command: list[str]) -> int:
    """Run a command, print the time of all processes that have ended, and return its status."""
    ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)
    began, status = time.monotonic(), None
    first = os.spawnvp(os.P_NOWAIT, command[0], command)
    while status is None:
        ended, code = os.wait()
        if ended == first:
            status = os.waitstatus_to_exitcode(code)
    took, times = time.monotonic() - began, os.times()
    user, system = times.children_user, times.children_system
    print(f"{user + system:.1f} s of processor time, {took:.1f} s of wall time", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
