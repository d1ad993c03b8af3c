"""What a busy owner costs another one: plans and a small job beside a thousand requests."""

import asyncio
import contextlib
import multiprocessing
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.load_clients import KEYS, LONGEST_S, Request, ask, serving

__all__ = ["BesideBusy", "beside_a_busy_owner"]

REQUESTS = 1000
JOBS = 20
LONG_TRIALS = 20_000
PLANS = 40
ENOUGH_S = 60.0
"""Plans beside the busy owner are timed for so long at most, and the job waited for."""

_ROOM = {
    # as many requests may wait as the busy owner sends, and as long as they take
    "SYNCPLAN_MAX_PLAN_QUEUE": str(4 * REQUESTS),
    "SYNCPLAN_MAX_REQUESTS": str(2 * REQUESTS),
    "SYNCPLAN_MAX_CONNECTIONS": str(4 * REQUESTS),
    "SYNCPLAN_MAX_CONNECTIONS_PER_ADDRESS": str(4 * REQUESTS),
    "SYNCPLAN_MAX_QUEUED_JOBS": str(2 * JOBS),
    "SYNCPLAN_PLAN_TIMEOUT_S": str(10.0 * LONGEST_S),
}


@dataclass(frozen=True, slots=True)
class BesideBusy:
    """What the other owner's requests took.

    Attributes
    ----------
    alone_s, beside_s : s, plans without and with the busy owner at work
    job_s : s, until a job of ten trials ran beside it
    """

    alone_s: list[float]
    beside_s: list[float]
    job_s: float


def beside_a_busy_owner(checkout: Path, body: bytes) -> BesideBusy:
    """Return what the service of a checkout makes an owner wait for another."""
    plan = Request("POST", "/v1/plans", body)
    with serving(checkout, **_ROOM) as port:
        other = _plan_of(port, plan)
        busy = _plan_of(port, Request("POST", "/v1/plans", body, KEYS["busy"]))
        _wait_for_job(port, Request("POST", f"/v1/plans/{other}/validations", b'{"trials": 1}'))
        alone = _timed(port, plan)
        long = Request(
            "POST",
            f"/v1/plans/{busy}/validations",
            b'{"trials": %d}' % LONG_TRIALS,
            KEYS["busy"],
        )
        for _ in range(JOBS):
            ask(port, long)
        with _crowd(port, Request("POST", "/v1/plans", body, KEYS["busy"])):
            # until the thousand have all been sent
            time.sleep(5.0)
            small = Request("POST", f"/v1/plans/{other}/validations", b'{"trials": 10}')
            job_s = _wait_for_job(port, small)
            beside = _timed(port, plan)
    return BesideBusy(alone, beside, job_s)


def _plan_of(port: int, request: Request) -> str:
    status, plan = ask(port, request)
    if status != 201:
        raise RuntimeError(f"answered with {status}: {plan}")
    return str(plan["id"])


def _timed(port: int, request: Request) -> list[float]:
    taken: list[float] = []
    end = time.perf_counter() + ENOUGH_S
    while len(taken) < PLANS and time.perf_counter() < end:
        began = time.perf_counter()
        with contextlib.suppress(TimeoutError):
            ask(port, request)
        taken.append(time.perf_counter() - began)
    return taken


def _wait_for_job(port: int, request: Request) -> float:
    """The seconds until a job ran; ENOUGH_S for one that does not in that time."""
    began = time.perf_counter()
    try:
        _, job = ask(port, request)
        while time.perf_counter() - began < ENOUGH_S:
            _, now = ask(port, Request("GET", f"/v1/jobs/{job['id']}"))
            if now["state"] != "queued":
                return time.perf_counter() - began
            time.sleep(0.05)
    except TimeoutError:
        pass
    return max(ENOUGH_S, time.perf_counter() - began)


@contextlib.contextmanager
def _crowd(port: int, request: Request) -> Iterator[None]:
    """A thousand connections that each ask again as soon as they are answered."""
    context = multiprocessing.get_context("fork")
    process = context.Process(target=_keep_asking, args=(port, request.on(port)), daemon=True)
    process.start()
    try:
        yield
    finally:
        process.kill()
        process.join()


def _keep_asking(port: int, sent: bytes) -> None:
    async def one() -> None:
        while True:
            with contextlib.suppress(OSError, EOFError, ValueError):
                reader, writer = await asyncio.open_connection("127.0.0.1", port)
                while True:
                    writer.write(sent)
                    head = (await reader.readuntil(b"\r\n\r\n")).lower()
                    at = head.index(b"content-length:") + len(b"content-length:")
                    await reader.readexactly(int(head[at : head.index(b"\r", at)]))
            await asyncio.sleep(0.5)

    async def all_of_them() -> None:
        await asyncio.gather(*(one() for _ in range(REQUESTS)))

    asyncio.run(all_of_them())
