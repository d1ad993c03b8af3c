"""The control groups of a process: where Linux keeps what a container may use."""

from collections.abc import Iterator
from pathlib import Path, PurePosixPath


def groups_of(proc: Path, controller: str) -> Iterator[Path]:
    """Return the folders of a process's control groups, each with those above it; maybe none.

    `proc` is its folder in /proc; `controller` counts in version 1 of control groups, such as
    "cpu" or "memory"; version 2 has one group for all.
    """
    try:
        groups = (proc / "cgroup").read_text().splitlines()
        mounts = (proc / "mountinfo").read_text().splitlines()
    except (OSError, UnicodeDecodeError):
        return
    # lines such as 4:cpu,cpuacct:/service, and 0::/service for version 2
    paths = {}
    for line in groups:
        _, controllers, path = line.split(":", 2)
        paths.update(dict.fromkeys(controllers.split(","), PurePosixPath(path)))
    for line in mounts:
        # ... root mount options [fields] - type source options
        place, _, filesystem = line.partition(" - ")
        root, mount = place.split()[3:5]
        # the source may be empty
        kind, *_, options = filesystem.split()
        wanted = "" if kind == "cgroup2" else controller
        if not kind.startswith("cgroup") or (wanted and wanted not in options.split(",")):
            continue
        group = paths.get(wanted)
        if group is None:
            continue
        # a container may see its own group alone, mounted as if it were the topmost
        inside = group.relative_to(root) if group.is_relative_to(root) else PurePosixPath()
        folder = Path(mount, inside)
        yield folder
        yield from (one for one in folder.parents if one.is_relative_to(mount))
