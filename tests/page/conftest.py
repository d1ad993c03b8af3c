"""A browser on a service that stays up for all tests of the page."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser

from tests.tools.browsing import Visit, chromium, visiting
from tests.tools.serving import Server, open_server


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """A browser."""
    with chromium() as one:
        yield one


@pytest.fixture(scope="package")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service that asks nobody for a key, its filter's kernels compiled."""
    with open_server(tmp_path_factory.mktemp("page")) as one:
        yield one


@pytest.fixture
def visit(browser: Browser, server: Server) -> Iterator[Visit]:
    """A visit to the page, with its first plan made."""
    with visiting(browser, server.url) as one:
        one.verdict("Observable: rank 18 of 18")
        yield one
