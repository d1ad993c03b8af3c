"""A terminal as a reader has one: bash in a window of a hundred columns, one command at a time."""

import contextlib
import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import termios
import time
from collections.abc import Mapping
from pathlib import Path

from tests.tools.processes import PATIENCE_S

__all__ = ["Terminal"]

COLUMNS = 100

_ENDED = "the command has ended with"


class Terminal:
    """Bash in a folder, until it is closed; what it started in the background ends with it."""

    def __init__(self, folder: Path, environment: Mapping[str, str]) -> None:
        self._script = folder.parent / f"{folder.name}.sh"
        self._screen, inside = pty.openpty()
        fcntl.ioctl(inside, termios.TIOCSWINSZ, struct.pack("HHHH", 50, COLUMNS, 0, 0))
        modes = termios.tcgetattr(inside)
        # lines end as they were written
        modes[1] &= ~termios.OPOST
        termios.tcsetattr(inside, termios.TCSANOW, modes)
        self._bash = subprocess.Popen(
            ["bash", "--noprofile", "--norc"],
            cwd=folder,
            env=dict(environment),
            stdin=subprocess.PIPE,
            stdout=inside,
            stderr=inside,
            start_new_session=True,
        )
        os.close(inside)

    def run(self, command: str) -> tuple[int, str]:
        """Return the exit status of a command and what it wrote, output and messages together."""
        self._script.write_text(command, encoding="utf-8")
        # "$?" in a command is the status of the one before
        line = f"(exit ${{status:-0}}); . '{self._script}' </dev/null; status=$?; "
        line += f"echo; echo {_ENDED} $status\n"
        assert self._bash.stdin is not None
        self._bash.stdin.write(line.encode())
        self._bash.stdin.flush()
        shown = b""
        deadline = time.monotonic() + PATIENCE_S
        while not (end := re.search(rf"\n{_ENDED} (\d+)\n".encode(), shown)):
            left = deadline - time.monotonic()
            assert left > 0, f"{command!r} is not done in {PATIENCE_S:g} s: {shown.decode()}"
            if select.select([self._screen], [], [], min(left, 1.0))[0]:
                shown += os.read(self._screen, 65536)
            else:
                assert self._bash.poll() is None, f"{command!r} ended the shell"
        return int(end[1]), shown[: end.start()].decode()

    def close(self) -> None:
        """End bash and all that it started."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._bash.pid, signal.SIGTERM)
        self._bash.wait()
        with contextlib.suppress(ProcessLookupError):
            # a server ends its children first
            time.sleep(0.5)
            os.killpg(self._bash.pid, signal.SIGKILL)
        assert self._bash.stdin is not None
        self._bash.stdin.close()
        os.close(self._screen)
