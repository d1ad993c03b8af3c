"""Child processes: gone with whoever started them, however young they are."""

import contextlib
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_a_child_that_still_imports_goes_with_its_parent(tmp_path: Path) -> None:
    (tmp_path / "slow_to_import.py").write_text(
        f"import time; open({str(tmp_path / 'importing')!r}, 'w').close(); time.sleep(60.0)"
    )
    code = (
        f"import sys, time; sys.path.append({str(tmp_path)!r}); "
        "from syncplan.runtime.child_processes import ChildProcess; "
        "child = ChildProcess('slow_to_import', 'serve'); "
        "print(child.process.pid, flush=True); time.sleep(60.0)"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, cwd=ROOT, text=True
    )
    assert parent.stdout is not None
    with parent.stdout:
        child = int(parent.stdout.readline())
    try:
        deadline = time.monotonic() + 20.0
        while not (tmp_path / "importing").exists():
            assert time.monotonic() < deadline
            time.sleep(0.02)
        assert alive(child)
    finally:
        parent.kill()
        parent.wait()
    deadline = time.monotonic() + 2.0
    while alive(child):
        assert time.monotonic() < deadline
        time.sleep(0.02)


def alive(process: int) -> bool:
    """Whether a process is there and not only its exit status."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False
