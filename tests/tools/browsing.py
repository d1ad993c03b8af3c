"""A real browser on the service's page, and what must hold of a page whatever is done on it."""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal

from axe_playwright_python.base import AXE_SCRIPT
from playwright.sync_api import (
    Browser,
    BrowserType,
    ConsoleMessage,
    Locator,
    Page,
    Request,
    expect,
    sync_playwright,
)
from playwright.sync_api import Error as BrowserError

from tests.tools.processes import PATIENCE_S

__all__ = [
    "DESKTOP",
    "DOUBLED",
    "PHONE",
    "Tabs",
    "Visit",
    "accessibility_faults",
    "chromium",
    "faults_by_day_and_night",
    "launched",
    "visiting",
]

DESKTOP = (1440, 900)
PHONE = (390, 844)
DOUBLED = (720, 450)
"""A desktop of 1440 x 900 at 200 %."""

_PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "chrome")
_HEARD = ("error", "warning")
_PATIENCE_MS = 1000.0 * PATIENCE_S
_FORGET = "addEventListener('pagehide', () => { localStorage.clear(); sessionStorage.clear(); })"


@contextmanager
def chromium() -> Iterator[Browser]:
    """A browser of this machine: SYNCPLAN_CHROMIUM, or the first one that is installed."""
    with sync_playwright() as playwright, launched(playwright.chromium) as browser:
        yield browser


@contextmanager
def launched(kind: BrowserType, *options: str) -> Iterator[Browser]:
    """A browser of a kind with options of its own."""
    named = os.environ.get("SYNCPLAN_CHROMIUM")
    program = named or next(filter(None, map(shutil.which, _PROGRAMS)), None)
    assert program, "the tests of the page need Chromium: apt-get install chromium"
    # root can't have the sandbox, and containers have little shared memory
    needed = ["--no-sandbox", "--disable-dev-shm-usage"]
    browser = kind.launch(executable_path=program, args=[*needed, *options])
    try:
        yield browser
    finally:
        browser.close()


@dataclass(slots=True)
class Visit:
    """A page in a browser, and all it complained of.

    Attributes
    ----------
    complaints : of the console, errors and warnings, policy violations among them
    expected : texts of complaints that may pass
    """

    page: Page
    complaints: list[str] = field(default_factory=list)
    expected: tuple[str, ...] = ()

    def expect_complaints(self, *parts: str) -> None:
        """Let complaints that hold one of these texts pass: browsers log every refused request."""
        self.expected = parts

    @property
    def unexpected(self) -> list[str]:
        """What was complained of and not expected."""
        return [one for one in self.complaints if not any(part in one for part in self.expected)]

    def verdict(self, text: str) -> None:
        """Wait until the verdict holds a text, and is of what the fields hold."""
        badge = self.page.locator("#badge.good, #badge.bad")
        self._await(badge)
        expect(badge).to_contain_text(text)

    def doubt(self, text: str) -> None:
        """Wait until the verdict is said, with a text, to be of something else."""
        badge = self.page.locator("#badge:not(.good, .bad)")
        self._await(badge)
        expect(badge).to_contain_text(text)
        expect(self.page.locator("#workspace")).to_contain_class("doubtful")

    def choose(self, example: str) -> None:
        """Start from an example."""
        self.begin(example)
        expect(self.page.locator("#map-name")).to_have_text(example)
        self.settle()

    def begin(self, example: str) -> None:
        """Choose an example, and do not wait for it."""
        self.page.get_by_role("button", name="More", exact=True).click()
        self.page.get_by_label("Start from an example").select_option(example)

    def fill(self, label: str, value: str, *, exact: bool = False) -> None:
        """Fill a field and wait until what follows is planned."""
        self.page.get_by_label(label, exact=exact).fill(value)
        self.settle()

    def settle(self) -> None:
        """Wait until nothing is being planned any more."""
        self._await(self.page.locator("#workspace[aria-busy=false]"))

    def stop_time(self) -> None:
        """Let the page measure no time until it loads again: keys and plans may take seconds."""
        # not by Playwright's clock, which stays with the tab for the tests after this one
        self.page.evaluate("performance.now = (at => () => at)(performance.now())")

    @staticmethod
    def _await(what: Locator) -> None:
        """Wait until something is there.

        Not by `expect`: whenever it does not find it yet, it describes the whole page for the
        message of a failure, nearly half of what a browser computed in the tests.
        """
        what.wait_for(state="attached")


class Tabs:
    """Tabs of a browser, each for one visit at a time, kept for the next one.

    Their user has seen the greeting of a first visit, unless `greeted` is false.

    What a tab has compiled it need not compile again: loading the page takes 0.7 s, not 2.4 s.
    """

    def __init__(self, browser: Browser, *, greeted: bool = True) -> None:
        self.browser = browser
        self._greeted = greeted
        self._free: dict[bool, list[Page]] = {False: [], True: []}

    def take(self, touch: bool) -> Page:
        """Return a tab that remembers nothing."""
        if self._free[touch]:
            return self._free[touch].pop()
        context = self.browser.new_context(has_touch=touch, accept_downloads=True)
        context.grant_permissions(["clipboard-read", "clipboard-write"])
        context.set_default_timeout(_PATIENCE_MS)
        if self._greeted:
            context.add_init_script("localStorage.setItem('syncplan-visited', 'yes')")
        return context.new_page()

    def give_back(self, page: Page, touch: bool) -> None:
        """Have a tab forget what was done in it as it is left, or close it where that fails."""
        try:
            page.unroute_all()
            # a test that failed may hold them
            page.keyboard.up("Shift")
            page.mouse.up()
            # after the page itself, which keeps what was edited
            page.evaluate(_FORGET)
        except BrowserError:
            page.context.close()
        else:
            self._free[touch].append(page)


@contextmanager
def visiting(
    tabs: Tabs,
    address: str,
    *,
    size: tuple[int, int] = DESKTOP,
    dark: bool = False,
    touch: bool = False,
    moving: bool = False,
) -> Iterator[Visit]:
    """A visit to an address; at its end nothing may have been complained of that was not expected.

    Nothing moves by itself, unless `moving`: marks would be somewhere else each time.

    Whatever does not come from the service itself counts as a complaint.
    """
    width, height = size
    page = tabs.take(touch)
    page.set_viewport_size({"width": width, "height": height})
    motion: Literal["no-preference", "reduce"] = "no-preference" if moving else "reduce"
    page.emulate_media(color_scheme="dark" if dark else "light", reduced_motion=motion)
    expect.set_options(timeout=_PATIENCE_MS)
    visit = Visit(page)
    origin = "/".join(address.split("/")[:3])

    def hear(reported: ConsoleMessage) -> None:
        if reported.type in _HEARD:
            visit.complaints.append(reported.text)

    def hear_fault(error: BrowserError) -> None:
        visit.complaints.append(str(error))

    def watch(asked: Request) -> None:
        if not asked.url.startswith((origin, "blob:", "data:")):
            visit.complaints.append(f"asked elsewhere: {asked.url}")

    heard: dict[Any, Callable[[Any], None]] = {
        "console": hear,
        "pageerror": hear_fault,
        "request": watch,
    }
    for event, hearing in heard.items():
        page.on(event, hearing)
    try:
        page.goto(address)
        page.context.new_cdp_session(page).send("Page.resetNavigationHistory")
        # what is around the map comes after it
        page.locator("#new:enabled").wait_for(state="attached")
        yield visit
        assert visit.unexpected == [], visit.unexpected
    except BaseException:
        page.context.close()
        raise
    for event, hearing in heard.items():
        page.remove_listener(event, hearing)
    tabs.give_back(page, touch)


def accessibility_faults(page: Page, *rules: str) -> list[str]:
    """Return what axe finds wrong with a page by some of its rules or by all, a line for each.

    A page's style sheets are the same as long as it is open: they are read once.
    """
    first = not page.evaluate("'axe' in window")
    if first:
        page.evaluate(AXE_SCRIPT)
    options = {"resultTypes": ["violations"], "preload": first}
    found = page.evaluate("axe.run", options | ({"runOnly": [*rules]} if rules else {}))
    return [
        f"{fault['id']}: {fault['help']}: {[node['html'][:160] for node in fault['nodes']]}"
        for fault in found["violations"]
    ]


def faults_by_day_and_night(page: Page) -> list[str]:
    """Return what axe finds wrong with a page, in the dark with its colours alone."""
    found = accessibility_faults(page)
    page.emulate_media(color_scheme="dark")
    found += accessibility_faults(page, "color-contrast")
    page.emulate_media(color_scheme="light")
    return found
