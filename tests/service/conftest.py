"""A service in its own processes, one for all modules that ask for it, and empty databases."""

from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest
from sqlalchemy import Connection

from api.storage.database import Database, open_database
from tests.tools.api_servers import serving, speaking
from tests.tools.serving import Server


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service that does its jobs, with two owners and one whose plans are counted."""
    with serving(tmp_path_factory.mktemp("service"), "ann bob lea") as one:
        yield one


@pytest.fixture(scope="session")
def ann(server: Server) -> Iterator[httpx2.Client]:
    """The first owner, who has plans and jobs."""
    with speaking(server, "ann") as http:
        yield http


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    """An empty database, in a folder that opening it makes."""
    opened = open_database(f"sqlite:///{tmp_path / 'folder' / 'syncplan.db'}")
    yield opened
    opened.close()


@pytest.fixture
def connection(database: Database) -> Iterator[Connection]:
    """A transaction in the empty database, kept where the test passes."""
    with database.writing() as opened:
        yield opened
