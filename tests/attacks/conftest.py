"""A server that the attacks on its tasks share; each has an owner of its own."""

from collections.abc import Iterator

import httpx2
import pytest

from tests.tools.api_servers import serving, speaking
from tests.tools.scenarios import document
from tests.tools.serving import Server

TASK_MEMORY_MIB = 350


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server with tight limits on tasks, its pools at work."""
    settings = {
        "SYNCPLAN_TASK_MEMORY_BYTES": str(TASK_MEMORY_MIB * 2**20),
        "SYNCPLAN_MAX_JOB_SECONDS": "0.001",
    }
    folder = tmp_path_factory.mktemp("attacked")
    with serving(folder, "ann bob eve", **settings) as one:
        with speaking(one, "ann") as http:
            assert http.post("/v1/plans", json=document()).status_code == 201
        yield one


@pytest.fixture(scope="session")
def ann(server: Server) -> Iterator[httpx2.Client]:
    """The one who plans."""
    with speaking(server, "ann") as http:
        yield http
