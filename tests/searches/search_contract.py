"""Search for an answer that is not as the OpenAPI document says, with schemathesis.

    python -m tests.searches.search_contract [CASES [SEED]]

Part of `make check-all`. The service is a real process that wants a key; its limits keep the jobs
that come of it small. Schemathesis draws about CASES cases over all operations, after its own
examples and edge cases, and follows links for as long.
"""

import math
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.tools.serving import ROOT, Server, running

KEY = "contract-key-0123456789"
OPERATIONS = 18
SMALL_JOBS = {
    "SYNCPLAN_API_KEYS": f"contract:{KEY}",
    "SYNCPLAN_MAX_VEHICLES": "8",
    "SYNCPLAN_MAX_SAMPLES": "600",
    "SYNCPLAN_MAX_TRIALS": "200",
    "SYNCPLAN_MAX_RUN_S": "120",
    "SYNCPLAN_MAX_REFINE_S": "2",
    "SYNCPLAN_MAX_SWEEP_VALUES": "3",
    "SYNCPLAN_MAX_DESIGN_EVALUATIONS": "1000",
    "SYNCPLAN_PLAN_TIMEOUT_S": "60",
    "SYNCPLAN_MAX_RECORDINGS": "5000",
    # a wrong key is to be answered as one, how many ever are sent in a minute
    "SYNCPLAN_MAX_REFUSED_KEYS": "1000000",
}
"""Settings under which no job takes long, nor are there too many recordings or wrong keys."""

_CONFIG = Path(__file__).with_name("contract.toml")
_HOOKS = "tests.searches.contract_cases"
_CASES = re.compile(r"(\d+) generated")


def search(url: str, cases: int, seed: int) -> bool:
    """Print what schemathesis finds at the service at `url`; return whether all is well."""
    each = math.ceil(cases / OPERATIONS)
    done = subprocess.run(
        [
            *(sys.executable, "-m", "schemathesis.cli", "--config-file", str(_CONFIG), "run"),
            f"{url}/openapi.json",
            *("--header", f"Authorization: Bearer {KEY}"),
            *("--max-examples", str(each), "--seed", str(seed)),
            *("--phases", "examples,coverage,fuzzing,stateful"),
            *("--generation-database", "none", "--no-color"),
        ],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
        env={**os.environ, "SCHEMATHESIS_HOOKS": _HOOKS},
    )
    counted = _CASES.search(done.stdout)
    passed = done.returncode == 0
    number = int(counted[1]) if counted else 0
    print(f"{number} cases, as the document says" if passed else done.stdout + done.stderr)
    return passed


def main(cases: int = 2000, seed: int = 1) -> bool:
    """Print what a search comes to, and return whether all is well."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        server = Server(log, port=None, SYNCPLAN_DATA_DIR=folder, **SMALL_JOBS)
        with running(server):
            passed = search(server.url, cases, seed)
        errors = [line for line in log.read_text().splitlines() if '"level": "error"' in line]
    print(*errors, sep="\n")
    return passed and not errors


if __name__ == "__main__":
    sys.exit(not main(*(int(argument) for argument in sys.argv[1:])))
