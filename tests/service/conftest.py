"""A service in its own processes, one for all modules that ask for it."""

from collections.abc import Iterator

import httpx2
import pytest

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
