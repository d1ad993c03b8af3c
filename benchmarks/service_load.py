"""The service under load, beside another checkout of it in one run.

Plans read a second with one and with two HTTP processes; plans made a second by eight clients
beside the library in as many processes; previews beside plans; what a busy owner, with a thousand
requests and twenty long jobs, costs another one; what five owners at the service's limits cost a
sixth; and start and memory.

    python benchmarks/service_load.py [--base PATH] [--parts reads ...] [--write]
"""

import argparse
import contextlib
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks.busy_owner import BesideBusy, beside_a_busy_owner
from benchmarks.five_owners import BesideFive, beside_five_owners
from benchmarks.footprint import IDLE_S, REQUESTS, memory_after, start_s
from benchmarks.load_clients import Request, ask, load, serving
from benchmarks.readme_tables import README, machine, markdown, write_between
from syncplan.runtime.child_processes import CHILD_VARIABLES
from syncplan.runtime.machine import usable_cores
from tests.tools.scenarios import example

R = TypeVar("R")

BEGIN, END = "<!-- load: python benchmarks/service_load.py --write -->", "<!-- end of load -->"
HEAD = ["", "before", "now", "now / before"]
HERE = Path(__file__).resolve().parents[1]
ROUNDS = 5
READ_S, PLAN_S, LIBRARY_S = 3.0, 5.0, 5.0
CLIENTS = 8
PREVIEWS = 40
FIVE_OWNERS_S = 300.0

_LIBRARY = """
import sys, time
from api.computing.tasks import made_plan
from api.service import limits_of
from api.settings import load_settings
body = sys.stdin.buffer.read()
limits = limits_of(load_settings())
for _ in range(5):
    made_plan(body, "json", limits, False)
print(flush=True)
count, end = 0, time.perf_counter() + float(sys.argv[1])
while time.perf_counter() < end:
    made_plan(body, "json", limits, False)
    count += 1
print(count)
"""


@dataclass(frozen=True, slots=True)
class Row:
    """A figure of this checkout, and of the base where there is one and it has the figure."""

    what: str
    unit: str
    base: float | None
    now: float

    @property
    def cells(self) -> list[str]:
        """What was measured, before, now, and the one over the other."""
        before = "" if self.base is None else self._text(self.base)
        ratio = f"{self.now / self.base:.2f}" if self.base is not None and self.base > 0.0 else ""
        return [self.what, before, self._text(self.now), ratio]

    def _text(self, value: float) -> str:
        """A value with its unit, to four digits at least."""
        return f"{value:,.0f} {self.unit}" if value >= 1e3 else f"{value:.4g} {self.unit}"


def _p(taken: Sequence[float], percent: float) -> float:
    """A percentile in ms of times in s; NaN of none."""
    return 1e3 * float(np.percentile(taken, percent)) if taken else math.nan


# --- figures ------------------------------------------------------------------------------------


def reads(base: Path | None, body: bytes) -> list[Row]:
    """Return plans read a second, medians of rounds in which the services take turns."""
    with contextlib.ExitStack() as last_first:
        services = {"now": (HERE, ()), "two": (HERE, ("--http-processes", "2"))}
        if base is not None:
            services["base"] = (base, ())
        ports = {
            name: last_first.enter_context(serving(path, "--no-worker", *arguments))
            for name, (path, arguments) in services.items()
        }
        plan = {name: _planned(port, body) for name, port in ports.items()}
        wanted = {name: Request("GET", f"/v1/plans/{plan[name]}") for name in ports}
        for name, port in ports.items():
            load(port, wanted[name], CLIENTS, 1.0)
        found: dict[str, list[tuple[float, float]]] = {name: [] for name in ports}
        for _ in range(ROUNDS):
            for name, port in ports.items():
                taken = load(port, wanted[name], CLIENTS, READ_S)
                found[name].append((len(taken) / READ_S, _p(taken, 95.0)))
    (rate, late), (rates, _) = (np.median(found[name], axis=0) for name in ("now", "two"))
    before = None if base is None else np.median(found["base"], axis=0)
    return [
        Row("GET /v1/plans/{id}, one process", "/s", None if before is None else before[0], rate),
        Row("GET /v1/plans/{id}, p95", "ms", None if before is None else before[1], late),
        Row("GET /v1/plans/{id}, two processes", "/s", None, rates),
        Row("two processes over one", "x", None, rates / rate),
    ]


def _planned(port: int, body: bytes) -> str:
    status, plan = ask(port, Request("POST", "/v1/plans", body))
    if status != 201:
        raise RuntimeError(f"answered with {status}: {plan}")
    return str(plan["id"])


def plans(base: Path | None, body: bytes) -> list[Row]:
    """Return plans made a second over HTTP and by the library, medians of rounds that take turns.

    As many processes compute as there are cores, less one for the service and its clients.
    """
    size = max(1, usable_cores() - 1)
    checkouts = {"now": HERE} if base is None else {"base": base, "now": HERE}
    rates: dict[tuple[str, str], list[float]] = {}
    taken: dict[str, list[float]] = {name: [] for name in checkouts}
    with contextlib.ExitStack() as last_first:
        ports = {
            name: last_first.enter_context(
                serving(path, "--no-worker", SYNCPLAN_PROCESSES=str(size))
            )
            for name, path in checkouts.items()
        }
        for _ in range(ROUNDS):
            for name, path in checkouts.items():
                found = load(ports[name], Request("POST", "/v1/plans", body), CLIENTS, PLAN_S)
                taken[name] += found
                rates.setdefault((name, "http"), []).append(len(found) / PLAN_S)
                bare = by_the_library(path, body, size)
                rates.setdefault((name, "library"), []).append(bare)
    medians = {name: float(np.median(values)) for name, values in rates.items()}

    def row(what: str, unit: str, of: Callable[[str], float]) -> Row:
        return Row(what, unit, None if base is None else of("base"), of("now"))

    return [
        row(f"POST /v1/plans, {CLIENTS} clients", "/s", lambda name: medians[name, "http"]),
        row(f"the library in {size} processes", "/s", lambda name: medians[name, "library"]),
        row(
            "share of a request outside the library",
            "%",
            lambda name: 100.0 * (1.0 - medians[name, "http"] / medians[name, "library"]),
        ),
        row("POST /v1/plans, p50", "ms", lambda name: _p(taken[name], 50.0)),
        row("POST /v1/plans, p95", "ms", lambda name: _p(taken[name], 95.0)),
    ]


def by_the_library(checkout: Path, body: bytes, processes: int) -> float:
    """Return the plans a second that processes make which do what children do and nothing else.

    Those of this checkout keep memory from plan to plan as its children do; those of a base, whose
    settings for children are not known here, do not.
    """
    own = CHILD_VARIABLES if checkout == HERE else {"OPENBLAS_NUM_THREADS": "1"}
    running = [
        subprocess.Popen(
            [sys.executable, "-c", _LIBRARY, str(LIBRARY_S)],
            cwd=checkout,
            env={**os.environ, "PYTHONPATH": str(checkout), **own},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        for _ in range(processes)
    ]
    for one in running:
        assert one.stdin is not None
        one.stdin.write(body)
        one.stdin.close()
    made = 0
    for one in running:
        assert one.stdout is not None
        made += int(one.stdout.read())
        one.wait()
    return made / LIBRARY_S


def previews(base: Path | None, body: bytes) -> list[Row]:
    """Return the median time of a plan and of previews, from one client."""
    paths = {
        "POST /v1/plans": "/v1/plans",
        "POST /v1/previews": "/v1/previews",
        "POST /v1/previews?quick=true": "/v1/previews?quick=true",
    }
    checkouts = [HERE] if base is None else [base, HERE]
    found: dict[tuple[str, Path], list[float]] = {}
    with contextlib.ExitStack() as last_first:
        ports = {
            one: last_first.enter_context(serving(one, "--no-worker", SYNCPLAN_PROCESSES="1"))
            for one in checkouts
        }
        for _ in range(PREVIEWS):
            for checkout in checkouts:
                for what, path in paths.items():
                    began = time.perf_counter()
                    ask(ports[checkout], Request("POST", path, body))
                    found.setdefault((what, checkout), []).append(time.perf_counter() - began)
    return [
        Row(
            f"{what}, one client, p50",
            "ms",
            None if base is None else _p(found[what, base], 50.0),
            _p(found[what, HERE], 50.0),
        )
        for what in paths
    ]


def compared(
    base: Path | None,
    measure: Callable[[Path], R],
    figures: Sequence[tuple[str, str, Callable[[R], float]]],
) -> list[Row]:
    """Return a row for each (label, unit, figure of a result), measured here and at the base."""
    now = measure(HERE)
    before = None if base is None else measure(base)
    return [
        Row(label, unit, None if before is None else of(before), of(now))
        for label, unit, of in figures
    ]


def fairness(base: Path | None, body: bytes) -> list[Row]:
    """Return what one owner's thousand requests and twenty long jobs cost another owner."""
    figures: list[tuple[str, str, Callable[[BesideBusy], float]]] = [
        ("a plan alone, p95", "ms", lambda result: _p(result.alone_s, 95.0)),
        ("a plan beside a busy owner, p95", "ms", lambda result: _p(result.beside_s, 95.0)),
        (
            "one over the other",
            "x",
            lambda result: _p(result.beside_s, 95.0) / _p(result.alone_s, 95.0),
        ),
        ("a job of 10 trials beside it, until it runs", "s", lambda result: result.job_s),
    ]
    return compared(base, partial(beside_a_busy_owner, body=body), figures)


def five_owners(base: Path | None, body: bytes) -> list[Row]:
    """Return what five owners' refinements, validations and slow plans cost a sixth, for 5 min."""
    figures: list[tuple[str, str, Callable[[BesideFive], float]]] = [
        ("beside five owners: plans on paper", "", lambda result: len(result.plans_s)),
        ("these, p50", "ms", lambda result: _p(result.plans_s, 50.0)),
        ("these, p95", "ms", lambda result: _p(result.plans_s, 95.0)),
        ("jobs of 16 trials", "", lambda result: len(result.jobs_s)),
        ("these, p50", "ms", lambda result: _p(result.jobs_s, 50.0)),
        ("these, p95", "ms", lambda result: _p(result.jobs_s, 95.0)),
        ("plans and jobs without a result", "", lambda result: result.failed),
        ("slow plans of the five", "", lambda result: result.slow),
        ("these, refused", "", lambda result: result.refused),
        ("most memory of all processes (PSS)", "MiB", lambda result: result.memory / 2**20),
        ("most bytes in files", "MiB", lambda result: result.stored / 2**20),
    ]
    return compared(base, partial(beside_five_owners, seconds=FIVE_OWNERS_S), figures)


def at_rest(base: Path | None, body: bytes) -> list[Row]:
    """Return how soon the service makes plans, and its memory after mixed requests."""
    checkouts = [HERE] if base is None else [HERE, base]
    ready, planned = zip(*start_s(checkouts), strict=True)
    sizes = [memory_after(checkout) / 2**20 for checkout in checkouts]
    rested = f"memory (PSS) {IDLE_S:g} s after {REQUESTS} mixed requests"
    return [
        Row(what, unit, None if base is None else values[1], values[0])
        for what, unit, values in (
            ("start until it is ready", "s", ready),
            ("start until the first plan, flown", "s", planned),
            (rested, "MiB", sizes),
        )
    ]


PARTS: dict[str, Callable[[Path | None, bytes], list[Row]]] = {
    "reads": reads,
    "plans": plans,
    "previews": previews,
    "fairness": fairness,
    "five": five_owners,
    "rest": at_rest,
}
"""What is measured, in order, by the name that asks for it alone."""


def main(base: Path | None = None, parts: Sequence[str] = tuple(PARTS)) -> list[Row]:
    """Return the rows of these parts; each is printed as it comes."""
    values = example("paper-grid-alternate").model_dump(mode="json", exclude_none=True)
    body = json.dumps(values).encode()
    rows: list[Row] = []
    for part in parts:
        found = PARTS[part](base, body)
        for row in found:
            print(*row.cells, sep="  |  ", file=sys.stderr, flush=True)
        rows += found
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--base", type=Path, help="another checkout to compare with")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--write", action="store_true", help="rewrite the table in README.md")
    wanted = parser.parse_args()
    rows = [row.cells for row in main(wanted.base, wanted.parts)]
    shown = markdown([HEAD, *rows], ["---", "---:", "---:", "---:"])
    print(shown)
    if wanted.write:
        write_between(BEGIN, END, f"Measured on {machine()}.\n\n{shown}", README)
