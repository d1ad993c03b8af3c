"""What five busy owners cost a sixth, with default settings.

Each busy owner has a refinement at the service's limit of time, a validation at its limit of trials
and eight slow plans, all asked for again as soon as they end. The sixth asks for a plan of six
vehicles on paper every two seconds, and for jobs of 16 trials one after the other.
"""

import contextlib
import http.client
import json
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.grids import grid_scenario
from benchmarks.load_clients import KEYS, Request, Service, ask, is_ready, started
from tests.tools.processes import wait_until
from tests.tools.scenarios import example, shared_circles

__all__ = ["BesideFive", "beside_five_owners"]

BUSY = [name for name in KEYS if name not in ("busy", "other")]
SLOW_PLANS = 8
EVERY_S = 2.0
PAUSE_S = 0.1
REFUSED_S = 1.0
"""Time (s) after which what was refused is asked for again."""

SMALL: dict[str, Any] = example("paper-grid-same").model_dump(mode="json", exclude_none=True)
LARGER = {key: SMALL[key] for key in ("motion", "initial_sigma")} | grid_scenario(24)
SLOW = shared_circles(5)
REFINEMENT = {"starts": 1000, "time_limit_s": 600, "vary": ["phases", "centers"]}
VALIDATION = {"trials": 100_000}
PAPER = "/v1/plans?paper=true"


@dataclass(slots=True)
class BesideFive:
    """What the sixth owner's requests took, and what the service held.

    Attributes
    ----------
    plans_s, jobs_s : s, plans and jobs with a result; those under way at the end count, so far
    failed : plans and jobs without a result
    slow, refused : slow plans of the busy owners that were made, and not
    memory, stored : most bytes of all processes (PSS) and of all files
    """

    plans_s: list[float] = field(default_factory=list)
    jobs_s: list[float] = field(default_factory=list)
    failed: int = 0
    slow: int = 0
    refused: int = 0
    memory: int = 0
    stored: int = 0


def beside_five_owners(checkout: Path, seconds: float) -> BesideFive:
    """Return what the service of a checkout makes a sixth owner wait for five busy ones."""
    result = BesideFive()
    with started(checkout) as service:
        wait_until(lambda: is_ready(service.port))
        clients = _Clients(service)
        with clients.at_work():
            for owner in BUSY:
                larger, small = clients.plan(owner, LARGER), clients.plan(owner, SMALL)
                refine = partial(clients.run, owner, f"{larger}/refinements", REFINEMENT)
                validate = partial(clients.run, owner, f"{small}/validations", VALIDATION)
                clients.repeat(refine)
                clients.repeat(validate)
            validations = f"{clients.plan('other', SMALL)}/validations"
            for owner in BUSY * SLOW_PLANS:
                slow = partial(clients.sent, owner, "/v1/plans", SLOW)
                clients.repeat(partial(_count, result, slow))
            clients.repeat(partial(_watch, service, result), EVERY_S)
            # until all of them are at work
            time.sleep(3.0)
            plan = partial(clients.sent, "other", PAPER, SMALL)
            job = partial(clients.run, "other", validations, {"trials": 16})
            clients.repeat(partial(_time, result, result.plans_s, plan), EVERY_S)
            clients.repeat(partial(_time, result, result.jobs_s, job))
            time.sleep(seconds)
    return result


def _watch(service: Service, result: BesideFive) -> bool:
    result.memory = max(result.memory, service.memory())
    result.stored = max(result.stored, service.stored())
    return True


def _count(result: BesideFive, act: Callable[[], bool]) -> bool:
    done = act()
    result.slow += done
    result.refused += not done
    return done


def _time(result: BesideFive, taken: list[float], act: Callable[[], bool | None]) -> bool:
    began = time.perf_counter()
    if act() is False:
        result.failed += 1
    else:
        taken.append(time.perf_counter() - began)
    return True


class _Clients:
    """Clients of a service, each in a thread, until all end together."""

    def __init__(self, service: Service) -> None:
        self._port = service.port
        self._over = threading.Event()
        self._threads: list[threading.Thread] = []

    @contextlib.contextmanager
    def at_work(self) -> Iterator[None]:
        """Wait for the end of all clients at the end of the block."""
        try:
            yield
        finally:
            self._over.set()
            for thread in self._threads:
                thread.join()

    def repeat(self, act: Callable[[], bool | None], every_s: float = PAUSE_S) -> None:
        """Do something in a thread, soon again, or somewhat later after it failed."""

        def go_on() -> None:
            pause_s = 0.0
            while not self._over.wait(pause_s):
                began = time.perf_counter()
                done = act()
                pause_s = max(0.0, every_s - (time.perf_counter() - began)) if done else REFUSED_S

        self._threads.append(threading.Thread(target=go_on))
        self._threads[-1].start()

    def plan(self, owner: str, scenario: Mapping[str, Any]) -> str:
        """Make a plan on paper; return its path."""
        status, plan = self._ask(owner, "POST", PAPER, scenario)
        if status != 201:
            raise RuntimeError(f"answered with {status}: {plan}")
        return f"/v1/plans/{plan['id']}"

    def sent(self, owner: str, path: str, body: Mapping[str, Any]) -> bool:
        """Send something; return whether it was made."""
        return self._ask(owner, "POST", path, body)[0] == 201

    def run(self, owner: str, path: str, body: Mapping[str, Any]) -> bool | None:
        """Run a job; return whether it succeeded, None if it did not end in time."""
        status, job = self._ask(owner, "POST", path, body)
        if status != 202:
            return False
        while not self._over.wait(PAUSE_S):
            status, now = self._ask(owner, "GET", f"/v1/jobs/{job['id']}")
            if status == 200 and now["ended_at"] is not None:
                return bool(now["state"] == "succeeded")
        return None

    def _ask(
        self, owner: str, method: str, path: str, body: Mapping[str, Any] | None = None
    ) -> tuple[int, Any]:
        """Status and body of an answer; status 0 where there is none."""
        text = b"" if body is None else json.dumps(body).encode()
        with contextlib.suppress(OSError, http.client.HTTPException):
            return ask(self._port, Request(method, path, text, KEYS[owner]))
        return 0, None
