"""The printed report of a plan: its figures are the plan's, and it holds no script."""

import re
from dataclasses import replace
from datetime import date
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import syncplan
from syncplan.exporting.formats import ExportOptions, export
from syncplan.plotting.figure_style import PLAIN
from syncplan.plotting.formation_figures import formation_spec
from syncplan.plotting.printed_report import MOST_CORNERS, MOST_LISTED, STYLE_DIGEST, style
from syncplan.plotting.static_map import map_svg
from syncplan.reports.plan_report import plan_document
from syncplan.scenario.ground import lat_lon_of
from tests.tools.exported import sidecar_of
from tests.tools.flown import WELL
from tests.tools.on_paper import plan
from tests.tools.scenarios import circling, example, planned

DAY = date(2026, 5, 1)


def words(page: str) -> str:
    """The text of a page, on one line."""
    body = page.partition("<body")[2]
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", body)).split()).replace(" ,", ",")


def test_a_report_states_the_plan_s_own_figures() -> None:
    made = plan(example("windy-grid"))
    page = syncplan.report_page(made, identifier="some-plan", made_on=DAY)
    assert page == syncplan.report_page(made, identifier="some-plan", made_on=DAY)
    said, known = words(page), plan_document(made)
    worst = max(value for value in known.predicted_rms_m.vehicles.values() if value is not None)
    for text in (
        f"1 May 2026 · syncplan {syncplan.__version__} · some-plan",
        "✓ GO on paper: not flown; 6 vehicles know where they are to "
        f"{worst:.2g} m (worst RMS, predicted)",
        *(one.message for one in made.verdict.findings),
        "Rank: 18 of 18, observable, over",
        f"Certificate: holds, {known.observability.certificate.reason}",
        f"Period: {known.period_s:.4g} s",
        f"Connectivity period: {known.connectivity_period_s:.4g} s",
        f"all vehicles: {known.predicted_rms_m.overall:.3g} m",
        f"Least separation: {known.separation.min_m:.4g} m",
        "as planned; required: ",
        "standard deviation of each component of the common, constant wind 1 m/s",
        "The filter estimates wind beside the poses.",
        "length of the run that errors are predicted for 400 s",
    ):
        assert text in said
    for one in known.vehicles:
        x, y = one.center_m
        error = known.predicted_rms_m.vehicles[one.name]
        row = f"{one.name} {x:g}, {y:g} {one.radius_m:g} {one.direction} {one.phase_rad:.4f}"
        assert f"{row} {error:.3g}" in said


def test_places_far_from_the_origin_are_told_apart_in_report_and_table(printed: Any) -> None:
    source = Path(__file__).parents[1] / "data" / "hard" / "utm.yaml"
    said = words(syncplan.report_page(plan(source)))
    assert "v2 465070, 5249000 20 ccw" in said
    assert "L2 (465190, 5249070)" in said
    table = printed("plan", str(source), "--paper", "--format", "table")
    assert re.search(r"v6 +465140, 5249070 +20 +ccw ", table)


PLACED: dict[str, Any] = {
    "name": "placed",
    "altitude_m": [40.0, 55.5],
    "orbit": circling(radius_m=[20.0, 25.0]),
    "area_m": [[-50.0, -60.0], [130.0, -60.0], [130.0, 70.0], [-50.0, 70.0]],
    "keep_out_m": [[[30.0, 40.0], [40.0, 40.0], [35.0, 50.0]]],
    "geo_origin": {"lat_deg": 47.3977, "lon_deg": 8.5456, "alt_m": 488.0},
    "min_separation_m": 5.0,
    "wind": {"sigma_mps": 1.0, "gust_sigma_mps": 0.2},
}


def test_what_a_flight_needs_is_stated_to_be_signed() -> None:
    judged = planned(**PLACED)
    said = words(syncplan.report_page(judged, identifier="some-plan", made_on=DAY))
    sidecar = sidecar_of(export(judged, "qgc", ExportOptions(force=True)))
    for vehicle in sidecar["vehicles"]:
        place = f"{vehicle['center_lat_deg']:.7f}°, {vehicle['center_lon_deg']:.7f}°"
        height = f"{vehicle['entry']['altitude_m']:g}"
        rate = f"{vehicle['autopilot_parameters']['CIRCLE_RATE']:.4g}"
        assert f"{vehicle['name']} {vehicle['speed_mps']:.4g} {rate} {height} {place}" in said
    origin = judged.scenario.geo_origin
    assert origin is not None
    for corner in (*PLACED["area_m"], *PLACED["keep_out_m"][0]):
        latitude, longitude = lat_lon_of(origin, np.array(corner)).tolist()
        assert f"({corner[0]:g}, {corner[1]:g}) {latitude:.7f}°, {longitude:.7f}°" in said
    for text in (
        "placed · 1 May 2026 · syncplan",
        "Wind: constant 1 m/s, gusts 0.2 m/s",
        "Take-off and landing: not part of the plan",
        "as planned; required: 5 m",
        f"Basis of the verdict: {judged.verdict.headline}, geometry, rank and prediction, and no",
        "47.3977000°, 8.5456000°, ground 488 m above sea level",
        "Planned by Name Role Date Signature Released by Name Role Date Signature",
    ):
        assert text in said, text
    assert "altitude 488" not in said


def test_what_is_not_stated_is_called_so() -> None:
    judged = planned()
    said = words(syncplan.report_page(judged))
    for text in (
        "v1 4 -11.46 not stated v2 4 -11.46 not stated",
        "still air assumed",
        "required: none stated",
        "(x, y) in m Area: none stated Keep-outs: none stated",
    ):
        assert text in said, text
    assert "latitude" not in said


def test_the_basis_of_a_flown_plan_is_its_flights() -> None:
    flown = replace(plan(example("paper-grid-same"), bound="never"), flight=WELL)
    said = words(syncplan.report_page(flown))
    assert (
        "Basis of the verdict: GO in 50 simulated flights, 50 simulated flights of 200 s, "
        "guidance track, filter robust, seed 0" in said
    )


def test_polygons_with_too_many_corners_are_counted() -> None:
    ring = [[300.0 + 9.0 * np.cos(a), 9.0 * np.sin(a)] for a in 0.1 * np.arange(60)]
    rings = [[[x, y + 30.0 * k] for x, y in ring] for k in range(4)]
    said = words(syncplan.report_page(planned(keep_out_m=rings)))
    assert MOST_CORNERS == 120
    assert "Keep-out 2: (" in said
    assert "Keep-out 3, Keep-out 4: 120 corners, which the plan lists" in said


def test_the_map_has_the_colours_of_the_web_page() -> None:
    """Of its light and its dark theme."""
    page = (Path(__file__).parents[2] / "api" / "page" / "page.css").read_text("utf-8")
    for name in ("circle", "strong", "weak", "motion", "kept-out", "obstacle"):
        theirs, ours = (re.findall(rf"--{name}: (#\w+);", css) for css in (page, style()))
        assert len(ours) == 2
        assert ours == theirs
        assert f"var(--{name})" in style()
    report = syncplan.report_page(plan(example("shelves"), bound="never"))
    drawn = set(re.findall(r'(?:stroke|fill)="([#r][^"]+)"', report))
    painted = set(re.findall(r'\[(?:stroke|fill)="([^"]+)"\]', style()))
    assert drawn <= painted


def test_a_report_of_a_plan_that_is_no_go_says_why_and_what_cures_it() -> None:
    made = plan(example("paper-grid-alternate"))
    said = words(syncplan.report_page(made))
    assert "✗ NO-GO: 2 reasons; not every position and heading can be known" in said
    for one in made.verdict.findings:
        assert one.cure is not None
        assert f"Stop: {one.message} Cure: {one.cure.text}" in said
    assert "unobservable: stretch of v1-v2" in said


def test_errors_that_are_not_predicted_are_left_out() -> None:
    said = words(syncplan.report_page(planned(landmarks_m=[[0, 40], [70, -40]])))
    assert "all vehicles: unknown" in said
    assert "Worst vehicle" not in said


def test_a_team_too_large_for_a_sheet_is_described_in_a_sentence() -> None:
    team = {"shape": "grid", "count": MOST_LISTED + 1, "spacing_m": 70}
    scenario = {"formation": team, "orbit": circling()}
    said = words(syncplan.report_page(planned(**scenario)))
    assert f"{MOST_LISTED + 1} vehicles, {MOST_LISTED + 1} of them counter-clockwise" in said
    assert "sense" not in said
    assert "Speeds 4 m/s; altitudes not stated. The plan lists each circle." in said
    heights = [1200.5 + k for k in range(MOST_LISTED + 1)]
    said = words(syncplan.report_page(planned(**scenario, altitude_m=heights)))
    assert "altitudes 1200.5 to 1250.5 m." in said


def test_names_are_text_whatever_they_hold() -> None:
    team: dict[str, Any] = {"centers_m": {"<b>&'\"": [0, 0], "v2": [70, 0]}}
    page = syncplan.report_page(planned(name="<script>alert(1)</script>", formation=team))
    assert "<script" not in page
    assert "<b>" not in page
    assert page.count("&lt;b&gt;&amp;") >= 2


def test_the_page_holds_one_style_and_fetches_nothing() -> None:
    page = syncplan.report_page(plan(example("shelves")))
    assert page.count("<style>") == 1
    assert STYLE_DIGEST in page
    assert not re.search(r"\s(style|src|href|on\w+)=|url\(|@import", page)


@pytest.mark.parametrize("name", ["shelves", "paper-grid-alternate", "triangle-lattice"])
def test_the_map_has_every_mark_of_the_figure_in_its_colours(name: str) -> None:
    made = plan(example(name), bound="never")
    spec = formation_spec(made, PLAIN)
    svg = map_svg(spec, PLAIN.plot_px, "Map")
    for trace in spec["data"]:
        points = [x for x in trace["x"] if x is not None]
        if "lines" in trace["mode"] and points:
            assert f'stroke="{trace["line"]["color"]}"' in svg, trace["uid"]
            dashed = trace["line"].get("dash", "solid") != "solid"
            (drawn,) = re.findall(rf"<path [^>]*{trace['line']['color']}[^>]*>", svg)[:1]
            assert ("stroke-dasharray" in svg) >= dashed, drawn
    assert svg.count("<text") == made.orbits.count + len(made.landmarks) + 1
    stars = [trace for trace in spec["data"] if trace["uid"] == "landmarks"]
    assert svg.count("scale(6.5)") == sum(len(one["x"]) for one in stars)
