"""Search for an answer that is not as the OpenAPI document says, with schemathesis.

A case is a run of schemathesis, with its number as the seed: about 150 requests over all
operations, after its own examples and a third of its edge cases, in turn; links are followed for as
long. The service is a real process that wants a key; its limits keep the jobs that come of it
small. Fails where schemathesis finds a fault, or the service logs an error.
"""

import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from tests.searches import Search
from tests.tools.serving import ROOT, Server, running

REQUESTS = 150
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


def draw(number: int) -> tuple[list[str], int]:
    """Return what is wrong with a service, and the number of cases that schemathesis had."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        server = Server(log, port=None, SYNCPLAN_DATA_DIR=folder, **SMALL_JOBS)
        with running(server):
            done = subprocess.run(
                [
                    *(sys.executable, "-m", "schemathesis.cli", "--config-file", str(_CONFIG)),
                    *("run", f"{server.url}/openapi.json"),
                    *("--header", f"Authorization: Bearer {KEY}"),
                    *("--max-examples", str(math.ceil(REQUESTS / OPERATIONS))),
                    *("--phases", "examples,coverage,fuzzing,stateful", "--seed", str(number)),
                    *("--generation-database", "none", "--no-color"),
                ],
                capture_output=True,
                text=True,
                check=False,
                cwd=ROOT,
                env={
                    **os.environ,
                    "SCHEMATHESIS_HOOKS": _HOOKS,
                    "SYNCPLAN_CONTRACT_THIRD": str(number % 3),
                },
            )
        faults = [done.stdout + done.stderr] if done.returncode else []
        faults += [line for line in log.read_text().splitlines() if '"level": "error"' in line]
    counted = _CASES.search(done.stdout)
    return faults, int(counted[1]) if counted else 0


def judge(cases: Mapping[int, int], chance: float) -> list[str]:
    """Print the number of cases of schemathesis."""
    print(f"{sum(cases.values())} cases of schemathesis")
    return []


SEARCH = Search(draw, judge, draws=1)
