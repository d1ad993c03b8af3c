"""A browser on a service that stays up for all tests of the page."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests.tools.browsing import Tabs, Visit, chromium, visiting
from tests.tools.serving import Server, open_server


# as long as Playwright runs, no other test may run an event loop
@pytest.fixture(scope="package")
def tabs() -> Iterator[Tabs]:
    """Tabs of a browser."""
    with chromium() as browser:
        yield Tabs(browser)


@pytest.fixture(scope="package")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service that asks nobody for a key, its filter's kernels compiled."""
    with open_server(tmp_path_factory.mktemp("page")) as one:
        yield one


@pytest.fixture
def visit(tabs: Tabs, server: Server) -> Iterator[Visit]:
    """A visit to the page, with its first plan made."""
    with visiting(tabs, server.url) as one:
        one.verdict("Observable: rank 18 of 18")
        yield one


@pytest.fixture
def page(visit: Visit) -> Page:
    """The page of that visit."""
    return visit.page
