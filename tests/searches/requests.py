"""Search for a request that the service does not answer well, or that it keeps memory for.

A case is a run of 200 drawn requests, and nothing else may run beside it. The requests are sent
again to measure memory, of processes that were there the time before: what a process loads for a
new kind of request is not kept for a request. Children that grow much are replaced by the service
itself: those do not count.

Fails where an answer is neither of the 2xx nor a 4xx problem, or late, where the service logs an
error, where its processes have grown by more than 50 MB, and where some kind of answer is missing.
"""

import contextlib
import http.client
import io
import json
import socket
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import httpx2
import numpy as np

from tests.searches import Search
from tests.tools.mutations import FIGURES, Sent, draw_request, valid_scenarios
from tests.tools.processes import PATIENCE_S, family, memory
from tests.tools.serving import Server, running

KEY = "fuzzing-key-0123456789"
REQUESTS = 200
LARGEST_GROWTH_MB = 50.0
PLAN_TIMEOUT_S = 10.0
CLIENTS = 3
WARM_UP = 100
PASSES = 6
"""Times the same requests are sent while memory grows: a child may first load in any of them."""
PATIENCE = 5
"""Tries of a valid request: the processes are only starting, on a machine with other work."""
MARGIN_S = 60.0
"""What a request may take beyond the time a plan may take: waiting its turn, being sent."""

SETTINGS = {
    # as many as there are clients and one more, on any machine: nobody waits for others' requests
    "SYNCPLAN_PROCESSES": str(CLIENTS + 1),
    "SYNCPLAN_API_KEYS": f"fuzzing:{KEY}",
    "SYNCPLAN_PLAN_TIMEOUT_S": f"{PLAN_TIMEOUT_S:g}",
    "SYNCPLAN_MAX_TRIALS": "100",
    "SYNCPLAN_MAX_REFINE_S": "1",
    "SYNCPLAN_MAX_QUEUED_JOBS": "4",
    "SYNCPLAN_MAX_SWEEP_VALUES": "3",
    "SYNCPLAN_MAX_DESIGN_EVALUATIONS": "1000",
}
_AUTHORISED = {"authorization": f"Bearer {KEY}"}
EXPECTED = {201, 202, 413, 422}
"""Without these, in all cases together, it was no search: things made, jobs, and refusals of what
is too large or wrong."""
_GONE = {"cut"}
"""Requests that nobody waits for the answer of."""


@dataclass(slots=True)
class Run:
    """Answers to requests, and MB held by each process, before the first pass and after each."""

    statuses: Counter[int] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    held: list[dict[int, float]] = field(default_factory=list)

    @property
    def growth_mb(self) -> float:
        """By how much processes have grown in the last pass that were there in the one before."""
        earlier, before, after = self.held[-3:]
        lasting = earlier.keys() & before.keys() & after.keys()
        return sum(after[process] - before[process] for process in lasting)


def run(server: Server, seed: int) -> Run:
    """Return how a service with these SETTINGS answers drawn requests.

    Processes that have grown too much are sent the same requests again, up to PASSES in all: memory
    that is kept grows each time, what a new process loads only once.
    """
    answers = Run()
    scenarios = valid_scenarios()
    with httpx2.Client(base_url=server.url, headers=_AUTHORISED, timeout=PATIENCE_S) as client:
        plans = _planned(client, scenarios)
        _warm_up(client, scenarios, plans)

        look = partial(_look, server.port, answers, seed, scenarios, plans)

        def send() -> None:
            with ThreadPoolExecutor(CLIENTS) as clients:
                list(clients.map(look, range(REQUESTS)))
            _wait_for_jobs(client)

        answers.held = [_memory(server.popen.pid)]
        for sent in range(1, PASSES + 1):
            send()
            answers.held.append(_memory(server.popen.pid))
            if sent > 1 and answers.growth_mb < LARGEST_GROWTH_MB:
                break
    return answers


def draw(number: int) -> tuple[list[str], Run]:
    """Return how a service answers requests, and what is wrong with that."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        server = Server(log, port=None, SYNCPLAN_DATA_DIR=folder, **SETTINGS)
        with running(server):
            answers = run(server, number)
        faults = answers.faults + _logged_faults(log)
    if answers.growth_mb > LARGEST_GROWTH_MB:
        faults.append(f"processes have grown by {answers.growth_mb:.0f} MB in the last pass")
    return faults, answers


def judge(cases: Mapping[int, Run], chance: float) -> list[str]:
    """Print the answers of each run and the growth of memory; return what no case has."""
    for number, answers in cases.items():
        print(f"{number}: answers {dict(sorted(answers.statuses.items()))}")
        print(
            f"processes that had been sent requests before have grown by {answers.growth_mb:.0f} MB"
        )
    # of 200 requests, two are too large on average: one case in six has none
    answered = {status for answers in cases.values() for status in answers.statuses}
    missing = EXPECTED - answered
    return [f"no answer with status {sorted(missing)}"] if missing else []


# --- one request ----------------------------------------------------------------------------------


def _look(
    port: int, answers: Run, seed: int, scenarios: list[Any], plans: list[str], number: int
) -> None:
    """Send a drawn request and note what is wrong with its answer."""
    sent = draw_request(np.random.default_rng([seed, number]), scenarios, plans)
    began = time.monotonic()
    try:
        status, headers, body = _answer(port, sent)
    except (OSError, http.client.HTTPException) as error:
        if sent.name not in _GONE:
            answers.faults.append(f"{number} {sent.name}: no answer: {error!r}")
        return
    took = time.monotonic() - began
    answers.statuses[status] += 1
    reported = f"{number} {sent.name}: {status} {body[:300]!r}"
    if took > PLAN_TIMEOUT_S + MARGIN_S:
        answers.faults.append(f"{reported}: took {took:.1f} s")
    answers.faults += [f"{reported}: {fault}" for fault in _faults_of(status, headers, body)]


def _answer(port: int, sent: Sent) -> tuple[int, http.client.HTTPMessage, bytes]:
    limit = PLAN_TIMEOUT_S + 3.0 * MARGIN_S
    with socket.create_connection(("127.0.0.1", port), timeout=limit) as connection:
        authorised = replace(sent, headers={"Authorization": f"Bearer {KEY}", **sent.headers})
        for piece in authorised.pieces():
            connection.sendall(piece)
        if sent.cut:
            connection.shutdown(socket.SHUT_WR)
        response = http.client.HTTPResponse(connection, method=sent.method)
        response.begin()
        return response.status, response.headers, response.read()


def _faults_of(status: int, headers: http.client.HTTPMessage, body: bytes) -> list[str]:
    if 200 <= status < 300:
        if headers.get("content-type") == "application/zip":
            return _faults_of_archive(body)
        return [] if _read(body) is not None else ["no JSON"]
    if not 400 <= status < 500:
        return ["neither of the 2xx nor of the 4xx"]
    if headers.get("content-type") != "application/problem+json":
        return ["no problem"]
    problem = _read(body)
    faults = [] if len(body) < 30_000 else [f"a problem of {len(body)} bytes"]
    if not isinstance(problem, dict) or problem.get("status") != status:
        return [*faults, "no problem of its status"]
    if problem["request_id"] != headers.get("x-request-id"):
        faults.append("another request's id")
    if "Traceback" in body.decode() or "site-packages" in body.decode():
        faults.append("a trace")
    return faults


def _faults_of_archive(body: bytes) -> list[str]:
    with zipfile.ZipFile(io.BytesIO(body)) as archive:
        sidecars = [name for name in archive.namelist() if name.endswith(".sync.json")]
        whole = archive.testzip() is None and all(
            _read(archive.read(name)) is not None for name in sidecars
        )
    return [] if whole and sidecars else ["no archive with a sidecar"]


def _read(body: bytes) -> Any:
    """What strict JSON holds; None if it is none."""

    def refuse(constant: str) -> Any:
        raise ValueError(constant)

    try:
        return json.loads(body, parse_constant=refuse)
    except ValueError:
        return None


# --- the service ----------------------------------------------------------------------------------


def _planned(client: httpx2.Client, scenarios: list[Any]) -> list[str]:
    """Return a plan of each scenario, after WARM_UP requests for them."""

    def planned(k: int) -> str:
        for _ in range(PATIENCE):
            response = client.post("/v1/plans", json=scenarios[k % len(scenarios)])
            if response.status_code == 201:
                break
        assert response.status_code == 201, response.text
        return str(response.json()["id"])

    with ThreadPoolExecutor(CLIENTS) as clients:
        plans = list(clients.map(planned, range(WARM_UP)))
    return plans[: len(scenarios)]


def _warm_up(client: httpx2.Client, scenarios: list[Any], plans: list[str]) -> None:
    """Have every process do what makes it load something, jobs of each kind among it."""
    _rendered(client, plans)
    sweep = {"scenario": scenarios[1], "angular_rate_rad_s": [0.2, 0.4], "trials": 50}
    for _ in range(2):
        jobs = [
            *(client.post(f"/v1/plans/{key}/refinements", json={}) for key in plans[:2]),
            *(
                client.post(f"/v1/plans/{key}/validations", json={"trials": 100})
                for key in plans[:2]
            ),
        ]
        _wait_for_jobs(client)
        jobs += [client.post("/v1/sweeps", json=sweep) for _ in range(2)]
        assert {job.status_code for job in jobs} == {202}, [job.text for job in jobs]
        _wait_for_jobs(client)


def _rendered(client: httpx2.Client, plans: list[str]) -> None:
    """Have every process load what draws and exports, several asking at once."""
    asked = [
        *(f"/v1/plans/{key}/exports/all?force=true" for key in plans),
        *(f"/v1/plans/{key}/figures/{name}" for key in plans[:4] for name in FIGURES[:-1]),
    ]
    with ThreadPoolExecutor(CLIENTS) as clients:
        answers = list(clients.map(client.get, asked))
    texts = [answer.text[:300] for answer in answers]
    assert {answer.status_code for answer in answers} == {200}, texts


def _wait_for_jobs(client: httpx2.Client) -> None:
    for state in ("queued", "running"):
        while client.get(f"/v1/jobs?state={state}").json()["items"]:
            time.sleep(0.2)


def _logged_faults(log: Path) -> list[str]:
    return [line for line in log.read_text().splitlines() if '"level": "error"' in line]


def _memory(process: int) -> dict[int, float]:
    """MB of a process and of each that comes of it, once none of them works."""
    time.sleep(1.0)
    held = {}
    for each in family(process):
        with contextlib.suppress(OSError):
            held[each] = memory(each) / 2.0**20
    return held


SEARCH = Search(draw, judge, draws=1)
