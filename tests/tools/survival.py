"""A service under which processes are killed: what it is asked, and what must come of it.

What must come of a job is what the library makes of the same scenario and seed, to the byte.
"""

import contextlib
import hashlib
import json
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, Self
from uuid import uuid4

import httpx2
from dbos import DBOSClient

from api.jobs.queue import APPLICATION
from api.settings import load_settings
from syncplan import __version__
from syncplan.designs.designer import design
from syncplan.flight.flying import fly
from syncplan.planning.plan_files import loaded_from, plan_of
from syncplan.planning.planner import plan
from syncplan.planning.plans import Plan
from syncplan.planning.validation import validate
from syncplan.planning.variations import sweep
from syncplan.refinement.refiner import refine
from syncplan.reports.design_report import design_document
from syncplan.reports.flight_report import flight_document
from syncplan.reports.plan_report import plan_document
from syncplan.reports.validation_report import sweep_document, validation_document
from syncplan.runtime.files import as_text
from syncplan.studies.job_contract import JobKindName
from tests.tools.briefs import FIELD
from tests.tools.kept_values import once_a_run
from tests.tools.processes import PATIENCE_S, wait_until
from tests.tools.scenarios import FILES, document, example, small
from tests.tools.serving import NO_CERTIFICATES, QUICK, ROOT, Process, Server, settings_of
from tests.tools.wrong_clock import clock_ahead

_GRID = (FILES / "paper-grid-same.yaml").read_text()
_PAIR = {"landmarks_m": [[0.0, 40.0], [70.0, 40.0]]}


@dataclass(frozen=True, slots=True)
class Order:
    """A job to hand in, and the bytes it must come to.

    Attributes
    ----------
    unflown : what it comes to where another version flew its plan; None unless that was asked for
    """

    kind: JobKindName
    body: Mapping[str, Any]
    expected: str
    unflown: str | None = None

    def accepts(self, made: str, versions: AbstractSet[str]) -> bool:
        """Tell whether it may come to this where each of some versions may have a part in it.

        The digests of flights of other versions are left out: they depend on the version.
        """
        if made == self.expected:
            return True
        of_this = {
            _undigested(made.replace(_names(other), _names(__version__))) for other in versions
        }
        accepted = {_undigested(text) for text in (self.expected, self.unflown) if text is not None}
        return len(versions) > 1 and not of_this.isdisjoint(accepted)


@lru_cache(maxsize=2)
def grid(*, flown: bool = True) -> Plan:
    """Return the library's plan of the six vehicles in a grid, flown or on paper."""
    return plan(example("paper-grid-same"), pilot=flown)


@lru_cache(maxsize=1)
def pair() -> Plan:
    """Return the library's plan of two vehicles with landmarks."""
    return plan(small(**_PAIR))


@once_a_run
def validation(
    trials: int,
    seed: int,
    model: str | None = None,
    *,
    flown: bool = True,
    upgraded: bool = False,
) -> Order:
    """Return the order to validate the grid, by a filter that a `model` names or the default.

    Where the service is `upgraded` meanwhile, another version may have flown the grid.
    """
    body = {"trials": trials, "seed": seed} | ({"model": model} if model else {})

    def report(made: Plan) -> str:
        validation = validate(made, trials=trials, seed=seed, model=model)
        return as_text(validation_document(validation).as_json())

    made = grid(flown=flown)
    unflown = report(of_another_version(made)) if upgraded else None
    return Order("validation", body, report(made), unflown)


def of_another_version(made: Plan) -> Plan:
    """Return a plan as it is read where another version of syncplan flew it."""
    document = json.loads(as_text(plan_document(made).as_json()))
    document["flight"]["digest"] = "0" * 32
    return plan_of(loaded_from(document))


@once_a_run
def flight(trials: int, seed: int, duration_s: float) -> Order:
    """Return the order to fly the grid, in wind, where a vehicle is held and another one lost."""
    hold, lose = f"v2@{0.2 * duration_s:g}:2", f"v6@{0.6 * duration_s:g}"
    options: dict[str, Any] = {"trials": trials, "seed": seed, "hold": [hold], "lose": [lose]}
    found = fly(grid(), **options, duration=duration_s, wind=(0.5, 0.0))
    body = {**options, "duration_s": duration_s, "wind_mps": [0.5, 0.0]}
    return Order("flight", body, as_text(flight_document(found).as_json()))


@once_a_run
def sweep_of_ranges(trials: int, seed: int) -> Order:
    """Return the order to sweep the range of the grid's sensor."""
    ranges = [45.0, 55.0]
    scenario = example("paper-grid-same")
    rows = sweep(scenario, "range", ranges, trials=trials, seed=seed)
    values = scenario.model_dump(mode="json", exclude_none=True)
    body = {"scenario": values, "range_m": ranges, "trials": trials, "seed": seed}
    expected = as_text(sweep_document(rows).as_json())
    return Order("sweep", body, expected)


@once_a_run
def refinement(seed: int) -> Order:
    """Return the order to refine the pair."""
    body = {"vary": ["phases", "centers"], "starts": 2, "seed": seed}
    better = refine(pair(), vary=["phases", "centers"], starts=2, seed=seed)
    return Order("refinement", body, as_text(plan_document(better).as_json()))


@once_a_run
def designed() -> Order:
    """Return the order to design a pair over a field."""
    body = {**FIELD, "team": {"max": 2}, "landmarks": {"max": 2}}
    return Order("design", body, as_text(design_document(design(body)).as_json()))


class Site:
    """A service of a test's own: its data, its processes, what it has accepted.

    Parameters
    ----------
    folder : of the data and the logs
    database_url : of PostgreSQL; SQLite in the folder if None

    Attributes
    ----------
    checkout : of the program that is started next
    versions : of syncplan that may have done a job
    """

    def __init__(self, folder: Path, database_url: str | None = None, **settings: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        given = {**settings_of(folder / "data", database_url), "SYNCPLAN_PROCESSES": "2"}
        self._settings = {**given, **settings}
        self._port: int | None = None
        self.checkout = ROOT
        self.versions = {__version__}
        self._marks: dict[Process, str] = {}
        self.url = ""
        self.plans: dict[str, str] = {}
        self.jobs: dict[str, Order] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        for process in self._marks:
            process.kill()

    @property
    def database(self) -> str:
        """The address of the database, as the service takes it."""
        return load_settings(
            data_dir=Path(self._settings["SYNCPLAN_DATA_DIR"]),
            database_url=self._settings.get("SYNCPLAN_DATABASE_URL"),
        ).database

    # --- processes ---

    def serve(self, *arguments: str, beside: bool = False) -> Server:
        """Start the server, at the same port as before unless beside it; wait until it is ready."""
        if beside:
            self._port = None
        mark = uuid4().hex
        log = self.folder / "server.log"
        server = Server(
            log,
            *arguments,
            port=self._port,
            checkout=self.checkout,
            **self._settings,
            SURVIVAL_MARK=mark,
        )
        self._port, self.url = server.port, server.url
        self._marks[server] = mark
        return server

    def work(self, ahead_s: float = 0.0) -> Process:
        """Start a worker, whose clock may be wrong."""
        wrong = clock_ahead(self.folder / f"clock{ahead_s:+g}", ahead_s) if ahead_s else {}
        return self.begin("worker", **wrong)

    def begin(self, command: str, *arguments: str, **environment: str) -> Process:
        """Start a process without waiting for it, with more in its environment if given."""
        mark = uuid4().hex
        log = self.folder / f"{command}.log"
        given = {**self._settings, **environment, "SURVIVAL_MARK": mark}
        process = Process(command, *arguments, log=log, checkout=self.checkout, **given)
        self._marks[process] = mark
        return process

    def family(self, process: Process) -> set[int]:
        """Return the living processes that a process, or a child of it, has started."""
        return _marked(self._marks[process]) - {process.popen.pid}

    def kill(self, process: Process) -> None:
        """Kill a process, and see to it that it takes all it had started with it."""
        process.kill()
        self.see_family_gone(process)

    def see_family_gone(self, process: Process) -> None:
        """Fail if anything that a process has started outlives it for long."""
        wait_until(
            lambda: not self.family(process),
            otherwise=lambda: f"left behind: {sorted(self.family(process))}",
        )

    # --- requests ---

    def ask(self, method: str, path: str, **options: Any) -> httpx2.Response:
        """Return the answer to a request, whatever its status."""
        given = {"timeout": PATIENCE_S, "verify": NO_CERTIFICATES, **options}
        return httpx2.request(method, f"{self.url}{path}", **given)

    def hand_in_plan(self, of: Literal["grid", "pair"] = "grid") -> str:
        """Hand in a plan and return its identifier."""
        if of == "grid":
            content, kind = _GRID, "application/yaml"
        else:
            content, kind = json.dumps(document(**_PAIR)), "application/json"
        answer = self.ask("POST", "/v1/plans", content=content, headers={"content-type": kind})
        assert answer.status_code == 201, answer.text
        plan_id = str(answer.json()["id"])
        self.plans[plan_id] = answer.text
        return plan_id

    def hand_in(self, order: Order, plan_id: str | None = None) -> str:
        """Hand in a job, on a new plan if none is given, and return its identifier."""
        path = f"/v1/{order.kind}s"
        if order.kind not in ("sweep", "design"):
            of: Literal["grid", "pair"] = "pair" if order.kind == "refinement" else "grid"
            path = f"/v1/plans/{plan_id or self.hand_in_plan(of)}/{order.kind}s"
        answer = self.ask("POST", path, json=dict(order.body))
        assert answer.status_code == 202, answer.text
        job_id = str(answer.json()["id"])
        self.jobs[job_id] = order
        return job_id

    def job(self, job_id: str) -> dict[str, Any]:
        """Return a job as the service shows it."""
        answer = self.ask("GET", f"/v1/jobs/{job_id}")
        assert answer.status_code == 200, answer.text
        shown: dict[str, Any] = answer.json()
        return shown

    def events(self, job_id: str) -> list[dict[str, Any]]:
        """Return all events of a job that has ended."""
        accept = {"accept": "text/event-stream"}
        lines = self.ask("GET", f"/v1/jobs/{job_id}/events", headers=accept).text.splitlines()
        numbers = [int(line[3:]) for line in lines if line.startswith("id:")]
        assert numbers == list(range(1, len(numbers) + 1))
        return [json.loads(line[5:]) for line in lines if line.startswith("data:")]

    # --- what must hold ---

    def wait_for(self, job_id: str, *states: str, seconds: float = PATIENCE_S) -> dict[str, Any]:
        """Return a job once it is in one of the states."""
        last: dict[str, Any] = {}

        def there() -> bool:
            last.update(self.job(job_id))
            return last["state"] in states

        wait_until(there, seconds, lambda: f"{last}\n{self.logs()}", every_s=0.2)
        return last

    def see_all_done(self) -> None:
        """Fail unless all that was accepted is there, each job ended once, with its bytes."""
        self.see_results()
        for plan_id, text in self.plans.items():
            assert self.ask("GET", f"/v1/plans/{plan_id}").text == text
        refined = sum(order.kind == "refinement" for order in self.jobs.values())
        assert self.count("jobs") == len(self.jobs)
        assert self.count("plans") == len(self.plans) + refined
        self.see_nothing_left()

    def wait_for_all(self) -> None:
        """Wait until each job that was accepted has ended."""
        for job_id in self.jobs:
            self.wait_for(job_id, "succeeded", "failed", "cancelled")

    def see_results(self) -> None:
        """Fail unless each job that was accepted ends once, with its bytes."""
        for job_id, order in self.jobs.items():
            shown = self.wait_for(job_id, "succeeded", "failed", "cancelled")
            assert shown["state"] == "succeeded", f"{shown}\n{self.logs()}"
            assert shown["progress"]["done"] == shown["progress"]["total"]
            result = self.ask("GET", shown["result"]).text
            made = _without_storage(result) if order.kind == "refinement" else result
            accepted = order.accepts(made, self.versions)
            assert accepted, f"{order.kind} {job_id} came to something else"
            self.see_ended_once(job_id, "succeeded")

    def see_ended_once(self, job_id: str, state: str) -> None:
        """Fail unless a job has ended once, and in this state."""
        reported = [event["state"] for event in self.events(job_id)]
        assert [one for one in reported if one not in ("queued", "running")] == [state]
        assert reported[-1] == state

    def held_by(self, process: Process) -> list[str]:
        """Return the workflows that a process has begun and not ended."""
        with self._dbos() as client:
            begun = client.list_workflows(status="PENDING")
        number = f"-{process.popen.pid}-"
        return [one.workflow_id for one in begun if number in (one.executor_id or "")]

    def see_nothing_left(self) -> None:
        """Fail if workflows stay behind that are not done."""
        with self._dbos() as client:
            left: list[Any] = []

            def nothing() -> bool:
                left[:] = client.list_workflows(status=["PENDING", "ENQUEUED"])
                return not left

            wait_until(nothing, otherwise=lambda: f"{left}\n{self.logs()}", every_s=0.2)

    @contextlib.contextmanager
    def _dbos(self) -> Iterator[DBOSClient]:
        client = DBOSClient(system_database_url=self.database, application_name=APPLICATION)
        try:
            yield client
        finally:
            client.destroy()

    def count(self, what: Literal["plans", "jobs"]) -> int:
        """Return how many plans or jobs the service lists."""
        path, number = f"/v1/{what}?limit=200", 0
        while path:
            page = self.ask("GET", path).json()
            number += len(page["items"])
            path = page["next"]
        return number

    def log_lines(self) -> list[str]:
        """Return what all processes have logged."""
        return [line for one in self.folder.glob("*.log") for line in one.read_text().splitlines()]

    def logs(self) -> str:
        """Return the ends of the logs, for a failure's message."""
        return "\n".join(
            f"--- {one.name}\n{one.read_text()[-3000:]}"
            for one in sorted(self.folder.glob("*.log"))
        )


def quick(folder: Path, database_url: str | None = None, **settings: str) -> Site:
    """Return a site where the dead are found out soon and jobs are cut into many parts."""
    return Site(folder, database_url, **{**QUICK, "SYNCPLAN_BATCH_S": "0.4", **settings})


def another_version(folder: Path, version: str) -> Path:
    """Return a folder with a copy of this checkout's program that calls itself another version."""
    for package in ("syncplan", "api"):
        shutil.copytree(ROOT / package, folder / package)
    # compiled kernels come along: numba names their folders by where the sources are
    for kernels in list(folder.glob("syncplan/__pycache__/kernels-*/*")):
        package, _, _ = kernels.name.partition("_")
        digest = hashlib.sha1(str(folder / "syncplan" / package).encode()).hexdigest()
        kernels.rename(kernels.with_name(f"{package}_{digest}"))
    file = folder / "syncplan" / "__init__.py"
    given, text = f'__version__ = "{__version__}"', file.read_text()
    assert text.count(given) == 1, file
    file.write_text(text.replace(given, f'__version__ = "{version}"'))
    return folder


def _names(version: str) -> str:
    return f'"version": "{version}"'


def _undigested(text: str) -> str:
    return re.sub(r'"digest": "[0-9a-f]{32}"', '"digest": ""', text)


def _without_storage(text: str) -> str:
    """A stored plan as the library writes it, without the three keys that storing added."""
    return "{" + text.split(",", 3)[3]


def _marked(mark: str) -> set[int]:
    """Living processes with a mark in their environment."""
    wanted = f"SURVIVAL_MARK={mark}".encode()
    found = set()
    for number in (int(name) for name in os.listdir("/proc") if name.isdigit()):
        with contextlib.suppress(OSError):
            if wanted in Path(f"/proc/{number}/environ").read_bytes():
                found.add(number)
    return found
