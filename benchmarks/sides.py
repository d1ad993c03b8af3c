"""Two checkouts that take turns: each a process of its own that times what it is asked for."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

__all__ = ["Side", "answer", "served_side"]

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
