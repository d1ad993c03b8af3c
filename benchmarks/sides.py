"""Processes that are timed: two checkouts that take turns, and whole commands with their memory."""

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

__all__ = ["Side", "answer", "metered", "served_side"]

OPTION = "--serve"


class Side:
    """A process that runs a benchmark's script with the library of a checkout.

    Parameters
    ----------
    script : which calls `answer` where it is run by this process
    path : of the checkout
    """

    def __init__(self, script: str, path: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, script, OPTION, str(path.resolve())],
            cwd=path,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, request: str) -> tuple[float, str]:
        """Return processor time in s and a digest of what was made."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(request, file=self._process.stdin, flush=True)
        seconds, digest = json.loads(self._process.stdout.readline())
        return float(seconds), str(digest)

    def end(self) -> None:
        """End the process."""
        self._process.communicate()


def served_side() -> Path | None:
    """Return the checkout whose library this process is to measure; None where it serves none."""
    return Path(sys.argv[2]) if sys.argv[1:2] == [OPTION] else None


def answer(timed: Callable[[str], tuple[float, str]]) -> None:
    """Answer each line of standard input with what `timed` returns: s and a digest."""
    for line in sys.stdin:
        print(json.dumps(timed(line.strip())), flush=True)


_METER = """
import json, resource, subprocess, sys, time
begin = time.perf_counter()
done = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
seconds = time.perf_counter() - begin
unit = 1 << 20 if sys.platform == "darwin" else 1024
peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / unit
print(json.dumps([done.returncode, seconds, peak]))
sys.stderr.write(done.stderr)
"""
"""Run by an interpreter of its own: the peak of a child starts with that of who forks it."""


def metered(command: Sequence[str], folder: Path) -> tuple[float, float]:
    """Return s and MB at the peak of a command run in a folder. Raises RuntimeError if it fails."""
    done = subprocess.run(
        [sys.executable, "-c", _METER, *command],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    status, seconds, peak = json.loads(done.stdout)
    if status != 0:
        raise RuntimeError(f"{' '.join(command)}: exit status {status}, {done.stderr}")
    return float(seconds), float(peak)
