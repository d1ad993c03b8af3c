"""Child processes: gone with whoever started them, however young they are."""

import subprocess
import sys
from pathlib import Path

from tests.tools.processes import alive, wait_until

ROOT = Path(__file__).parents[2]


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
    parent = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, cwd=ROOT, text=True
    )
    assert parent.stdout is not None
    with parent.stdout:
        child = int(parent.stdout.readline())
    try:
        wait_until((tmp_path / "importing").exists)
        assert alive(child)
    finally:
        parent.kill()
        parent.wait()
    wait_until(lambda: not alive(child))
