"""A task that goes astray finds no keys, no passwords and no connections in its process."""

import os
from pathlib import Path

import pytest

from tests.attacks.conftest import SECRETS
from tests.tools.api_servers import key_of
from tests.tools.processes import family
from tests.tools.serving import Server


def _environment(process: int) -> dict[str, str]:
    """The environment that a process was started with."""
    entries = Path(f"/proc/{process}/environ").read_bytes().decode().split("\0")
    return dict(entry.split("=", 1) for entry in entries if "=" in entry)


def _open_files(process: int) -> list[str]:
    """What the descriptors of a process stand for."""
    folder = Path(f"/proc/{process}/fd")
    return [os.readlink(folder / number) for number in os.listdir(folder)]


@pytest.mark.long
def test_no_child_inherits_a_key_a_password_or_an_open_file(server: Server) -> None:
    parent, *children = family(server.popen.pid)
    assert _environment(parent)["PGPASSWORD"] == SECRETS["PGPASSWORD"]
    assert any("syncplan.db" in one for one in _open_files(parent))
    assert len(children) >= 2
    for child in children:
        environment = _environment(child)
        held = [value for value in environment.values() if "not-for-children" in value]
        assert not held
        assert key_of("ann") not in str(environment)
        assert not [name for name in environment if name.startswith(("SYNCPLAN_", "PG"))]
        assert environment["PATH"] == _environment(parent)["PATH"]
        files = _open_files(child)
        assert not [one for one in files if "syncplan.db" in one]
        # the pipe to its parent; everything else of the parent's stays there
        assert len([one for one in files if one.startswith("socket:")]) == 1, files
