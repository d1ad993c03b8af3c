"""A mission from nothing: a team over a field with a keep-out, in few actions, at every size."""

import json
import re
from collections.abc import Callable
from dataclasses import dataclass

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.page.gestures import Place, on_screen, unzipped
from tests.tools.browsing import DESKTOP, DOUBLED, PHONE, Tabs, Visit, visiting
from tests.tools.serving import Server

TABLET = (768, 1024)

FIELD = [
    *((-25.0, -25.0), (165.0, -25.0), (165.0, 40.0)),
    *((95.0, 40.0), (95.0, 95.0), (-25.0, 95.0)),
]
"""An L about the five circles of a grid, corners in m."""

KEEP_OUT = [(20.0, 25.0), (50.0, 25.0), (35.0, 45.0)]


def field(page: Page, label: str) -> Locator:
    """A field on show, by its label without the unit."""
    return page.get_by_label(re.compile(rf"^{label}( \(|$)")).filter(visible=True)


@dataclass
class Hands:
    """Actions on the page, counted: a click, a drag, a filled field, a command by key."""

    page: Page
    actions: int = 0

    def press(self, name: str, role: str = "button") -> None:
        """Press a button or a tab."""
        self.actions += 1
        self.page.get_by_role(role, name=name, exact=True).click()  # type: ignore[arg-type]

    def fill(self, label: str, value: str) -> None:
        """Fill a field."""
        self.actions += 1
        field(self.page, label).fill(value)

    def point(self, place: Place) -> None:
        """Click or tap a place of the scenario on the map."""
        self.actions += 1
        x, y = on_screen(self.page, *place)
        self.page.mouse.move(x, y)
        self.page.mouse.click(x, y)
        # two clicks in a row are none of a double click
        self.page.wait_for_timeout(300)

    def outline(self, tool: str, corners: list[Place]) -> None:
        """Draw a polygon with a tool, up to its first corner again."""
        self.press(tool)
        for corner in (*corners, corners[0]):
            self.point(corner)


def flown_as_planned(page: Page, export: Callable[[], None]) -> None:
    """Export the mission and find five vehicles in it, with altitude and fence."""
    with page.expect_download() as waiting:
        export()
    missions = [
        json.loads(text) for name, text in unzipped(waiting.value).items() if name.endswith(".plan")
    ]
    assert len(missions) == 5
    for mission in missions:
        fence = mission["geoFence"]["polygons"]
        assert sorted((each["inclusion"], len(each["polygon"])) for each in fence) == [
            (False, 3),
            (True, 6),
        ]
        altitudes = {item["Altitude"] for item in mission["mission"]["items"] if "Altitude" in item}
        assert altitudes == {60}


@pytest.mark.parametrize(
    ("size", "touch"),
    [(DESKTOP, False), (TABLET, True), (PHONE, True), (DOUBLED, False)],
    ids=["desktop", "tablet", "phone", "doubled"],
)
def test_a_team_over_a_field_comes_to_a_mission_in_22_actions(
    tabs: Tabs, server: Server, size: tuple[int, int], touch: bool
) -> None:
    with visiting(tabs, server.url, size=size, touch=touch) as visit:
        page, hands = visit.page, Hands(visit.page)
        visit.verdict("GO")
        hands.press("New …")
        hands.fill("Vehicles", "5")
        hands.press("Create")
        visit.verdict("5 vehicles know where they are")
        if size == DESKTOP:
            # the upper left corner lies under the tools
            hands.press("Zoom out")
            page.wait_for_timeout(300)
        hands.outline("Area", FIELD)
        hands.outline("Keep-out", KEEP_OUT)
        visit.verdict("GO in 31 simulated flights")
        if page.locator("#sheet").is_visible():
            hands.press("Details")
        hands.press("Preflight", "tab")
        lacks = page.locator("#export-lacks")
        expect(lacks).to_have_text("Export needs latitude and longitude of the point 0, 0.")
        hands.fill("Altitude above ground", "60")
        hands.fill("Latitude of the origin", "47.4")
        hands.fill("Longitude of the origin", "8.5")
        visit.settle()
        expect(lacks).to_be_empty()
        flown_as_planned(page, lambda: hands.press("Export"))
        assert hands.actions <= 22


def test_a_team_over_a_field_comes_to_a_mission_by_keyboard_in_32_actions(
    visit: Visit, page: Page
) -> None:
    actions = 0

    def go_to(target: Locator) -> None:
        for _ in range(150):
            if target.evaluate("target => target === document.activeElement"):
                return
            page.keyboard.press("Tab")
        raise AssertionError(f"no way to {target} by Tab")

    def pressed(name: str) -> None:
        nonlocal actions
        actions += 1
        go_to(page.get_by_role("button", name=name, exact=True))
        page.keyboard.press("Enter")

    def typed(label: str, text: str) -> None:
        nonlocal actions
        actions += 1
        go_to(field(page, label))
        page.keyboard.press("Control+a")
        page.keyboard.type(text)

    pressed("New …")
    typed("Vehicles", "5")
    pressed("Create")
    visit.verdict("5 vehicles know where they are")
    for kind, corners in (("area", FIELD), ("keep-out", KEEP_OUT)):
        pressed(f"Add {kind}")
        typed("Corners", "; ".join(f"{x:g}, {y:g}" for x, y in corners))
        page.keyboard.press("Tab")
    visit.verdict("GO in 31 simulated flights")
    actions += 1
    go_to(page.get_by_role("tab", selected=True))
    while page.get_by_role("tab", selected=True).text_content() != "Preflight":
        page.keyboard.press("ArrowRight")
    typed("Altitude above ground", "60")
    typed("Latitude of the origin", "47.4")
    typed("Longitude of the origin", "8.5")
    visit.settle()
    actions += 1
    flown_as_planned(page, lambda: page.keyboard.press("Enter"))
    assert actions <= 32
