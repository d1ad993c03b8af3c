"""Real servers for tests: the service, its workers, and PostgreSQL, each a process of its own."""

import contextlib
import os
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from uuid import uuid4

import httpx2
import psycopg

from tests.tools.processes import PATIENCE_S, wait_until

ROOT = Path(__file__).parents[2]
QUICK = {"SYNCPLAN_HEARTBEAT_S": "0.5", "SYNCPLAN_DEAD_AFTER_S": "2"}
"""Settings under which a dead process is found out in three seconds."""

NO_CERTIFICATES = False
"""What a single request verifies: reading all certificates first takes ten times as long as it."""

_WAITING = ("-w", "-t", f"{PATIENCE_S:.0f}")


def environment(**settings: str) -> dict[str, str]:
    """Return the environment without settings of the service, but for those given."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith("SYNCPLAN_")}
    return {**kept, **settings}


class Process:
    """A `syncplan` command that goes on until it is stopped, of the checkout in a folder."""

    def __init__(
        self, command: str, *arguments: str, log: Path, checkout: Path | str = ROOT, **settings: str
    ) -> None:
        self.log = log
        with log.open("ab") as errors:
            self.popen = subprocess.Popen(
                [sys.executable, "-m", "syncplan", command, *arguments],
                cwd=checkout,
                env=environment(**settings),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=errors,
            )

    def kill(self) -> None:
        """Kill the process as a power cut would: kill -9."""
        self.popen.kill()
        self.popen.wait()

    def stop(self) -> int:
        """Ask the process to end and return its exit status."""
        self.popen.terminate()
        return self.popen.wait(timeout=PATIENCE_S)


class Server(Process):
    """A running `syncplan serve`, ready for requests at `url`."""

    def __init__(
        self,
        log: Path,
        *arguments: str,
        port: int | None = None,
        checkout: Path | str = ROOT,
        **settings: str,
    ) -> None:
        self.port = free_port() if port is None else port
        self.url = f"http://127.0.0.1:{self.port}"
        command = ("serve", "--port", str(self.port), *arguments)
        super().__init__(*command, log=log, checkout=checkout, **settings)
        try:
            wait_until(self._ready, otherwise=lambda: f"no service: {log.read_text()[-3000:]}")
        except BaseException:
            self.kill()
            raise

    def _ready(self) -> bool:
        assert self.popen.poll() is None, f"ended: {self.log.read_text()[-3000:]}"
        with contextlib.suppress(httpx2.TransportError):
            return httpx2.get(f"{self.url}/readyz", verify=NO_CERTIFICATES).status_code == 200
        return False


class Postgres:
    """A PostgreSQL of the test's own, on a free port of this machine."""

    def __init__(self, folder: Path, superuser: str = "syncplan") -> None:
        self._programs = _postgres_programs()
        self._folder = folder
        self._port = free_port()
        self.url = f"postgresql://{superuser}@127.0.0.1:{self._port}/postgres"
        folder.mkdir(parents=True, exist_ok=True)
        self._user = _unprivileged(folder)
        self._run(
            "initdb", "--auth=trust", f"--username={superuser}", "--no-sync", "-D", self._data
        )
        self.start()

    @property
    def _data(self) -> str:
        return str(self._folder / "data")

    def start(self) -> None:
        """Start the server and wait until it takes connections."""
        options = f"-h 127.0.0.1 -p {self._port} -k {self._folder}"
        log = str(self._folder / "log")
        self._run("pg_ctl", "-D", self._data, "-l", log, *_WAITING, "-o", options, "start")

    def stop(self) -> None:
        """Stop the server at once: connections are cut."""
        self._run("pg_ctl", "-D", self._data, "-m", "immediate", *_WAITING, "stop")

    def new_database(self, folder: Path | None = None) -> str:
        """Return the address of a new, empty database, its tables in a folder if one is given.

        `folder_for` makes such a folder.
        """
        name = f"syncplan_{uuid4().hex}"
        with psycopg.connect(self.url, autocommit=True) as connection:
            if folder is None:
                connection.execute(f"CREATE DATABASE {name}")
            else:
                connection.execute(f"CREATE TABLESPACE {name} LOCATION '{folder}'")
                connection.execute(f"CREATE DATABASE {name} TABLESPACE {name}")
        return self.url.rpartition("/")[0] + f"/{name}"

    def folder_for(self, folder: Path) -> Path:
        """Make a folder that PostgreSQL may write to, and return it."""
        folder.mkdir()
        if self._user:
            shutil.chown(folder, "postgres")
        return folder

    def _run(self, program: str, *arguments: str) -> None:
        subprocess.run(
            [str(self._programs / program), *arguments],
            check=True,
            cwd=self._folder,
            stdout=subprocess.DEVNULL,
            timeout=2.0 * PATIENCE_S,
            user=self._user,
            group=self._user,
            extra_groups=None if self._user is None else [],
        )


@contextlib.contextmanager
def own_postgres(superuser: str = "syncplan") -> Iterator[Postgres]:
    """A running PostgreSQL in a folder of its own, stopped at the end."""
    # not in pytest's folder, which every session of pytest shuts against other users anew
    with tempfile.TemporaryDirectory() as folder:
        started = Postgres(Path(folder) / "postgres", superuser)
        try:
            yield started
        finally:
            started.stop()


def _postgres_programs() -> Path:
    """Where PostgreSQL's programs are: Debian keeps them off the path."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    named = shutil.which("initdb")
    places = [Path(named), *found] if named else found
    assert places, "no PostgreSQL here; install Debian's package postgresql"
    return places[-1].parent


def _unprivileged(folder: Path) -> str | None:
    """Whom to run it as where this is root, whom PostgreSQL refuses."""
    if os.geteuid() != 0:
        return None
    shutil.chown(folder, "postgres")
    for parent in folder.parents:
        mode = parent.stat().st_mode
        if parent.owner() == "root" and not mode & 0o001 and parent != Path("/"):
            parent.chmod(mode | 0o011)
    return "postgres"


def free_port() -> int:
    """Return a port of this machine that nobody listens at."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return int(taken.getsockname()[1])


@contextlib.contextmanager
def running(*processes: Process) -> Iterator[None]:
    """Kill the processes at the end, whatever happens."""
    try:
        yield
    finally:
        for process in processes:
            process.kill()


def settings_of(data: Path, database_url: str | None = None) -> Mapping[str, str]:
    """Return the settings of a service that keeps its data in a folder, or in PostgreSQL.

    On a busy machine a plan may take longer than a service lets it, and jobs that yield to all
    other work would never end. One process for requests and one for jobs are soon ready.
    """
    given = {
        "SYNCPLAN_DATA_DIR": str(data),
        "SYNCPLAN_DATABASE_URL": database_url,
        "SYNCPLAN_PLAN_TIMEOUT_S": f"{PATIENCE_S:g}",
        "SYNCPLAN_JOB_NICENESS": "0",
        "SYNCPLAN_PROCESSES": "1",
    }
    return {key: value for key, value in given.items() if value is not None}


@contextlib.contextmanager
def open_server(folder: Path, *arguments: str, **settings: str) -> Iterator[Server]:
    """A running service; its log and data lie in the folder. Without settings, it wants no key."""
    given = {**settings_of(folder / "data"), **settings}
    one = Server(folder / "log", *arguments, port=None, **given)
    with running(one):
        yield one


def parent_running(code: str) -> tuple[subprocess.Popen[str], str]:
    """Start a process of Python in the checkout; return it and the first line that it prints."""
    parent = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, cwd=ROOT, text=True
    )
    assert parent.stdout is not None
    with parent.stdout:
        return parent, parent.stdout.readline()
