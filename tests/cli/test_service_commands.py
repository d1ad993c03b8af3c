"""The commands serve and worker as an operator meets them: one line, exit codes, a clean end."""

import importlib.util
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest
import sqlalchemy

from tests.tools.processes import PATIENCE_S, alive, family, wait_until
from tests.tools.scenarios import FILES
from tests.tools.serving import ROOT, Process, Server, environment, free_port, running, settings_of

GRID = FILES / "paper-grid-same.yaml"
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


@pytest.fixture
def said(refused: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Any]:
    """The one line that a command of the service ends with here, by its settings."""
    for name in [name for name in os.environ if name.startswith("SYNCPLAN_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("SYNCPLAN_DATA_DIR", str(tmp_path))
    # those of this process stay
    monkeypatch.setattr("api.logs.configure_logs", lambda _: None)
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def begun(*_: object) -> None:
        raise RuntimeError("the service begins")

    for what in ("api.server.serve_until_told", "api.jobs.worker.Worker"):
        monkeypatch.setattr(what, begun)

    def line(*arguments: str, **settings: str) -> str:
        for key, value in settings.items():
            monkeypatch.setenv(f"SYNCPLAN_{key}", value)
        err = str(refused(*arguments))
        assert err.count("\n") == 1
        return err.removeprefix("syncplan: ").rstrip()

    yield line
    for number, handler in handlers.items():
        signal.signal(number, handler)


# --- arguments and settings ---------------------------------------------------------------------


@pytest.mark.parametrize("name", ["serve", "worker"])
def test_a_port_in_use_is_named(said: Any, name: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        line = said(name, "--port", str(port))
    assert line.startswith(f"127.0.0.1:{port}: can't be listened at")
    assert "--port" in line


@pytest.mark.parametrize(
    ("name", "settings", "reported"),
    [
        ("serve", {"PORT": "eighty"}, "SYNCPLAN_PORT: 'eighty': must be a valid integer"),
        ("worker", {"DATABASE_URL": "mysql://h/d"}, "is neither SQLite nor PostgreSQL"),
        ("serve", {"HOST": "0.0.0.0"}, "allow it with --insecure"),
        (
            "worker",
            {"WORKER_HOST": "0.0.0.0", "WORKER_PORT": "0"},
            "allow it with SYNCPLAN_INSECURE=true",
        ),
    ],
)
def test_a_bad_setting_is_one_line(
    said: Any, name: str, settings: dict[str, str], reported: str
) -> None:
    line = said(name, **settings)
    assert line.startswith(f"SYNCPLAN_{next(iter(settings))}: ")
    assert reported in line


@pytest.mark.parametrize("name", ["serve", "worker"])
def test_a_missing_library_names_the_extra(
    said: Any, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    there = importlib.util.find_spec
    hidden = ("dbos", "fastapi")
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda n, *rest: None if n in hidden else there(n, *rest)
    )
    assert said(name) == (
        "the service: needs fastapi, dbos; install the extra: pip install 'syncplan[api]'"
    )


# --- the database -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["serve", "worker"])
def test_a_postgresql_that_is_not_there_is_one_line_soon(said: Any, name: str) -> None:
    url = f"postgresql://ann:secret@127.0.0.1:{free_port()}/plans"
    line = said(name, DATABASE_URL=url, PORT="0")
    assert "can't be opened" in line
    assert "refused" in line
    assert "secret" not in line


@pytest.mark.long
def test_a_postgresql_that_does_not_answer_is_one_line_soon(said: Any) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"postgresql://ann@127.0.0.1:{silent.getsockname()[1]}/plans"
        assert "timeout" in said("serve", "--port", "0", DATABASE_URL=url)


def test_a_database_that_goes_away_while_a_worker_starts_is_one_line(
    said: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def start(*_: object) -> None:
        url = f"postgresql+psycopg://syncplan@127.0.0.1:{free_port()}/none"
        sqlalchemy.create_engine(url).connect()

    monkeypatch.setattr("api.jobs.worker.Worker", start)
    assert said("worker") == (
        "the database: went away while the worker was starting; start it again once it can be "
        "reached"
    )


def test_a_data_folder_that_is_a_file_is_one_line(said: Any, tmp_path: Path) -> None:
    (tmp_path / "data").write_text("")
    assert "can't be opened" in said("serve", DATA_DIR=str(tmp_path / "data"))


def test_a_database_that_is_none_is_one_line(tmp_path: Path) -> None:
    """In a process of its own, whose log has nothing to say either."""
    (tmp_path / "syncplan.db").write_bytes(b"no database" * 1000)
    done = command("serve", "--port", "0", SYNCPLAN_DATA_DIR=str(tmp_path))
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("syncplan: ")
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


@pytest.mark.long
def test_port_0_takes_a_free_one_and_insecure_lets_others_in(tmp_path: Path) -> None:
    log = tmp_path / "log"
    settings = settings_of(tmp_path / "data")
    process = Process(
        "serve", "--host", "0.0.0.0", "--port", "0", "--insecure", log=log, **settings
    )
    with running(process):
        address = re.compile(r'"serving at http://0\.0\.0\.0:(\d+)"')
        wait_until(lambda: address.search(log.read_text()) is not None)
        (port,) = address.findall(log.read_text())
        with httpx2.Client(transport=httpx2.HTTPTransport(retries=30)) as http:
            assert http.get(f"http://127.0.0.1:{port}/healthz").json() == {"status": "ok"}
        process.popen.send_signal(signal.SIGINT)
        assert process.popen.wait(timeout=PATIENCE_S) == 0
    assert {path.name for path in (tmp_path / "data").iterdir()} == LEFT
    assert (tmp_path / "data").stat().st_mode & 0o077 == 0


@pytest.mark.long
def test_a_signal_ends_the_server_with_a_job_at_work(tmp_path: Path) -> None:
    server = Server(tmp_path / "log", port=None, **settings_of(tmp_path / "data"))
    yaml = {"content-type": "application/yaml"}
    with running(server), httpx2.Client(base_url=server.url, timeout=PATIENCE_S) as http:
        made = http.post("/v1/plans", content=GRID.read_bytes(), headers=yaml).json()
        job = http.post(f"/v1/plans/{made['id']}/validations", json={"trials": 50000}).json()
        wait_until(lambda: http.get(f"/v1/jobs/{job['id']}").json()["progress"]["done"] > 0)
        _, *children = family(server.popen.pid)
        assert len(children) >= 2
        # whoever follows the job does not keep the server from ending
        with http.stream("GET", f"/v1/jobs/{job['id']}/events"):
            server.popen.send_signal(signal.SIGTERM)
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


def niceness_of_children(process: int) -> set[int]:
    """How far the processes that came of one yield to others, but for their template's."""
    group = os.getpgid(process)
    children = [child for child in family(process) if os.getpgid(child) != group]
    return {os.getpriority(os.PRIO_PROCESS, child) for child in children}
