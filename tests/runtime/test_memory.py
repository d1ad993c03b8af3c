"""How much memory a process may use: the machine's, or its container's."""

from pathlib import Path

import pytest

from syncplan.runtime.child_processes import ChildProcess, connect_to_parent
from syncplan.runtime.machine import limit_memory, usable_memory
from tests.runtime.test_cores import group, process


def allocate(descriptor: int) -> None:
    """Allocate what the parent asks for, below a limit, and answer how that went."""
    connection = connect_to_parent(descriptor)
    limit, *asked = connection.recv()
    limit_memory(limit)
    for size in asked:
        try:
            connection.send(len(bytearray(size)))
        except MemoryError:
            connection.send("MemoryError")


def test_an_allocation_beyond_the_limit_fails_and_later_ones_do_not() -> None:
    child = ChildProcess("tests.runtime.test_memory", "allocate")
    child.connection.send((2**28, 2**20, 2**29, 2**20))
    assert [child.connection.recv() for _ in range(3)] == [2**20, "MemoryError", 2**20]
    child.end()


@pytest.mark.parametrize(("limit", "usable"), [("1048576", 2**20), ("max", None)])
def test_a_container_may_use_what_its_group_may(
    tmp_path: Path, limit: str, usable: int | None
) -> None:
    top = group(tmp_path / "cgroup", memory_max="4294967296000000")
    group(top / "service", memory_max=limit)
    place = process(tmp_path, "0::/service", f"/ {top} rw - cgroup2 cgroup2 rw")
    everything = usable_memory(tmp_path / "nothing")
    assert usable_memory(place) == (everything if usable is None else usable)


def test_version_1_keeps_memory_in_a_tree_of_its_own(tmp_path: Path) -> None:
    memory = tmp_path / "memory"
    group(memory / "service", memory_limit_in_bytes=str(2**21))
    group(tmp_path / "cpu/service", memory_limit_in_bytes=str(2**20))
    place = process(
        tmp_path,
        "5:cpu:/service\n4:memory:/service",
        f"/ {memory} rw - cgroup cgroup rw,memory",
        f"/ {tmp_path / 'cpu'} rw - cgroup cgroup rw,cpu",
    )
    assert usable_memory(place) == 2**21
