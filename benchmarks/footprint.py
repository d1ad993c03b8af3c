"""How soon a service with default settings makes plans, and its memory after mixed requests."""

import json
import statistics
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.five_owners import SMALL
from benchmarks.load_clients import Request, ask, is_ready, started
from tests.tools.processes import wait_until

__all__ = ["IDLE_S", "REQUESTS", "memory_after", "start_s"]

STARTS = 5
REQUESTS = 500
IDLE_S = 10.0

# what is read of a plan, and jobs that are about it
_GET = ("", "/figures/formation", "/exports/all?force=true", "/what-if", "/report")
_JOBS: dict[str, dict[str, Any]] = {
    "/validations": {"trials": 50},
    "/flights": {"trials": 8},
    "/refinements": {"time_limit_s": 3, "starts": 2},
}


def start_s(checkouts: Sequence[Path]) -> list[tuple[float, float]]:
    """Return s until each checkout's service is ready, and until it has made a plan, flown.

    Medians of starts in which the checkouts take turns. The plan is asked for at once, and again
    while it is refused.
    """
    times: list[list[tuple[float, float]]] = [[] for _ in checkouts]
    plan = Request("POST", "/v1/plans", json.dumps(SMALL).encode())
    for _ in range(STARTS):
        for taken, checkout in zip(times, checkouts, strict=True):
            began = time.perf_counter()
            with started(checkout) as service:
                wait_until(partial(is_ready, service.port), every_s=0.02)
                ready_s = time.perf_counter() - began
                wait_until(lambda port=service.port: ask(port, plan)[0] == 201)  # type: ignore[misc]
                taken.append((ready_s, time.perf_counter() - began))
    return [
        (statistics.median(ready), statistics.median(planned))
        for ready, planned in (zip(*taken, strict=True) for taken in times)
    ]


def memory_after(checkout: Path) -> int:
    """Return the bytes of all processes (PSS) of a checkout's service, after mixed requests.

    Of twenty requests, three make plans (flown or on paper), two are previews, two list, twelve
    read a plan or what comes of it, and one submits a job now and then; each waits for the answer
    to the one before. Then all jobs end, and the service rests.
    """
    with started(checkout) as service:
        wait_until(partial(is_ready, service.port))
        for number in range(REQUESTS):
            _send(service.port, number)
        wait_until(lambda: not _at_work(service.port))
        time.sleep(IDLE_S)
        return service.memory()


def _send(port: int, number: int) -> None:
    body = json.dumps(SMALL).encode()
    kind = number % 20
    newest = ask(port, Request("GET", "/v1/plans?limit=1"))[1]["items"] if number else []
    if kind < 3:
        request = Request("POST", ("/v1/plans", "/v1/plans?paper=true")[kind % 2], body)
    elif kind < 5:
        request = Request("POST", ("/v1/previews", "/v1/previews?quick=true")[kind % 2], body)
    elif kind < 7:
        request = Request("GET", ("/v1/plans", "/v1/jobs")[kind % 2])
    elif kind == 7 and number % 60 == 7:
        path, job = list(_JOBS.items())[number // 60 % len(_JOBS)]
        request = Request("POST", f"/v1/plans/{newest[0]['id']}{path}", json.dumps(job).encode())
    else:
        request = Request("GET", f"/v1/plans/{newest[0]['id']}{_GET[number % len(_GET)]}")
    status = ask(port, request)[0]
    if status >= 300:
        raise RuntimeError(f"{request.path}: answered with {status}")


def _at_work(port: int) -> bool:
    states = ("queued", "running")
    return any(ask(port, Request("GET", f"/v1/jobs?state={state}"))[1]["items"] for state in states)
