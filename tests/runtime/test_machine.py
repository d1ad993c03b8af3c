"""How many cores and how much memory a process may use, in control groups as the kernel's."""

import os
from pathlib import Path

import pytest

from syncplan.runtime.child_processes import ChildProcess, connect_to_parent
from syncplan.runtime.machine import limit_memory, usable_cores, usable_memory

SYSTEMD = "1:name=systemd:/service"
MANY = 64


@pytest.fixture(autouse=True)
def _many_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(MANY), raising=False)


def process(folder: Path, cgroup: str, *mounts: str) -> Path:
    """Return a folder as /proc/PID would be, for a process in these groups."""
    mounts = mounts or (f"/ {folder / 'cgroup'} rw - cgroup2 cgroup2 rw",)
    place = folder / "proc"
    place.mkdir()
    (place / "cgroup").write_text(f"{SYSTEMD}\n{cgroup}\n")
    lines = [f"3{k} 23 0:2{k} {mount}\n" for k, mount in enumerate(mounts)]
    (place / "mountinfo").write_text(
        "22 1 8:1 / / rw,relatime - ext4 /dev/sda rw\n" + "".join(lines)
    )
    return place


def group(folder: Path, **files: str) -> Path:
    """Make a control group with these files."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name.replace("_", ".", 1)).write_text(f"{text}\n")
    return folder


@pytest.mark.parametrize(
    ("quota", "cores"),
    [("200000 100000", 2), ("150000 100000", 2), ("5000 100000", 1), ("max 100000", MANY)],
)
def test_a_quota_counts_rounded_up_and_none_leaves_all(
    tmp_path: Path, quota: str, cores: int
) -> None:
    group(tmp_path / "cgroup/service", cpu_max=quota)
    assert usable_cores(process(tmp_path, "0::/service")) == cores


def test_the_tightest_group_above_decides(tmp_path: Path) -> None:
    top = tmp_path / "cgroup"
    group(top / "slice", cpu_max="300000 100000")
    group(top / "slice/service", cpu_max="max 100000")
    group(tmp_path, cpu_max="100000 100000")  # above the mount: no group
    # a mount without a source is passed over
    mounts = ("/ /scratch rw - tmpfs  rw", f"/ {top} rw - cgroup2 cgroup2 rw,nsdelegate")
    assert usable_cores(process(tmp_path, "0::/slice/service", *mounts)) == 3


def test_a_container_sees_its_own_group_as_the_topmost(tmp_path: Path) -> None:
    top = group(tmp_path / "cgroup", cpu_max="400000 100000")
    group(top / "inner", cpu_max="200000 100000")
    mount = f"/docker/4f {top} ro - cgroup2 cgroup2 rw"
    assert usable_cores(process(tmp_path, "0::/docker/4f/inner", mount)) == 2
    (tmp_path / "proc/cgroup").write_text("0::/docker/4f\n")
    assert usable_cores(tmp_path / "proc") == 4
    # without a name space for groups, the path may lie outside what is mounted
    (tmp_path / "proc/cgroup").write_text("0::/docker/other\n")
    assert usable_cores(tmp_path / "proc") == 4


def test_version_1_has_a_tree_for_each_controller(tmp_path: Path) -> None:
    cpu, memory = tmp_path / "cpu,cpuacct", tmp_path / "memory"
    quota = {"cpu_cfs_quota_us": "250000", "cpu_cfs_period_us": "100000"}
    group(cpu / "service", **quota, memory_limit_in_bytes=str(2**20))
    group(cpu, cpu_cfs_quota_us="-1", cpu_cfs_period_us="100000")
    group(memory / "service", cpu_max="100000 100000", memory_limit_in_bytes=str(2**21))
    place = process(
        tmp_path,
        "5:cpu,cpuacct:/service\n4:memory:/service\n0::/service",
        f"/ {memory} rw - cgroup cgroup rw,memory",
        f"/ {cpu} rw - cgroup cgroup rw,cpu,cpuacct",
    )
    assert usable_cores(place) == 3
    assert usable_memory(place) == 2**21


def test_no_quota_allows_more_than_the_scheduler(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(2), raising=False)
    group(tmp_path / "cgroup", cpu_max="800000 100000")
    assert usable_cores(process(tmp_path, "0::/")) == 2


@pytest.mark.parametrize("text", ["", "soon", "200000", "a b"])
def test_what_cannot_be_read_limits_nothing(tmp_path: Path, text: str) -> None:
    group(tmp_path / "cgroup", cpu_max=text)
    assert usable_cores(process(tmp_path, "0::/")) == MANY
    assert usable_cores(tmp_path / "nowhere") == MANY


# --- memory ---------------------------------------------------------------------------------------


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
    child = ChildProcess("tests.runtime.test_machine", "allocate")
    child.connection.send((2**28, 2**20, 2**29, 2**20))
    assert [child.connection.recv() for _ in range(3)] == [2**20, "MemoryError", 2**20]
    child.end()


@pytest.mark.parametrize(("limit", "usable"), [("1048576", 2**20), ("max", None)])
def test_a_container_may_use_what_its_group_may(
    tmp_path: Path, limit: str, usable: int | None
) -> None:
    top = group(tmp_path / "cgroup", memory_max="4294967296000000")
    group(top / "service", memory_max=limit)
    place = process(tmp_path, "0::/service")
    everything = usable_memory(tmp_path / "nothing")
    assert usable_memory(place) == (everything if usable is None else usable)
