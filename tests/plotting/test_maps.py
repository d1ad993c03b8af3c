"""Maps: links end on rims and leave names free, senses and areas are shown, axes have one scale."""

import html
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.orbits.circles import Orbits
from syncplan.planning.plan_files import Loaded, plan_of
from syncplan.planning.plans import Plan
from syncplan.plotting.figure_files import figure_images
from syncplan.plotting.figure_style import PLAIN, FigureStyle
from syncplan.plotting.figures import specs_of
from syncplan.plotting.links import DROPPED, link_ends, standing_of
from syncplan.plotting.maps import view_of
from tests.tools.figure_parts import lines_of, note_of, spec_of, trace_of, turns_of
from tests.tools.image_browser import needs_browser
from tests.tools.on_paper import plan
from tests.tools.scenarios import example, small

LINKS = ("link-", "incidental-", "landmark-", "dropped")
"""Beginnings of the identifiers of links."""

STYLES = (FigureStyle(width=1200), FigureStyle(width=400), FigureStyle(font_scale=2.0))

ROW = {"centers_m": [[0.0, 0.0], [70.0, 0.0], [140.0, 0.0], [210.0, 0.0]]}
"""Where a link from the first to the third runs through the second's centre."""

AREA = [[-40.0, -60.0], [260.0, -60.0], [260.0, 60.0], [-40.0, 60.0]]


def _seeing(reach: float, **changes: Any) -> Plan:
    sensor = {"range_m": reach, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1}
    return plan(small(sensor=sensor, **changes), bound="never")


TEAMS = {
    "grid": lambda: plan(example("paper-grid-alternate")),
    "camera": lambda: plan(example("mixed-radii-camera")),
    "row": lambda: _seeing(160.0, formation=ROW, landmarks_m=[[105.0, 40.0], [105.0, -40.0]]),
    "overlapping": lambda: _seeing(160.0, formation={"centers_m": [[0.0, 0.0], [33.0, 0.0]]}),
    "many": lambda: plan(
        small(formation={"shape": "hex", "count": 30, "columns": 6, "spacing_m": 70.0}),
        bound="never",
    ),
}


@pytest.fixture(scope="module", params=list(TEAMS))
def team(request: pytest.FixtureRequest) -> Plan:
    return TEAMS[request.param]()


def test_links_end_at_the_rims_of_their_circles(team: Plan) -> None:
    names = team.scenario.vehicle_names + team.scenario.landmark_names
    bodies = np.concatenate([team.orbits.centers, team.landmarks.reshape(-1, 2)])
    reach = np.concatenate([team.orbits.radii, np.zeros(len(team.landmarks))])
    drawn = 0
    for trace in spec_of(team, "formation")["data"]:
        if not trace["uid"].startswith(LINKS):
            continue
        texts = [text for text in trace["text"] if text]
        for text, (start, middle, end) in zip(texts, lines_of(trace), strict=True):
            a, b = (names.index(name) for name in text.partition(",")[0].split("-"))
            assert np.hypot(*(start - bodies[a])) == pytest.approx(reach[a], abs=0.02)
            assert np.hypot(*(end - bodies[b])) == pytest.approx(reach[b], abs=0.02)
            np.testing.assert_allclose(middle, (start + end) / 2.0, atol=0.02)
            gap = np.hypot(*(bodies[b] - bodies[a])) - reach[a] - reach[b]
            # of circles apart, along the line of centres
            assert gap < 0.0 or np.hypot(*(end - start)) == pytest.approx(gap, abs=0.02)
            drawn += 1
    met = [*team.links, *team.incidental_links, *team.landmark_links, *team.dropped_links]
    assert drawn == len(met)


coordinate = st.integers(-1000, 1000).map(lambda k: k / 10.0)
radius = st.integers(10, 1000).map(lambda k: k / 10.0)


@given(st.tuples(coordinate, coordinate), st.tuples(coordinate, coordinate), radius, radius)
def test_ends_lie_on_both_rims_however_two_circles_lie(
    one: tuple[float, float], other: tuple[float, float], first: float, second: float
) -> None:
    centers, radii = np.array([one, other]), np.array([first, second])
    orbits = Orbits(centers, radii, np.ones(2), np.zeros(2), 0.2)
    start, end = link_ends(orbits, np.empty((0, 2)), np.array([[0, 1]]))
    assert np.hypot(*(start[0] - centers[0])) == pytest.approx(first, rel=1e-6)
    assert np.hypot(*(end[0] - centers[1])) == pytest.approx(second, rel=1e-6)
    apart = float(np.hypot(*(centers[1] - centers[0])))
    if apart > first + second:
        assert np.hypot(*(end[0] - start[0])) == pytest.approx(apart - first - second, abs=1e-6)
    # where names stand, no line passes
    middle = start[0] + np.linspace(0.0, 1.0, 101)[:, None] * (end[0] - start[0])
    for center in centers:
        assert np.hypot(*(middle - center).T).min() > 0.2 * min(first, second) - 1e-6


@pytest.mark.parametrize("style", STYLES, ids=["wide", "column", "large text"])
def test_no_link_strikes_through_a_name(team: Plan, style: FigureStyle) -> None:
    spec = spec_of(team, "formation", style=style)
    scale = view_of(style, team).scale
    along = np.linspace(0.0, 1.0, 801)[:, None]
    lines = [line for t in spec["data"] if t["uid"].startswith(LINKS) for line in lines_of(t)]
    points = np.concatenate([line[0] + along * (line[-1] - line[0]) for line in lines])
    names = trace_of(spec, "names")
    shown = 0
    sizes = names["textfont"]["size"]
    for text, x, y, size in zip(names["text"], names["x"], names["y"], sizes, strict=True):
        if text:
            half = 0.5 * size * np.array([0.55 * len(html.unescape(text)), 0.9]) / scale
            inside = (np.abs(points - [x, y]) < half).all(axis=1)
            assert not inside.any(), text
            shown += 1
    assert shown == len(names["text"])


def test_names_fit_their_circles_where_there_is_room(team: Plan) -> None:
    spec = spec_of(team, "formation")
    names, scale = trace_of(spec, "names"), view_of(PLAIN, team).scale
    for text, size in zip(names["text"], names["textfont"]["size"], strict=True):
        assert 7.0 <= size <= 13.0
        assert 0.5 * len(html.unescape(text)) * size < 2.0 * scale * team.orbits.radii.max()


def test_a_landmark_s_name_stands_where_no_link_comes_from() -> None:
    made = _seeing(160.0, landmarks_m=[[35.0, 40.0], [35.0, -40.0]])
    spec = spec_of(made, "formation")
    above, below = trace_of(spec, "landmarks")["textposition"]
    assert above.startswith("top")
    assert below.startswith("bottom")


def test_lines_are_thinner_where_vehicles_or_links_are_many() -> None:
    widths = []
    for count, columns, reach in ((6, 6, 50.0), (100, 10, 50.0), (12, 4, 50.0), (12, 4, 130.0)):
        shape = {"shape": "grid", "count": count, "columns": columns, "spacing_m": 70.0}
        spec = spec_of(_seeing(reach, formation=shape), "formation")
        lines = [t for t in spec["data"] if t["uid"].startswith(("link", "circles"))]
        widths.append({trace["uid"]: trace["line"]["width"] for trace in lines})
    few, many, near, far = widths
    for uid, width in many.items():
        assert 0.5 <= width < few[uid]
    assert 0.5 < far["link-certified"] < near["link-certified"]


def test_areas_are_on_every_map_at_one_scale() -> None:
    zone = [[30.0, 35.0], [40.0, 35.0], [35.0, 45.0]]
    shelf = [[60.0, -45.0], [80.0, -45.0], [80.0, -40.0]]
    walls = [zone, shelf]
    made = plan(
        small(formation=ROW, area_m=AREA, keep_out_m=[zone], obstacles_m=walls), bound="never"
    )
    specs = specs_of(made, ["formation", "animation", "comparison"], after=made)
    for name, spec in specs.items():
        scale = (spec["layout"]["yaxis"][key] for key in ("scaleanchor", "scaleratio"))
        assert tuple(scale) == ("x", 1)
        area, kept_out = trace_of(spec, "area"), trace_of(spec, "keep-out")
        drawn = np.column_stack([area["x"][:4], area["y"][:4]]).astype(float)
        np.testing.assert_allclose(drawn, AREA, err_msg=name)
        assert kept_out["fill"] == "toself"
        obstacle = trace_of(spec, "obstacle")
        assert obstacle["fill"] == "toself"
        assert obstacle["fillcolor"] != kept_out["fillcolor"]
        drawn = np.column_stack([obstacle["x"], obstacle["y"]])
        corners = [[*zone, zone[0]], [*shelf, shelf[0]]]
        assert [one for one in drawn.tolist() if one[0] is not None] == [*corners[0], *corners[1]]
        moving = {n for frame in spec.get("frames", []) for n in frame["traces"]}
        assert spec["data"].index(area) not in moving


def test_a_comparison_shows_and_says_which_vehicles_turn_round() -> None:
    before = plan(small(formation=ROW), bound="never")
    senses = np.array([1.0, -1.0, 1.0, 1.0])
    after = plan_of(Loaded(before.scenario, replace(before.orbits, senses=senses)))
    spec = spec_of(before, "comparison", after=after)
    for side, one in (("before", before), ("after", after)):
        heads = trace_of(spec, f"heads-{side}")
        arm = np.column_stack([heads["x"], heads["y"]]) - one.orbits.centers
        np.testing.assert_allclose(np.hypot(*arm.T), one.orbits.radii, atol=0.01)
        np.testing.assert_array_equal(turns_of(heads, one.orbits.centers), one.orbits.senses)
    assert note_of(spec).endswith("v2 changes direction")
    same = spec_of(before, "comparison", after=before)
    assert note_of(same).endswith("all keep their direction")


def test_far_from_the_origin_places_are_told_apart_under_the_pointer_and_at_the_axes() -> None:
    east, north = 465000.0, 5249000.0
    made = plan(small(formation={"centers_m": [[east, north], [east + 70.25, north]]}))
    spec = spec_of(made, "comparison", after=made)
    centers = trace_of(spec, "centers-after")
    assert [text.split(": ")[1] for text in centers["text"]] == [
        "465000, 5249000 m",
        "465070.25, 5249000 m",
    ]
    assert centers["hovertemplate"] == "%{text}<extra></extra>"
    # no thousands cut to "465k"
    assert {spec["layout"][axis]["exponentformat"] for axis in ("xaxis", "yaxis")} == {"none"}


def test_ranks_and_kinds_of_links_differ_in_more_than_width_and_colour() -> None:
    made = plan(small(landmarks_m=[[35.0, 40.0]]), bound="never")
    link, landmark = made.links[0], made.landmark_links[0]
    shown = []
    for meeting, full, incidental in ((link, 3, False), (link, 3, True), (landmark, 2, False)):
        of_kind = [
            standing_of(
                made, replace(meeting, rank=rank, certified=certified), incidental=incidental
            )
            for rank, certified in ((full, True), *((one, False) for one in range(full + 1)))
        ]
        assert len({one.dash for one in of_kind}) == len(of_kind)
        assert len({one.pattern for one in of_kind}) == len(of_kind)
        shown.append(of_kind)
    links, incidental_ones, _ = shown
    # of a rank, an incidental link has a mark; a landmark's ends at a star
    for one, other in zip(links, incidental_ones, strict=True):
        assert one.dash == other.dash
        assert one.mark != other.mark
    assert DROPPED.mark not in {one.mark for one in links + incidental_ones}


def test_an_incidental_link_has_its_mark_in_the_middle() -> None:
    made = plan(small(formation=ROW), bound="never")
    other = replace(made, links=made.links[1:], incidental_links=made.links[:1])
    spec = spec_of(other, "formation")
    (trace,) = (one for one in spec["data"] if one.get("uid", "").startswith("incidental"))
    assert trace["marker"]["symbol"] == "circle-open"
    assert [size > 0.0 for size in trace["marker"]["size"]] == [False, True, False, False]
    assert trace["x"][1] == pytest.approx(0.5 * (trace["x"][0] + trace["x"][2]))


def test_maps_of_many_vehicles_leave_details_to_hovering(monkeypatch: pytest.MonkeyPatch) -> None:
    made, kinds = plan(example("paper-grid-same"), bound="never"), ["formation", "animation"]
    few = specs_of(made, kinds)
    monkeypatch.setattr("syncplan.plotting.maps.MANY_VEHICLES", 2)
    many = specs_of(made, kinds)
    for name in kinds:
        assert any(trace_of(few[name], "names")["text"])
        assert trace_of(many[name], "names")["text"] == []
        # a third as many points on each circle, and a gap after it
        assert len(trace_of(few[name], "circles-ccw")["x"]) == 6 * (72 + 2)
        assert len(trace_of(many[name], "circles-ccw")["x"]) == 6 * (24 + 2)
    assert trace_of(many["formation"], "vehicles") == {
        **trace_of(few["formation"], "vehicles"),
        **{axis: trace_of(many["formation"], "vehicles")[axis] for axis in ("x", "y")},
    }
    drawn = {trace["uid"] for trace in many["formation"]["data"]}
    assert {trace["uid"] for trace in few["formation"]["data"]} - drawn == {"heads-ccw"}
    assert len(many["animation"]["frames"]) == 20
    assert "arrowheads" not in note_of(many["animation"])


@pytest.mark.long
@needs_browser
def test_circles_are_round() -> None:
    made = plan(example("paper-grid-same"), bound="never")
    specs = {
        str(height): spec_of(made, "formation", style=FigureStyle(width=500, height=height))
        for height in (None, 900)
    }
    for image in figure_images(specs, "svg", FigureStyle(width=500)).values():
        # from the circles' trace to the next one
        drawn = image.decode("utf-8").split("tracecircles-ccw")[1].split('class="trace scatter')[0]
        lines = re.findall(r'class="js-line"[^>]*? d="([^"]+)"', drawn)
        circles = [np.array(re.findall(r"-?[\d.]+", line), dtype=float) for line in lines]
        assert len(circles) == made.orbits.count
        for circle in circles:
            wide, tall = np.ptp(circle.reshape(-1, 2), axis=0)
            assert wide == pytest.approx(tall, rel=0.01)
