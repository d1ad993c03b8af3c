"""At a terminal, commands that take long say so before they load what takes long."""

import subprocess
import sys
from typing import Any

import pytest

from tests.tools.processes import PATIENCE_S
from tests.tools.scenarios import FILES

GRID = str(FILES / "paper-grid-same.yaml")
SLOW = ("numba", "casadi", "scipy", "numpy", "rich", "syncplan.planning.planner")

CODE = f"""
import io, os, sys

class Terminal(io.StringIO):
    def isatty(self):
        return True

    def write(self, text):
        loaded = [name for name in {SLOW} if name in sys.modules]
        os.write(1, f"{{text}}{{loaded}}".encode())
        os._exit(0)

sys.stderr = Terminal()
from syncplan.cli.command_line import main
main(sys.argv[1:])
"""


@pytest.mark.parametrize(
    ("command", "run"), [("validate", "trials"), ("fly", "flights"), ("refine", "the search")]
)
def test_a_first_line_comes_before_what_takes_long(command: str, run: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", CODE, command, GRID],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=True,
    )
    assert done.stdout == f"syncplan: reading {GRID}, preparing {run} ...\n[]"


def test_a_pipe_gets_no_such_line(run: Any) -> None:
    _, _, err = run("validate", GRID, "--trials", "1", "--duration", "2")
    assert "preparing" not in err
