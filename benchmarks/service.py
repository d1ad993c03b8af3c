"""The service on loopback, client and server on the same cores, each figure from a real server.

Plans made and plans read a second, with the slowest of a hundred; how long a sign of life takes
while a validation runs; and what it costs that a Monte Carlo is cut into durable parts, beside the
same trials by the library.

    python benchmarks/service.py
"""

import http.client
import json
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

import syncplan
from benchmarks import Figure, print_figures
from syncplan.reports.validation_report import validation_document
from syncplan.runtime.files import as_text
from tests.tools.scenarios import example
from tests.tools.serving import Server, running

GRID = "paper-grid-alternate"
LOAD_S = 10.0
SHORT_TRIALS = 2000
BARE_S = 60.0
_CONNECTIONS = {"plans": 4, "reads": 8}
_PAUSE_S = 0.005

Request = Callable[[http.client.HTTPConnection], int]


def load(url: str, connections: int, seconds: float, request: Request, wanted: int) -> list[float]:
    """Return the seconds each request took, from connections that each ask again when answered.

    Raises RuntimeError for an answer with another status than the one wanted.
    """
    address = urlsplit(url).netloc
    taken: list[list[float]] = [[] for _ in range(connections)]
    wrong: list[int] = []
    end = time.perf_counter() + seconds

    def ask(own: list[float]) -> None:
        connection = http.client.HTTPConnection(address, timeout=30.0)
        while time.perf_counter() < end and not wrong:
            began = time.perf_counter()
            status = request(connection)
            own.append(time.perf_counter() - began)
            if status != wanted:
                wrong.append(status)
        connection.close()

    threads = [threading.Thread(target=ask, args=(own,)) for own in taken]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if wrong:
        raise RuntimeError(f"answered with {wrong[0]}, not {wanted}")
    return [one for own in taken for one in own]


def plans_under_load(url: str, body: bytes) -> list[float]:
    """Return the seconds that POST /v1/plans took, again and again."""

    def post(connection: http.client.HTTPConnection) -> int:
        connection.request("POST", "/v1/plans", body, {"content-type": "application/json"})
        answer = connection.getresponse()
        answer.read()
        return answer.status

    load(url, _CONNECTIONS["plans"], 1.0, post, 201)
    return load(url, _CONNECTIONS["plans"], LOAD_S, post, 201)


def reads_under_load(url: str, path: str) -> list[float]:
    """Return the seconds that GET of a path took, again and again."""

    def get(connection: http.client.HTTPConnection) -> int:
        connection.request("GET", path)
        answer = connection.getresponse()
        answer.read()
        return answer.status

    return load(url, _CONNECTIONS["reads"], LOAD_S, get, 200)


def signs_of_life(client: syncplan.Client, url: str, plan_id: str) -> list[float]:
    """Return the seconds that GET /healthz took while a validation ran."""
    connection = http.client.HTTPConnection(urlsplit(url).netloc, timeout=30.0)
    job = client.validate(plan_id, trials=SHORT_TRIALS, seed=1)
    taken = []
    while True:
        began = time.perf_counter()
        connection.request("GET", "/healthz")
        connection.getresponse().read()
        taken.append(time.perf_counter() - began)
        time.sleep(_PAUSE_S)
        if len(taken) % 40 == 0 and client.job(job.id).ended:
            connection.close()
            return taken


def durable_and_bare(client: syncplan.Client, plan_id: str) -> dict[str, float]:
    """Return the seconds of the same Monte Carlo as a job and by the library, and its trials.

    The library runs before the job and after it, so that a machine whose pace changes favours
    neither; its time is the mean. Raises RuntimeError where the two reports differ.
    """
    plan = syncplan.plan(example(GRID))
    began = time.perf_counter()
    syncplan.validate(plan, trials=SHORT_TRIALS, seed=1)
    trials = round(SHORT_TRIALS * BARE_S / (time.perf_counter() - began))
    bare_s = []

    def by_the_library() -> syncplan.Validation:
        began = time.perf_counter()
        found = syncplan.validate(plan, trials=trials, seed=1)
        bare_s.append(time.perf_counter() - began)
        return found

    bare = by_the_library()
    began = time.perf_counter()
    job = client.validate(plan_id, trials=trials, seed=1)
    while not client.job(job.id).ended:
        time.sleep(0.05)
    durable_s = time.perf_counter() - began
    reports = [as_text(validation_document(one).as_json()) for one in (bare, client.wait(job))]
    if reports[0] != reports[1]:
        raise RuntimeError("the job's report is not the library's")
    by_the_library()
    return {"bare_s": sum(bare_s) / 2.0, "durable_s": durable_s, "trials": float(trials)}


def main() -> dict[str, float]:
    """Return the figures of the service."""
    values = example(GRID).model_dump(mode="json", exclude_none=True)
    body = json.dumps(values).encode()
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder)
        server = Server(data / "log", SYNCPLAN_DATA_DIR=str(data))
        with running(server), syncplan.Client(server.url) as client:
            plan_id = client.plan(values).id
            client.wait(client.validate(plan_id, trials=1))
            plans = plans_under_load(server.url, body)
            reads = reads_under_load(server.url, f"/v1/plans/{plan_id}")
            signs = signs_of_life(client, server.url, plan_id)
            long = durable_and_bare(client, plan_id)
    return {
        "plans_a_second": len(plans) / LOAD_S,
        "plans_p99_s": float(np.percentile(plans, 99)),
        "reads_a_second": len(reads) / LOAD_S,
        "reads_p99_s": float(np.percentile(reads, 99)),
        "signs_p99_s": float(np.percentile(signs, 99)),
        "overhead_percent": 100.0 * (long["durable_s"] / long["bare_s"] - 1.0),
        **long,
    }


def figures(result: dict[str, float]) -> list[Figure]:
    """Return what is shown of a result."""
    trials = f"{result['trials']:,.0f} trials"
    return [
        Figure("service: POST /v1/plans, 6 vehicles", result["plans_a_second"], "/s", 60.0),
        Figure("service: POST /v1/plans, 99 % take less than", result["plans_p99_s"], "s", 0.15),
        Figure("service: GET /v1/plans/{id}", result["reads_a_second"], "/s", 800.0),
        Figure("service: GET /v1/plans/{id}, 99 % take less than", result["reads_p99_s"], "s"),
        Figure(
            f"service: GET /healthz while {SHORT_TRIALS:,} trials run, 99 % take less than",
            result["signs_p99_s"],
            "s",
            0.05,
        ),
        Figure(f"service: {trials} by the library", result["bare_s"], "s"),
        Figure(f"service: {trials} as a durable job", result["durable_s"], "s"),
        Figure("service: overhead of a durable job", result["overhead_percent"], "%", 10.0),
    ]


if __name__ == "__main__":
    print_figures(figures(main()))
