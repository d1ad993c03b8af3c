"""Vehicles and landmarks added on the page: where there is room, within reach, selected."""

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from playwright.sync_api import Page, expect

from syncplan.scenario.loading import scenario_from
from tests.page.gestures import downloaded, handle, opened
from tests.tools.browsing import Visit, accessibility_faults
from tests.tools.on_paper import plan
from tests.tools.scenarios import document
from tests.tools.serving import ROOT

BLOCKING = {"vehicles-too-close", "landmark-too-close", "outside-area", "in-keep-out"}
AREA = [[-60.0, -60.0], [200.0, -60.0], [200.0, 130.0], [-60.0, 130.0]]
KEPT = [[[-20.0, 45.0], [90.0, 45.0], [90.0, 100.0], [-20.0, 100.0]]]

NODE = Path(sys.executable).parent / "node"
FREE_SPACE = ROOT / "api" / "page" / "free_space.js"

Tree = dict[str, Any]


def test_what_is_added_lies_in_free_space_and_is_selected(visit: Visit, page: Page) -> None:
    for changes in (
        {"area_m": AREA, "keep_out_m": KEPT, "min_separation_m": 6.0},
        {"formation": {"centers_m": [[0.0, 0.0]]}},
        {"landmarks_m": [[190.0, 0.0], [35.0, 60.0]]},
    ):
        opened(page, given := document(name=" and ".join(changes), **changes))
        before = len(given["formation"]["centers_m"])
        for k in range(before, before + 3):
            page.get_by_role("button", name="Add vehicle").press("Enter")
            expect(page.locator("#chosen")).to_have_value(f"vehicle {k}")
            expect(page.locator("#chosen")).to_be_focused()
            expect(handle(page, f"v{k + 1}")).to_have_attribute("aria-pressed", "true")
            expect(page.locator("#notice")).to_contain_text(f"v{k + 1} added at")
            visit.settle()
        landmarks = len(given.get("landmarks_m", []))
        for k in range(landmarks, landmarks + 3):
            page.get_by_role("button", name="Add landmark").click()
            expect(page.locator("#chosen")).to_have_value(f"landmark {k}")
            visit.settle()
        scenario = downloaded(page)
        made = plan(scenario_from(scenario), bound="never")
        assert BLOCKING.isdisjoint(one.code for one in made.verdict.findings)
        assert len(scenario["formation"]["centers_m"]) == before + 3
        assert len(scenario["landmarks_m"]) == landmarks + 3
        # nobody is out of everybody's reach, the links follow, and each new landmark is seen
        assert {k for one in made.links for k in (one.a, one.b)} == set(range(before + 3))
        seen = {link.b - made.orbits.count for link in made.landmark_links}
        assert set(range(landmarks, landmarks + 3)) <= seen
    assert accessibility_faults(page) == []


def test_a_vehicle_added_to_listed_links_is_linked_to_a_go(visit: Visit, page: Page) -> None:
    page.get_by_role("button", name="Add vehicle").click()
    visit.verdict("✓ GO")
    visit.verdict("Observable: rank 21 of 21")
    expect(page.locator("#notice")).to_contain_text("with the link v5-v7")
    assert downloaded(page)["formation"]["links"][-1] == ["v5", "v7"]
    page.get_by_role("button", name="Undo").click()
    visit.verdict("Observable: rank 18 of 18")
    assert ["v5", "v7"] not in downloaded(page)["formation"]["links"]


@pytest.mark.quick
def test_where_there_is_no_room_none_is_added_and_the_page_says_so(page: Page) -> None:
    tight = [[-25.0, -25.0], [95.0, -25.0], [95.0, 25.0], [-25.0, 25.0]]
    opened(page, document(name="tight", area_m=tight))
    page.get_by_role("button", name="Add vehicle").click()
    expect(page.locator("#notice.bad")).to_contain_text("There is no room for another circle")
    assert len(downloaded(page)["formation"]["centers_m"]) == 2


def _drawn(generator: np.random.Generator) -> Tree:
    """A team of mixed circles that do not touch, with landmarks, an area and keep-outs."""
    count = int(generator.integers(1, 9))
    centers: list[list[float]] = []
    radii: list[float] = []
    while len(centers) < count:
        at, radius = generator.uniform(0.0, 400.0, 2), float(generator.uniform(5.0, 30.0))
        if all(math.dist(at, c) > radius + r + 5.0 for c, r in zip(centers, radii, strict=True)):
            centers.append(at.tolist())
            radii.append(radius)
    sides = generator.uniform(10.0, 60.0, (3, 2))
    corners = generator.uniform(-100.0, 500.0, (3, 2))
    boxes = [shapely.box(*at, *(at + side)) for at, side in zip(corners, sides, strict=True)]
    return {
        "orbit": {"radius_m": radii, "direction": "ccw"},
        "formation": {"centers_m": centers},
        "sensor": {"range_m": float(generator.uniform(20.0, 120.0)), "fov_deg": 360},
        "landmarks_m": generator.uniform(0.0, 400.0, (int(generator.integers(0, 4)), 2)).tolist(),
        "min_separation_m": float(generator.choice([0.0, 12.0])),
        "area_m": [[-150.0, -150.0], [550.0, -150.0], [550.0, 550.0], [-150.0, 550.0]],
        "keep_out_m": [list(map(list, one.exterior.coords))[:-1] for one in boxes],
    }


def _free(scenarios: list[Tree], what: str) -> Any:
    """What a function of the page's module finds for scenarios."""
    script = f"""
        import {{ readFileSync }} from "node:fs";
        import {{ {what} }} from "{FREE_SPACE.as_uri()}";
        const found = JSON.parse(readFileSync(0, "utf8")).map({what});
        process.stdout.write(JSON.stringify(found));"""
    command = [str(NODE), "--input-type=module", "--eval", script]
    return json.loads(subprocess.check_output(command, input=json.dumps(scenarios).encode()))


@pytest.mark.quick
def test_free_centres_of_drawn_teams_are_clear_of_everything_and_within_reach() -> None:
    generator = np.random.default_rng(13)
    drawn = [_drawn(generator) for _ in range(60)]
    for scenario, place in zip(drawn, _free(drawn, "freeCenter"), strict=True):
        assert place is not None
        at = (place["x"], place["y"])
        radii, centers = scenario["orbit"]["radius_m"], scenario["formation"]["centers_m"]
        radius = radii[-1]
        mean = float(np.mean([*radii, radius]))
        gaps = [math.dist(at, c) - r - radius for c, r in zip(centers, radii, strict=True)]
        assert min(gaps) >= (scenario["min_separation_m"] or 0.1 * mean)
        assert all(math.dist(at, one) >= radius + 0.1 * mean for one in scenario["landmarks_m"])
        disc = shapely.Point(at).buffer(radius)
        assert shapely.Polygon(scenario["area_m"]).covers(disc)
        assert not any(shapely.Polygon(one).intersects(disc) for one in scenario["keep_out_m"])
        assert min(gaps) <= scenario["sensor"]["range_m"]


@pytest.mark.quick
def test_free_places_among_obstacles_are_in_sight_of_the_team() -> None:
    generator = np.random.default_rng(14)
    drawn = [_drawn(generator) for _ in range(40)]
    for one in drawn:
        one["obstacles_m"] = one.pop("keep_out_m")
    for what in ("freeCenter", "freeSite"):
        for scenario, place in zip(drawn, _free(drawn, what), strict=True):
            assert place is not None
            at = shapely.Point(place["x"], place["y"])
            walls = shapely.MultiPolygon([shapely.Polygon(w) for w in scenario["obstacles_m"]])
            sight = [shapely.LineString([at, c]) for c in scenario["formation"]["centers_m"]]
            disc = at.buffer(scenario["orbit"]["radius_m"][-1] if what == "freeCenter" else 0.01)
            assert not walls.intersects(disc)
            assert any(not walls.crosses(line) for line in sight)
