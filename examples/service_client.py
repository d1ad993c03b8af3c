"""Plan, refine and validate through the service: the client returns the library's own types.

Starts a service in a temporary folder, or asks the one at the address given:

    python examples/service_client.py [URL [API_KEY]]
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import syncplan

SCENARIO = Path(__file__).parent / "scenarios" / "paper-grid-alternate.yaml"


@dataclass(frozen=True, slots=True)
class Cure:
    """Monte Carlo before and after, computed by the service."""

    before: syncplan.Validation
    after: syncplan.Validation


def main(url: str | None = None, api_key: str | None = None, *, trials: int = 200) -> Cure:
    """Return the validations of the degenerate grid as planned and as refined."""
    if url is None:
        with _service() as own:
            return main(own, trials=trials)
    with syncplan.Client(url, api_key) as client:
        plan = client.plan(syncplan.load_scenario(SCENARIO))
        better = client.wait(client.refine(plan, starts=1))
        # both are handed in before either is waited for
        jobs = [client.validate(one, trials=trials, seed=1) for one in (plan, better)]
        before, after = (client.wait(job) for job in jobs)
    return Cure(before, after)


@contextmanager
def _service() -> Iterator[str]:
    """The address of a service of one's own, which ends with the block."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith("SYNCPLAN_")}
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        with log.open("wb") as errors:
            process = subprocess.Popen(
                [sys.executable, "-m", "syncplan", "serve", "--port", "0"],
                env={**kept, "SYNCPLAN_DATA_DIR": f"{folder}/data"},
                stderr=errors,
            )
        try:
            yield _address(process, log)
        finally:
            process.terminate()
            process.wait()


def _address(process: "subprocess.Popen[bytes]", log: Path) -> str:
    """Where a service is: the first line of its log says it."""
    while "\n" not in (said := log.read_text()):
        if process.poll() is not None:
            raise RuntimeError(f"the service ended: {said}")
        time.sleep(0.05)
    message: str = json.loads(said.splitlines()[0])["message"]
    return message.removeprefix("serving at ")


if __name__ == "__main__":
    cure = main(*sys.argv[1:3])
    for label, report in (("as planned", cure.before), ("refined", cure.after)):
        predicted, found = report.predicted, report.accuracy.late_position
        assert predicted is not None
        print(f"{label:11} predicted m {predicted.round(2)}")
        print(f"{'':11} found m     {found.round(2)}")
