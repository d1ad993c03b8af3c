"""The commands serve and worker as an operator meets them: one line, exit codes, a clean end."""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest

from syncplan import load_scenario, plan, validate
from syncplan.planning.plan_files import load, plan_of
from syncplan.reports.plan_report import plan_document
from syncplan.reports.validation_report import validation_document
from syncplan.runtime.files import as_text
from tests.tools.api_servers import done
from tests.tools.processes import PATIENCE_S, alive, family, wait_until
from tests.tools.scenarios import FILES
from tests.tools.serving import (
    ROOT,
    Process,
    Server,
    environment,
    free_port,
    open_server,
    running,
    settings_of,
)

GRID = FILES / "paper-grid-same.yaml"
KEY = "0123456789abcdef"
LEFT = {"syncplan.db", "syncplan.db-reserve"}
"""Files of an embedded database that nobody uses: no log that is still to be written back."""


def command(
    *arguments: str, before: str = "", **settings: str
) -> "subprocess.CompletedProcess[str]":
    """Run the command line to its end, after some Python of the test's own."""
    code = f"import sys\n{before}\nfrom syncplan.cli.command_line import main\nmain(sys.argv[1:])"
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=ROOT,
        env=environment(**settings),
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )


def refused(done: "subprocess.CompletedProcess[str]") -> str:
    """The one line a command said before it ended with status 2."""
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("syncplan: ")
    return line


# --- arguments and settings ---------------------------------------------------------------------


@pytest.mark.parametrize("name", ["serve", "worker"])
@pytest.mark.long
def test_a_port_in_use_is_named(name: str, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        line = refused(command(name, "--port", str(port), SYNCPLAN_DATA_DIR=str(tmp_path)))
    assert f"127.0.0.1:{port}: can't be listened at" in line
    assert "--port" in line


@pytest.mark.parametrize(
    ("name", "setting", "value", "reported"),
    [
        ("serve", "SYNCPLAN_PORT", "eighty", "valid integer"),
        ("worker", "SYNCPLAN_DATABASE_URL", "mysql://h/d", "neither SQLite nor PostgreSQL"),
    ],
)
def test_a_bad_setting_is_one_line(name: str, setting: str, value: str, reported: str) -> None:
    line = refused(command(name, **{setting: value}))
    assert f"{setting}: " in line
    assert reported in line


@pytest.mark.parametrize(
    ("name", "remedy"), [("serve", "--insecure"), ("worker", "SYNCPLAN_INSECURE=true")]
)
@pytest.mark.long
def test_others_are_not_let_in_without_keys(name: str, remedy: str) -> None:
    line = refused(command(name, "--host", "0.0.0.0", "--port", "0"))
    assert "SYNCPLAN_API_KEYS" in line
    assert line.endswith(f"allow it with {remedy}")


@pytest.mark.parametrize("name", ["serve", "worker"])
def test_a_missing_library_names_the_extra(name: str) -> None:
    hide = (
        "import importlib.util as u; found = u.find_spec\n"
        "u.find_spec = lambda n, *a: None if n in ('dbos', 'fastapi') else found(n, *a)"
    )
    line = refused(command(name, before=hide))
    assert line == (
        "syncplan: the service: needs fastapi, dbos; install the extra: pip install 'syncplan[api]'"
    )


def test_the_other_commands_need_nothing_of_the_service() -> None:
    extra = ("dbos", "fastapi", "httpx2", "psycopg", "sqlalchemy", "starlette", "uvicorn")
    hide = f"sys.modules.update(dict.fromkeys({extra!r}))"
    done = command("plan", str(GRID), "--format", "table", before=hide)
    assert (done.returncode, done.stderr) == (0, "")


# --- the database -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["serve", "worker"])
@pytest.mark.long
def test_a_postgresql_that_is_not_there_is_one_line_soon(name: str) -> None:
    url = f"postgresql://ann:secret@127.0.0.1:{free_port()}/plans"
    line = refused(command(name, SYNCPLAN_DATABASE_URL=url, SYNCPLAN_PORT="0"))
    assert "can't be opened" in line
    assert "refused" in line
    assert "secret" not in line


@pytest.mark.long
def test_a_postgresql_that_does_not_answer_is_one_line_soon() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"postgresql://ann@127.0.0.1:{silent.getsockname()[1]}/plans"
        line = refused(command("serve", "--port", "0", SYNCPLAN_DATABASE_URL=url))
    assert "timeout" in line


@pytest.mark.long
def test_a_database_that_goes_away_while_a_worker_starts_is_one_line(tmp_path: Path) -> None:
    gone = f"""
import sqlalchemy
import api.jobs.worker
def start(settings, database, counts):
    url = "postgresql+psycopg://syncplan@127.0.0.1:{free_port()}/none"
    sqlalchemy.create_engine(url).connect()
api.jobs.worker.Worker = start
"""
    done = command("worker", before=gone, SYNCPLAN_DATA_DIR=str(tmp_path))
    assert "the database: went away while the worker was starting; start it again" in refused(done)


def test_a_data_folder_that_is_a_file_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "data").write_text("")
    line = refused(command("serve", "--port", "0", SYNCPLAN_DATA_DIR=str(tmp_path / "data")))
    assert "can't be opened" in line


def test_a_database_that_is_none_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "syncplan.db").write_bytes(b"no database" * 1000)
    line = refused(command("serve", "--port", "0", SYNCPLAN_DATA_DIR=str(tmp_path)))
    assert "not a database" in line


@pytest.mark.long
def test_a_start_that_fails_further_in_is_no_success(tmp_path: Path) -> None:
    break_it = (
        "import api.main\n"
        "def broken(settings): raise RuntimeError('broken')\n"
        "api.main.limits_of = broken"
    )
    done = command("serve", "--port", "0", before=break_it, SYNCPLAN_DATA_DIR=str(tmp_path))
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        "syncplan: the service could not start; its log says why"
    )


# --- running ------------------------------------------------------------------------------------


def said_address(log: Path) -> str:
    """The address that a server says it is at, once it does."""

    def lines() -> list[str]:
        reported = [json.loads(line)["message"] for line in log.read_text().splitlines()]
        return [one.removeprefix("serving at ") for one in reported if one.startswith("serving at")]

    wait_until(lambda: bool(lines()))
    return lines()[0]


@pytest.mark.long
def test_port_0_takes_a_free_one_and_insecure_lets_others_in(tmp_path: Path) -> None:
    log = tmp_path / "log"
    settings = settings_of(tmp_path / "data")
    process = Process(
        "serve", "--host", "0.0.0.0", "--port", "0", "--insecure", log=log, **settings
    )
    with running(process):
        address = said_address(log)
        assert address.startswith("http://0.0.0.0:")
        port = int(address.rpartition(":")[2])
        with httpx2.Client(transport=httpx2.HTTPTransport(retries=30)) as http:
            assert http.get(f"http://127.0.0.1:{port}/healthz").json() == {"status": "ok"}
        assert process.stop() == 0
    assert (tmp_path / "data").stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.long
def test_a_signal_ends_the_server_with_a_job_at_work(
    tmp_path: Path, number: signal.Signals
) -> None:
    server = Server(tmp_path / "log", port=None, **settings_of(tmp_path / "data"))
    with running(server), httpx2.Client(base_url=server.url, timeout=PATIENCE_S) as http:
        made = http.post("/v1/plans", content=GRID.read_bytes(), headers=YAML).json()
        job = http.post(f"/v1/plans/{made['id']}/validations", json={"trials": 50000}).json()
        wait_until(lambda: working(http, job["id"]))
        _, *children = family(server.popen.pid)
        assert len(children) >= 2
        # whoever follows the job does not keep the server from ending
        with http.stream("GET", f"/v1/jobs/{job['id']}/events"):
            server.popen.send_signal(number)
            assert server.popen.wait(timeout=PATIENCE_S) == 0
    assert {path.name for path in (tmp_path / "data").iterdir()} == LEFT
    wait_until(lambda: not any(map(alive, children)))
    said = server.log.read_text()
    assert "timeout graceful shutdown exceeded" not in said
    assert "Traceback" not in said


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.long
def test_a_signal_ends_a_worker(tmp_path: Path, number: signal.Signals) -> None:
    log = tmp_path / "log"
    settings = {**settings_of(tmp_path / "data"), "SYNCPLAN_JOB_NICENESS": "3"}
    worker = Process("worker", log=log, **settings)
    with running(worker):
        wait_until(lambda: "with" in log.read_text())
        yielding = {os.nice(0) + 3}
        wait_until(lambda: niceness_of_children(worker.popen.pid) == yielding)
        worker.popen.send_signal(number)
        assert worker.popen.wait(timeout=PATIENCE_S) == 0
    assert {path.name for path in (tmp_path / "data").iterdir()} == LEFT
    assert "Traceback" not in log.read_text()


YAML = {"content-type": "application/yaml"}


def working(http: httpx2.Client, job_id: str) -> bool:
    """Whether a job has made some progress."""
    return bool(http.get(f"/v1/jobs/{job_id}").json()["progress"]["done"] > 0)


def niceness_of_children(process: int) -> set[int]:
    """How far the processes that came of one yield to others."""
    return {os.getpriority(os.PRIO_PROCESS, one) for one in family(process)[1:]}


# --- the same bytes everywhere ------------------------------------------------------------------


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One server for the tests that compare."""
    with open_server(tmp_path_factory.mktemp("serve")) as one:
        yield one


@pytest.mark.parametrize(
    ("name", "syntax", "trials"),
    [
        ("paper-grid-alternate", "yaml", 200),
        ("mixed-radii-camera", "json", 100),
        ("triangle-lattice", "yaml", 40),
    ],
)
@pytest.mark.long
def test_library_command_line_and_service_give_the_same_bytes(
    tmp_path: Path, run: Any, server: Server, name: str, syntax: str, trials: int
) -> None:
    file = FILES / f"{name}.yaml"
    scenario = load_scenario(file)
    made = plan(scenario)
    planned = as_text(plan_document(made).as_json())
    flown = as_text(validation_document(validate(made, trials=trials, seed=7)).as_json())

    plan_file, report_file = tmp_path / "plan.json", tmp_path / "report.json"
    assert run("plan", str(file), "-o", str(plan_file))[0] == 0
    options = ("--trials", str(trials), "--seed", "7")
    assert run("validate", str(plan_file), *options, "-o", str(report_file))[0] == 0
    assert plan_file.read_text() == planned
    assert report_file.read_text() == flown

    body = file.read_bytes()
    if syntax == "json":
        body = json.dumps(scenario.model_dump(mode="json", exclude_none=True)).encode()
    with httpx2.Client(base_url=server.url, timeout=PATIENCE_S) as http:
        answer = http.post(
            "/v1/plans", content=body, headers={"content-type": f"application/{syntax}"}
        )
        stored = http.get(answer.headers["location"])
        assert stored.content == answer.content
        assert without_additions(stored.text) == planned
        url = f"/v1/plans/{stored.json()['id']}/validations"
        job = http.post(url, json={"trials": trials, "seed": 7}).headers["location"]
        done(http, job)
        assert http.get(f"{job}/result").text == flown
    # a plan of the service is a plan for the command line
    from_service = tmp_path / "stored.json"
    from_service.write_text(stored.text)
    assert plan_of(load(from_service)).orbits.phases.tolist() == made.orbits.phases.tolist()


def without_additions(text: str) -> str:
    """The text of a stored plan without what was added when it was stored, bytes untouched."""
    opening, *lines = text.split("\n")
    keys = [line.split('"')[1] for line in lines[:3]]
    assert (opening, keys) == ("{", ["id", "created_at", "parent_id"])
    return "\n".join([opening, *lines[3:]])
