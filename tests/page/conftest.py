"""A browser on a service that stays up for all tests of the page."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page

from tests.tools.browsing import Tabs, Visit, chromium, visiting
from tests.tools.serving import Server, open_server


def pytest_configure(config: pytest.Config) -> None:
    """Make the marker known that tests of the page alone have."""
    config.addinivalue_line("markers", "quick: a test of the page that `make check` runs too")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave the tests of the page to `make check-all`, but for those that are marked quick."""
    for item in items:
        if item.path.parent == Path(__file__).parent and not item.get_closest_marker("quick"):
            item.add_marker(pytest.mark.long)


# as long as Playwright runs, no other test may run an event loop
@pytest.fixture(scope="package")
def tabs() -> Iterator[Tabs]:
    """Tabs of a browser."""
    with chromium() as browser:
        yield Tabs(browser)


@pytest.fixture(scope="package")
def server(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Server]:
    """A service that asks nobody for a key; it works on jobs where long tests want some."""
    wanted = any(item.get_closest_marker("long") for item in request.session.items)
    arguments = () if wanted else ("--no-worker",)
    with open_server(tmp_path_factory.mktemp("page"), *arguments, SYNCPLAN_BATCH_S="1") as one:
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
