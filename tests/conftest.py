"""Fixtures that several test files use, and how many cases properties are tested on."""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from syncplan.cli import command_line
from syncplan.runtime.machine import defer_garbage
from tests.tools.kept_values import FOLDER
from tests.tools.scenarios import document
from tests.tools.scheduling import Groups, rank_of
from tests.tools.serving import Postgres, own_postgres

# looking for garbage takes a twentieth of the quick tests' time
defer_garbage()

# The first is for `make check` and continuous integration: the same few cases each time.
# `make check-all` chooses the second: fresh cases, and many of them. What they find is written
# above the test as an explicit @example, so that both have it from then on.
for name, examples, same in (("same-cases", 25, True), ("fresh-cases", 150, False)):
    settings.register_profile(
        name,
        max_examples=examples,
        derandomize=same,
        database=None,
        deadline=None,
        print_blob=not same,
        suppress_health_check=[HealthCheck.too_slow],
    )
settings.load_profile("same-cases")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let what takes longest begin first."""
    items.sort(key=lambda item: rank_of(item.nodeid))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Groups:
    """Keep together in one process what shares fixtures."""
    return Groups(config, log)


@pytest.fixture(scope="session", autouse=True)
def keep_values(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Share what takes long to compute among the processes of this run."""
    folder = tmp_path_factory.getbasetemp()
    with pytest.MonkeyPatch.context() as patch:
        # pytest gives each process a folder in the one of the run
        shared = folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder
        (shared / "values").mkdir(exist_ok=True)
        patch.setenv(FOLDER, str(shared / "values"))
        yield


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Any:
    """Call the command line in this process: (status, standard output, standard error)."""

    def call(*arguments: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stopped:
            command_line.main(list(arguments))
        out, err = capsys.readouterr()
        assert isinstance(stopped.value.code, int)
        return stopped.value.code, out, err

    return call


@pytest.fixture
def printed(run: Any) -> Any:
    """Call the command line, which must succeed with status 0: standard output."""

    def call(*arguments: str) -> str:
        status, out, err = run(*arguments)
        assert status == 0, err
        return str(out)

    return call


@pytest.fixture
def refused(run: Any) -> Any:
    """Call the command line, which must refuse with status 2: standard error."""

    def call(*arguments: str) -> str:
        status, out, err = run(*arguments)
        assert (status, out) == (2, "")
        return str(err)

    return call


@pytest.fixture
def written(tmp_path: Path) -> Any:
    """Write a small scenario with changes to a file and return its name."""

    def write(**changes: Any) -> str:
        path = tmp_path / "scenario.json"
        path.write_text(json.dumps(document(**changes)))
        return str(path)

    return write


@pytest.fixture(scope="session")
def postgres() -> Iterator[Postgres]:
    """A PostgreSQL for all tests of this process; each makes databases of its own in it."""
    with own_postgres() as started:
        yield started


@pytest.fixture
def address(request: pytest.FixtureRequest) -> str | None:
    """Where an empty PostgreSQL database is, of "postgresql"; None of "sqlite"."""
    if request.param == "sqlite":
        return None
    server: Postgres = request.getfixturevalue("postgres")
    return server.new_database()
