"""Layouts: sizes, text and themes as asked for, at any width; long lists stay readable."""

from itertools import pairwise
from typing import Any

import hypothesis
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syncplan import figures
from syncplan.errors import InputError
from syncplan.options import options_of
from syncplan.planning.plans import Plan
from syncplan.planning.validation import validate
from syncplan.plotting.canvas import fitted
from syncplan.plotting.contact_figures import MANY_SIGHTINGS, lanes_of, rows_of, within_period
from syncplan.plotting.figure_style import PLAIN, FigureStyle
from syncplan.plotting.figures import specs_of
from syncplan.plotting.links import body_names
from syncplan.plotting.series_figures import errors_spec
from syncplan.reports.validation_report import ValidationDocument, validation_document
from tests.tools.figure_parts import note_of, spec_of
from tests.tools.on_paper import plan
from tests.tools.scenarios import example, small

LEAST_LABEL_PX = 11.0


@pytest.fixture(scope="module")
def alternating() -> Plan:
    return plan(example("paper-grid-alternate"))


@pytest.fixture(scope="module")
def large() -> Plan:
    shape = {"shape": "grid", "count": 100, "columns": 10, "spacing_m": 70.0}
    return plan(small(formation=shape, landmarks_m=[[-40.0, 0.0], [-40.0, 60.0]]), bound="never")


@settings(max_examples=25, deadline=None)
@given(st.integers(240, 2400), st.sampled_from([0.5, 0.8, 1.0, 1.4, 2.0, 3.0]))
# words are longer than lines
@hypothesis.example(240, 3.0)
def test_parts_share_the_height_and_texts_fit(alternating: Plan, width: int, scale: float) -> None:
    style = FigureStyle(width=width, font_scale=scale)
    for name, spec in specs_of(alternating, style=style).items():
        layout = spec["layout"]
        assert layout["width"] == width
        margin = layout["margin"]
        inner = layout["meta"]["inner_px"]
        assert layout["height"] == margin["t"] + inner + margin["b"], name
        texts = [layout["title"]["text"], layout["title"].get("subtitle", {}).get("text", "")]
        named = [t["name"] for t in spec["data"] if t.get("showlegend", True) and t.get("name")]
        for text, size in zip(texts, (17.0, 13.0), strict=True):
            most = max(map(len, text.split("<br>")))
            assert most <= max(8, (width - 28) / (0.5 * size * scale))
        lines = [len(text.split("<br>")) for text in texts]
        assert margin["t"] > scale * np.dot(lines, (17.0, 13.0)), name
        for text in named:
            most = max(map(len, text.split("<br>")))
            assert most <= max(8, (width - 28 - 46) / (0.5 * 12.0 * scale))


def test_legends_are_unique_and_in_columns(alternating: Plan, report: ValidationDocument) -> None:
    for subject in (alternating, report):
        for name, spec in specs_of(subject).items():
            shown = [t for t in spec["data"] if t.get("showlegend", True) and t.get("name")]
            assert len({trace["name"] for trace in shown}) == len(shown), name
            # grouped entries would flow in columns of different widths
            assert spec["layout"]["legend"]["traceorder"] == "normal"
            # Plotly's arrow hangs from the line of its words
            marks = (
                [t.get("marker", {}).get("symbol") for t in shown if "markers" in t["mode"]]
                if name in ("formation", "animation")
                else []
            )
            assert "arrow" not in marks


@pytest.mark.parametrize("width", [400, 1200])
def test_parts_are_left_out(alternating: Plan, report: ValidationDocument, width: int) -> None:
    for subject in (alternating, report):
        whole = specs_of(subject, style=FigureStyle(width=width))
        bare = FigureStyle(width=width, title=False, subtitle=False, legend=False)
        for name, spec in specs_of(subject, style=bare).items():
            before, after = whole[name]["layout"], spec["layout"]
            assert after["title"]["text"] == ""
            assert "subtitle" not in after["title"]
            assert after["showlegend"] is False
            assert spec["data"] == whole[name]["data"]
            # the plot keeps its size
            margins = [one["margin"]["t"] + one["margin"]["b"] for one in (before, after)]
            assert after["height"] - before["height"] == margins[1] - margins[0] < -60, name


def test_a_note_without_a_title_stands_in_its_place(alternating: Plan) -> None:
    whole, note, title = (
        spec_of(alternating, "formation", style=style)["layout"]
        for style in (PLAIN, FigureStyle(title=False), FigureStyle(subtitle=False))
    )
    said = whole["title"]["subtitle"]
    assert (note["title"]["text"], note["title"]["font"]) == (said["text"], said["font"])
    assert "subtitle" not in {**note["title"], **title["title"]}
    assert title["title"]["text"] == whole["title"]["text"]
    heights = [one["margin"]["t"] for one in (note, title, whole)]
    assert heights == sorted(heights)


def test_a_height_is_kept_or_refused(alternating: Plan) -> None:
    spec = spec_of(alternating, "formation", style=FigureStyle(height=700))
    assert spec["layout"]["height"] == 700
    with pytest.raises(InputError, match="leave no room for the plot; at this width it needs"):
        specs_of(alternating, ["formation"], style=FigureStyle(height=170))


@pytest.mark.parametrize("key", ["width", "height", "font_scale", "pixel_ratio"])
def test_values_beyond_the_limits_are_refused(key: str) -> None:
    limits = next(one.limits for one in options_of(FigureStyle) if one.name == key)
    least, most = limits["ge"], limits["le"]
    style: Any = FigureStyle
    for value in (least, most):
        style(**{key: value})
    for value in (0.99 * least, 1.01 * most, float("nan")):
        with pytest.raises(InputError, match="allowed is") as caught:
            style(**{key: value})
        assert caught.value.key == key


def test_an_unknown_theme_is_refused() -> None:
    with pytest.raises(InputError, match="'blue' is unknown; choose light or dark"):
        FigureStyle(theme="blue")  # type: ignore[arg-type]


def test_text_is_scaled_and_lines_are_not(alternating: Plan) -> None:
    one, two = (
        spec_of(alternating, "spectrum", style=FigureStyle(font_scale=scale))
        for scale in (1.0, 2.0)
    )
    for key in ("title", "legend"):
        assert two["layout"][key]["font"]["size"] == 2.0 * one["layout"][key]["font"]["size"]
    assert two["layout"]["font"]["size"] == 2.0 * one["layout"]["font"]["size"]
    assert one["data"][0]["marker"] == two["data"][0]["marker"]


def test_figures_take_a_style_and_a_theme(alternating: Plan, report: ValidationDocument) -> None:
    style = figures.FigureStyle(width=400, theme="dark")
    for name, figure in figures.figures_of(alternating, style=style).items():
        assert figure.layout.width == 400, name
        assert figure.layout.font.color == "#ececf0", name
    light = figures.formation(alternating, theme="light", style=style)
    assert light.layout.width == 400
    assert light.layout.font.color == "#1b1b1f"
    assert figures.formation(alternating).layout.width is None
    bands = figures.error_bands(report, ["v1"], style=style)
    assert (bands.layout.width, bands.layout.font.color) == (400, "#ececf0")


def _label_spacing(spec: dict[str, Any]) -> float:
    """Px between labels of the timeline's rows."""
    layout = spec["layout"]
    axis, margin = layout["yaxis"], layout["margin"]
    inner = layout["height"] - margin["t"] - margin["b"]
    rows = axis["range"][0] - axis["range"][1]
    every = float(np.diff(axis["tickvals"]).min()) if len(axis["tickvals"]) > 1 else 1.0
    return float(inner * (axis["domain"][1] - axis["domain"][0]) / rows * every)


@pytest.mark.parametrize("width", [1200, 400])
def test_the_timeline_of_a_hundred_has_a_readable_row_for_each(large: Plan, width: int) -> None:
    spec = spec_of(large, "timeline", style=FigureStyle(width=width))
    assert spec["layout"]["yaxis"]["ticktext"] == large.scenario.vehicle_names
    assert _label_spacing(spec) >= LEAST_LABEL_PX
    assert spec["layout"]["height"] < 2000


def test_of_many_rows_every_few_have_a_label() -> None:
    shape = {"shape": "line", "count": 240, "spacing_m": 70.0}
    spec = spec_of(plan(small(formation=shape), bound="never"), "timeline")
    assert len(spec["layout"]["yaxis"]["ticktext"]) < 200
    assert _label_spacing(spec) >= LEAST_LABEL_PX
    assert spec["layout"]["height"] < 2200


def test_lanes_hold_every_window_once_and_none_over_another(large: Plan, alternating: Plan) -> None:
    for made, by_vehicle in ((large, True), (alternating, False)):
        sightings = rows_of(made)
        assert (len(sightings) > MANY_SIGHTINGS) == by_vehicle
        lanes, labels = lanes_of(made, body_names(made))
        expected = sorted(
            (one.observer, one.target, *window)
            for one in sightings
            for window in within_period(one.windows, made.orbits.period)
        )
        drawn = [(x.sighting.observer, x.sighting.target, x.start, x.end) for x in lanes]
        assert sorted(drawn) == expected
        for row in range(len(labels)):
            here = [lane for lane in lanes if lane.row == row]
            assert all(abs(lane.at - row) + 0.5 * lane.width < 0.5 for lane in here)
            for at in {lane.at for lane in here}:
                ordered = sorted((x.start, x.end) for x in here if x.at == at)
                assert all(a[1] <= b[0] for a, b in pairwise(ordered))
            if by_vehicle:
                assert {labels[row]} == {f"v{lane.sighting.observer + 1}" for lane in here}


def test_a_timeline_keeps_the_least_contacts(large: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    contact: dict[int, float] = {}
    for one in rows_of(large):
        seen = float(np.diff(one.windows).sum())
        contact[one.observer] = contact.get(one.observer, 0.0) + seen
    assert "least contact" not in note_of(spec_of(large, "timeline"))
    monkeypatch.setattr("syncplan.plotting.contact_figures.MOST_ROWS", 5)
    lanes, labels = lanes_of(large, body_names(large))
    kept = {lane.sighting.observer for lane in lanes}
    assert [f"v{k + 1}" for k in sorted(kept)] == labels
    assert len(kept) == 5
    assert max(contact[k] for k in kept) <= min(contact[k] for k in contact if k not in kept)
    note = note_of(spec_of(large, "timeline"))
    assert note.endswith(f"rows are the 5 of {len(contact)} vehicles with the least contact")


def _panels(spec: dict[str, Any]) -> dict[str, list[dict[str, Any]]]:
    found: dict[str, list[dict[str, Any]]] = {}
    for trace in spec["data"]:
        found.setdefault(trace["yaxis"].replace("y", "yaxis"), []).append(trace)
    return found


def _reach(traces: list[dict[str, Any]], since: float) -> float:
    """Largest magnitude drawn from a time on."""
    largest = 0.0
    for trace in traces:
        x, y = (np.array(trace[key], dtype=float) for key in "xy")
        largest = max(largest, float(np.nanmax(np.abs(y[x >= since]))))
    return largest


@pytest.mark.parametrize("many", [False, True])
def test_axes_of_errors_fit_the_settled_half(report: ValidationDocument, many: bool) -> None:
    spec = errors_spec(report, PLAIN, None if many else ["v1", "v2"])
    panels = list(_panels(spec).items())
    # panels of one scale: alone, or all in m and all in rad
    groups = [[k] for k in range(len(panels))]
    if many:
        groups = [[k for k in range(len(panels)) if (k % 3 == 2) == rad] for rad in (False, True)]
    for group in groups:
        traces = [trace for k in group for trace in panels[k][1]]
        late = _reach(traces, 50.0)
        (ends,) = {tuple(spec["layout"][panels[k][0]]["range"]) for k in group}
        assert late < ends[1] == -ends[0] < 1.3 * late
        assert _reach(traces, 0.0) > 1.5 * ends[1]
    note = note_of({"layout": spec["layout"]})
    assert "axes fit the run from 50 s, clipped starts reach " in note
    assert " m and " in note


@pytest.mark.parametrize("vehicles", [["v1", "v2"], None])
def test_a_start_as_good_as_the_rest_is_not_clipped(vehicles: list[str] | None) -> None:
    near = example("paper-grid-same").model_dump(mode="json", exclude_none=True)
    near["initial_sigma"] = {"position_m": 0.3, "heading_rad": 0.01}
    run = validate(small(**near), trials=4, seed=1, duration=60.0, with_series=True)
    spec = errors_spec(validation_document(run), PLAIN, vehicles)
    ranges = [axis.get("range") for key, axis in spec["layout"].items() if key.startswith("yaxis")]
    if vehicles is None:
        panels = _panels(spec)
        for k, name in enumerate(panels):
            assert spec["layout"][name]["range"][1] > _reach(panels[name], 0.0) or k % 3 == 2
    else:
        assert None in ranges
        assert any(ranges) or "clipped" not in note_of(spec)


def test_panels_of_few_vehicles_stand_in_a_column(report: ValidationDocument) -> None:
    few = ["v1", "v4"]
    wide = errors_spec(report, PLAIN, few)["layout"]
    column = errors_spec(report, FigureStyle(width=400), few)["layout"]
    for layout, lefts in ((wide, {0.0, 0.35, 0.7}), (column, {0.0})):
        panels = [
            (tuple(layout[f"xaxis{k}"]["domain"]), tuple(layout[f"yaxis{k}"]["domain"]))
            for k in ("", *range(2, 3 * len(few) + 1))
        ]
        assert {x[0] for x, _ in panels} == lefts
        assert len(set(panels)) == len(panels)


@pytest.mark.parametrize("width", [1200, 400])
def test_many_vehicles_are_readable_multiples(report: ValidationDocument, width: int) -> None:
    style = FigureStyle(width=width)
    spec = fitted(errors_spec(report, style), style)
    layout, count = spec["layout"], len(report.vehicles)
    inner = layout["height"] - layout["margin"]["t"] - layout["margin"]["b"]
    for k in range(3 * count):
        x, y = (layout[f"{key}axis{k + 1 if k else ''}"] for key in "xy")
        (left, right), (low, high) = x["domain"], y["domain"]
        assert (right - left) * style.plot_px > 90
        # three labels of an axis, and as much again between them
        assert (high - low) * inner > 4 * y["tickfont"]["size"]
        assert y["tickfont"]["size"] >= 11
        assert y["showticklabels"] == (k % 3 != 1)
        assert x["showticklabels"] == (k >= 3 * count - 3)
    assert layout["height"] < 1000
    names = [note["text"] for note in layout["annotations"]]
    assert names == ["x in m", "y in m", "heading in rad", *(one.name for one in report.vehicles)]


def test_bars_too_thin_for_their_patterns_become_marks() -> None:
    shape = {"shape": "line", "count": 60, "spacing_m": 70.0}
    team = plan(small(formation=shape, landmarks_m=[[0.0, 60.0]]), bound="never")
    run = validate(team, trials=2, seed=1, duration=2.0)
    few = validate(small(), trials=2, seed=1, duration=2.0)
    for subject, bars in ((run, False), (few, True)):
        spec = spec_of(subject, "accuracy", style=FigureStyle(width=400))
        assert any(trace["type"] == "bar" for trace in spec["data"]) == bars
    marks = spec_of(run, "accuracy", style=FigureStyle(width=400))["data"]
    assert len({trace["marker"]["symbol"] for trace in marks}) == len(marks)
