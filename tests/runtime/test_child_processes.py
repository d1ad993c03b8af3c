"""Child processes: gone with whoever started them, however young, and sparing with memory."""

import platform
from pathlib import Path
from typing import Any

import pytest

from syncplan.runtime.child_processes import ChildProcess
from tests.tools.processes import alive, wait_until
from tests.tools.serving import parent_running


def test_a_child_that_still_imports_goes_with_its_parent(tmp_path: Path) -> None:
    (tmp_path / "slow_to_import.py").write_text(
        f"import time; open({str(tmp_path / 'importing')!r}, 'w').close(); time.sleep(3600.0)"
    )
    code = (
        f"import sys, time; sys.path.append({str(tmp_path)!r}); "
        "from syncplan.runtime.child_processes import ChildProcess; "
        "child = ChildProcess('slow_to_import', 'serve'); "
        "print(child.process.pid, flush=True); time.sleep(3600.0)"
    )
    parent, identifier = parent_running(code)
    child = int(identifier)
    try:
        wait_until((tmp_path / "importing").exists)
        assert alive(child)
    finally:
        parent.kill()
        parent.wait()
    wait_until(lambda: not alive(child))


def answer_of(code: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the first message of a child that serves by this code."""
    (folder / "served.py").write_text(code)
    monkeypatch.syspath_prepend(str(folder))
    child = ChildProcess("served", "serve")
    try:
        return child.connection.recv()
    finally:
        child.kill()
        child.end()


REPEATS = """
import resource
import numpy as np
from syncplan.runtime.child_processes import connect_to_parent

def serve(descriptor):
    connection = connect_to_parent(descriptor)
    for _ in range(2):
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        for _ in range(20):
            [np.ones(300_000) for _ in range(4)]
        faults = resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
    connection.send(faults)
    connection.recv()
"""
"""Arrays of 2.4 MB, four at a time, made again and again."""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="how glibc keeps memory")
def test_a_child_keeps_the_memory_of_one_task_for_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # made afresh each time, they are 47,000 pages
    assert answer_of(REPEATS, tmp_path, monkeypatch) < 2000


GARBAGE = """
import gc
from syncplan.runtime.child_processes import connect_to_parent
from syncplan.runtime.machine import keep_loaded

loading = gc.get_threshold()

def serve(descriptor):
    connection = connect_to_parent(descriptor)
    keep_loaded()
    connection.send((loading[0], gc.get_threshold()[0], gc.get_freeze_count()))
    connection.recv()
"""


def test_a_child_looks_for_garbage_once_it_has_loaded_and_not_in_what_it_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loading, working, kept = answer_of(GARBAGE, tmp_path, monkeypatch)
    assert loading > 100 * working
    assert kept > 10_000
