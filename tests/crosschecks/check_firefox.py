"""Check the page in Firefox, of which Playwright would need a version of its own.

    python -m tests.crosschecks.check_firefox

Part of `make check-all`. A team of five over a field comes to missions, by mouse and keyboard.
Fails where the browser complains of anything, axe finds a fault, or the files do not come.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import axe_playwright_python
import numpy as np

from tests.tools.processes import PATIENCE_S
from tests.tools.serving import open_server

AXE = Path(axe_playwright_python.__file__).with_name("axe.min.js")
SCRIPT = Path(__file__).with_name("firefox.mjs")
PROGRAMS = ("firefox-esr", "firefox")
CORNER = [165.0, 40.0]


def main() -> None:
    """Run the script against a service of its own and judge what it prints."""
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        sys.exit("this check needs Firefox: apt-get install firefox-esr")
    beside = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    with (
        tempfile.TemporaryDirectory() as folder,
        open_server(Path(folder), "--no-worker") as server,
    ):
        done = subprocess.run(
            ["node", str(SCRIPT), server.url, str(AXE), program],
            env={**os.environ, "PATH": beside},
            stdout=subprocess.PIPE,
            check=True,
            text=True,
            timeout=PATIENCE_S,
        )
    came = json.loads(done.stdout)
    assert came["complaints"] == [], came["complaints"]
    assert came["violations"] == {}, came["violations"]
    assert came["circles"] == 5
    assert came["mission"].startswith("Exported, "), came["mission"]
    assert len(came["area"]) == 7
    np.testing.assert_allclose(came["area"][2], CORNER, atol=1.0)
    print("Firefox: no complaint, no fault of accessibility, missions for 5 vehicles")


if __name__ == "__main__":
    main()
