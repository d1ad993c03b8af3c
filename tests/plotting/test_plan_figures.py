"""Figures of plans: what is drawn is what the plan says, checked from the values drawn."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plotly.graph_objects import Figure

from syncplan import figures
from syncplan.errors import InputError
from syncplan.orbits.circles import heading, position, unit
from syncplan.planning.plan_files import Loaded, plan_of
from syncplan.planning.plan_records import RefinementRecord
from syncplan.planning.plans import Plan
from syncplan.plotting.contact_figures import union_growth, within_period
from syncplan.plotting.figure_style import DARK, FigureStyle
from syncplan.plotting.figure_table import FIGURES
from syncplan.plotting.figures import specs_of
from syncplan.plotting.formation_figures import FRAMES, live, verdict_words
from syncplan.scenario.objectives import OBJECTIVES, Figures
from tests.tools.figure_parts import lines_of, note_of, spec_of, trace_of, turns_of
from tests.tools.measurement_graphs import union_over
from tests.tools.on_paper import plan
from tests.tools.scenarios import circling, example, small

KINDS = {"link", "incidental", "landmark"}
NAMES = ("paper-grid-alternate", "paper-grid-same", "mixed-radii-camera", "landmark-bridge")


@pytest.fixture(scope="module", params=NAMES)
def made(request: pytest.FixtureRequest) -> Plan:
    return plan(example(request.param))


def _formation(made: Plan) -> dict[str, Any]:
    return spec_of(made, "formation")


def test_circles_drawn_and_their_heads_are_those_of_the_plan(made: Plan) -> None:
    spec = _formation(made)
    for key, sense in (("ccw", 1.0), ("cw", -1.0)):
        chosen = np.flatnonzero(made.orbits.senses == sense)
        if not len(chosen):
            assert all(trace["uid"] != f"circles-{key}" for trace in spec["data"])
            continue
        lines = lines_of(trace_of(spec, f"circles-{key}"))
        assert len(lines) == len(chosen)
        turns = turns_of(trace_of(spec, f"heads-{key}"), made.orbits.centers[chosen])
        assert (turns == sense).all()
        for k, line in zip(chosen, lines, strict=True):
            away = np.hypot(*(line - made.orbits.centers[k]).T)
            np.testing.assert_allclose(away, made.orbits.radii[k], atol=0.02)
            np.testing.assert_array_equal(line[0], line[-1])
            # the chord of two neighbouring points is that of a 72nd of a turn
            chord = np.hypot(*np.diff(line, axis=0).T)
            np.testing.assert_allclose(
                chord, 2.0 * made.orbits.radii[k] * math.sin(math.pi / 72.0), atol=0.02
            )


def test_vehicles_stand_where_they_start_and_point_where_they_fly(made: Plan) -> None:
    trace = trace_of(_formation(made), "vehicles")
    where = np.column_stack([trace["x"], trace["y"]])
    np.testing.assert_allclose(where, position(made.orbits, 0.0), atol=0.01)
    # Plotly turns markers clockwise from up, in degrees
    turned = np.radians(trace["marker"]["angle"])
    ahead = np.column_stack([np.sin(turned), np.cos(turned)])
    step = position(made.orbits, 1e-4) - position(made.orbits, 0.0)
    step /= np.hypot(*step.T)[:, None]
    np.testing.assert_allclose(ahead, step, atol=0.01)


def test_every_meeting_is_drawn_once_by_what_it_is_worth(made: Plan) -> None:
    spec = _formation(made)
    groups = [t for t in spec["data"] if t["uid"].startswith(("link-", "incidental-", "landmark-"))]
    reported = [text for trace in groups for text in trace["text"] if text]
    meetings = [*made.links, *made.incidental_links, *made.landmark_links]
    assert len(reported) == len(meetings)
    for trace in groups:
        shown = [text for text in trace["text"] if text]
        assert all(trace["name"] in text for text in shown)
        assert ("certified" in trace["name"]) == (trace["line"]["dash"] == "solid")
    certified = sum("certified" in text.split("<br>")[0] for text in reported)
    assert certified == sum(item.certified for item in meetings)


@pytest.mark.parametrize(
    "name", ["paper-grid-alternate", "crooked-line-alternate", "landmark-bridge", "paper-grid-same"]
)
def test_arrows_are_the_motions_that_no_sighting_can_detect(name: str) -> None:
    made = plan(example(name))
    spec = _formation(made)
    assert verdict_words(made) in note_of(spec)
    arrows = [trace for trace in spec["data"] if trace["uid"].startswith("motion")]
    assert len(arrows) == len(made.unobservable)
    assert bool(arrows) == (name != "paper-grid-same")
    start = position(made.orbits, 0.0)
    for number, motion in enumerate(made.unobservable):
        lines = lines_of(trace_of(spec, f"motion-{number}"))
        assert len(lines) == len(motion.vehicles)
        drawn = np.zeros((made.orbits.count, 2))
        longest = max(float(np.hypot(*(line[-1] - line[0]))) for line in lines)
        for k, line in zip(motion.vehicles, lines, strict=True):
            np.testing.assert_allclose(line[0], start[k], atol=0.02)
            drawn[k] = (line[-1] - line[0]) / longest
        np.testing.assert_allclose(drawn, motion.motion[:, :2], atol=2e-3)


def test_bars_are_the_directed_windows_cut_at_the_period(made: Plan) -> None:
    spec = spec_of(made, "timeline")
    labels = spec["layout"]["yaxis"]["ticktext"]
    drawn: dict[str, list[tuple[float, float]]] = {label: [] for label in labels}
    for trace in spec["data"]:
        if trace["type"] == "bar":
            for row, start, length in zip(trace["y"], trace["base"], trace["x"], strict=True):
                drawn[labels[round(row)]].append((start, start + length))
    names = made.scenario.vehicle_names + made.scenario.landmark_names
    windows = made.windows
    expected = {}
    for k in range(len(windows.observers)):
        of = windows.of(k)
        if len(of):
            label = f"{names[windows.observers[k]]} sees {names[windows.targets[k]]}"
            expected[label] = within_period(of, made.orbits.period)
    assert set(drawn) == set(expected)
    for label, bars in drawn.items():
        np.testing.assert_allclose(sorted(bars), sorted(expected[label]), atol=1e-5)
        assert all(0.0 <= start < end <= made.orbits.period + 1e-5 for start, end in bars)
    total = sum(end - start for bars in drawn.values() for start, end in bars)
    assert total == pytest.approx(float(np.sum(windows.ends - windows.starts)), abs=1e-4)


def test_a_window_that_passes_the_period_goes_on_from_zero() -> None:
    assert within_period(np.array([[8.0, 13.0], [2.0, 3.0]]), 10.0) == [
        (8.0, 10.0),
        (0.0, 3.0),
        (2.0, 3.0),
    ]
    assert within_period(np.array([[0.0, 10.0]]), 10.0) == [(0.0, 10.0)]


def test_the_union_is_that_of_all_sightings_begun_so_far(made: Plan) -> None:
    """Against networkx, on graphs sampled finely."""
    import networkx as nx

    times, groups, held = union_growth(made)
    count = made.orbits.count
    for length in np.linspace(0.01, 0.99, 23) * made.orbits.period:
        step = int(np.searchsorted(times, length, side="right")) - 1
        graph = union_over(made.windows, made.orbits.period, 0.0, float(length)).to_undirected()
        graph.add_nodes_from(range(count))
        between = graph.subgraph(range(count))
        parts = list(nx.connected_components(between))
        assert groups[step] == len(parts)
        anchored = 0
        for part in parts:
            seen = {b for a in part for b in graph[a] if b >= count}
            anchored += len(part) if len(seen) > 1 else 0
        assert held[step] == anchored


def test_the_spectrum_parts_what_counts_from_what_does_not(made: Plan) -> None:
    spec = spec_of(made, "spectrum")
    verdict = made.observability
    counted = trace_of(spec, "values-circle")
    assert len(counted["x"]) == verdict.rank
    np.testing.assert_allclose(counted["y"], verdict.singular_values[: verdict.rank])
    tolerance = trace_of(spec, "tolerance")["y"][0]
    assert min(counted["y"]) > tolerance
    if not verdict.observable:
        rest = trace_of(spec, "values-x")
        assert len(rest["x"]) == verdict.state_dim - verdict.rank
        assert max(rest["y"]) < tolerance


def test_predicted_errors_are_those_of_the_plan(made: Plan) -> None:
    spec = spec_of(made, "prediction")
    assert made.prediction.rms is not None
    np.testing.assert_allclose(trace_of(spec, "predicted")["y"], made.prediction.rms, atol=1e-6)
    if not np.isnan(made.prediction.window).all():
        window = np.array(trace_of(spec, "window")["y"], dtype=float)
        np.testing.assert_allclose(window, made.prediction.window, atol=1e-6)


def test_each_frame_has_the_poses_and_sightings_of_its_moment(made: Plan) -> None:
    spec = spec_of(made, "animation")
    assert len(spec["frames"]) == FRAMES[1]
    names = [trace["uid"] for trace in spec["data"]]
    for k, frame in enumerate(spec["frames"]):
        time = k * made.orbits.period / FRAMES[1]
        parts = {names[n]: t for n, t in zip(frame["traces"], frame["data"], strict=True)}
        where = position(made.orbits, time)
        vehicles = parts["vehicles"]
        np.testing.assert_allclose(
            np.column_stack([vehicles["x"], vehicles["y"]]), where, atol=0.06
        )
        bodies = np.concatenate([where, made.landmarks])
        expected = 0
        for a in range(made.orbits.count):
            for b in range(len(bodies)):
                expected += a != b and _sees(made, a, bodies[b] - where[a], time)
        assert sum(x is not None for x in parts["directions"]["x"]) == expected
        observers, targets = live(made.windows, made.orbits.period, time)
        lines = {uid: t["x"] for uid, t in parts.items() if uid.startswith("sight-")}
        ends = {uid: [x for x in line if x is not None] for uid, line in lines.items()}
        anchored = sum(len(x) for uid, x in ends.items() if uid.startswith("sight-landmark-"))
        assert anchored == 2 * np.sum(targets >= made.orbits.count)
        pairs = {frozenset(pair) for pair in zip(observers, targets, strict=True)}
        assert sum(map(len, ends.values())) == 2 * len(pairs)


def test_a_sighting_looks_in_the_animation_as_its_link_does_in_the_formation(made: Plan) -> None:
    specs = specs_of(made, ["formation", "animation"])
    links = {t["uid"]: t for t in specs["formation"]["data"] if t["uid"].split("-")[0] in KINDS}
    moving = {t["uid"]: t for t in specs["animation"]["data"] if t["uid"].startswith("sight-")}
    assert {f"sight-{uid}" for uid in links if uid != "dropped"} == set(moving)
    motions = [t for t in specs["formation"]["data"] if t["uid"].startswith("motion")]
    lost = {trace["line"]["color"] for trace in motions}
    for uid, trace in moving.items():
        assert trace["line"] == links[uid.removeprefix("sight-")]["line"]
        assert trace["name"].endswith(links[uid.removeprefix("sight-")]["name"])
        assert trace["line"]["color"] not in lost
        # of a trace without any points, Plotly's legend drops the entry
        index = specs["animation"]["frames"][0]["traces"]
        place = index.index(next(k for k, t in enumerate(specs["animation"]["data"]) if t is trace))
        assert all(frame["data"][place]["x"] for frame in specs["animation"]["frames"])
    for frame in specs["animation"]["frames"]:
        assert all(trace["x"] for trace in frame["data"])


def _sees(made: Plan, observer: int, away: np.ndarray, time: float) -> bool:
    """Straight from the definition: within range and inside the field of view."""
    sensors = made.sensors
    if np.hypot(*away) > sensors.ranges[observer]:
        return False
    middle = float(heading(made.orbits, time)[observer] + sensors.boresights[observer])
    off = math.acos(float(np.clip(away @ unit(middle) / np.hypot(*away), -1.0, 1.0)))
    return off <= float(sensors.fields_of_view[observer]) / 2.0 + 1e-9


def test_a_refined_plan_is_shown_before_and_after() -> None:
    before, after = (
        plan(small(orbit=circling(direction="ccw", radius_m=radius)), bound="never")
        for radius in (20.0, 22.0)
    )
    merits = [Figures(6, True, k, 2 * k, 3 * k, dict.fromkeys(OBJECTIVES, 4 * k)) for k in (1.5, 1)]
    record = RefinementRecord(None, "logdet", True, "", False, merits[0], merits[1], (), ())
    after = replace(after, refinement=record)
    spec = spec_of(after, "refinement")
    for side, merit in zip(("before", "after"), merits, strict=True):
        errors, distances = trace_of(spec, side), trace_of(spec, f"{side}2")
        assert errors["y"][0] == pytest.approx(merit.predicted_rms, abs=1e-6)
        assert distances["y"][0] == pytest.approx(merit.least_distance, abs=1e-6)
        assert (errors["yaxis"], distances["yaxis"]) == ("y", "y2")
        assert {text.split("<br>")[0] for text in distances["x"]} == {
            "least distance of two",
            "contact margin",
        }
        assert not {*errors["x"]} & {*distances["x"]}
    titles = [spec["layout"][axis]["title"]["text"] for axis in ("yaxis", "yaxis2")]
    assert titles == ["error, m", "distance, m"]
    narrow = spec_of(after, "refinement", style=FigureStyle(width=400))
    titles = [narrow["layout"][axis]["title"]["text"] for axis in ("xaxis", "xaxis2")]
    assert titles == ["error, m", "distance, m"]
    both = figures.comparison(before, after)
    for side, one in (("before", before), ("after", after)):
        lines = lines_of(trace_of(both.to_plotly_json(), f"circles-{side}"))
        away = np.hypot(*(lines[0] - one.orbits.centers[0]).T)
        np.testing.assert_allclose(away, one.orbits.radii[0], atol=0.02)


def test_figures_that_plans_lack_are_refused_or_say_why(made: Plan) -> None:
    bare = plan(small(), bound="never")
    text = spec_of(bare, "prediction")["layout"]["annotations"][0]["text"]
    assert "not asked for" in text
    with pytest.raises(InputError, match="was not refined"):
        figures.refinement(bare)
    with pytest.raises(InputError, match="both must name the same"):
        figures.comparison(made, plan(small(formation={"centers_m": {"a": [0, 0], "b": [60, 0]}})))


def test_every_figure_is_one_that_plotly_accepts_and_the_same_each_time(made: Plan) -> None:
    specs = specs_of(made)
    assert list(specs) == ["formation", "animation", "timeline", "spectrum", "prediction"]
    assert set(specs) <= set(FIGURES)
    again = specs_of(plan_of(Loaded(made.scenario, made.orbits)))
    for name, spec in specs.items():
        text = json.dumps(spec, allow_nan=False, ensure_ascii=False)
        # the font of images has no other letters
        assert text.isascii()
        # Plotly changes what it is given
        built = Figure(json.loads(text))
        assert json.loads(built.to_json())["data"], name
        assert text == json.dumps(again[name], allow_nan=False)
        uids = [trace["uid"] for trace in spec["data"]]
        assert len(set(uids)) == len(uids)
    assert set(figures.figures_of(made)) == set(specs)


def test_a_dark_page_has_none_of_the_light_ones_colours(made: Plan) -> None:
    light = json.dumps(specs_of(made))
    dark = json.dumps(specs_of(made, style=FigureStyle(theme="dark")))
    for color, swapped in DARK.items():
        assert f'"{color}"' in light
        assert f'"{color}"' not in dark
        assert f'"{swapped}"' in dark
    # nothing else differs
    for color, swapped in DARK.items():
        light = light.replace(f'"{color}"', f'"{swapped}"')
    assert light == dark


def test_names_are_shown_as_they_are_and_never_as_markup() -> None:
    odd = "<b>a&b</b>"
    made = plan(small(formation={"centers_m": {odd: [0, 0], "b": [70, 0]}}))
    for name, spec in specs_of(made).items():
        text = json.dumps(spec)
        assert odd not in text, name
        if name != "spectrum":
            assert "&lt;b&gt;a&amp;b&lt;/b&gt;" in text, name


def test_vehicles_that_share_a_circle_share_a_label() -> None:
    made = plan(small(formation={"centers_m": [[0.0, 0.0], [0.0, 0.0], [70.0, 0.0]]}))
    names = trace_of(_formation(made), "names")
    assert names["text"] == ["v1, v2", "v3"]


@pytest.mark.parametrize(
    "changes",
    [
        {"formation": {"centers_m": [[0.0, 0.0]]}},
        {"formation": {"centers_m": [[0.0, 0.0], [900.0, 0.0]]}},
        {"formation": {"centers_m": [[0.0, 0.0], [0.0, 0.0]]}},
        {"formation": {"centers_m": [[0.0, 0.0]]}, "landmarks_m": [[0.0, 0.0], [1.0, 0.0]]},
    ],
    ids=["alone", "out of sight", "on one circle", "around a landmark"],
)
def test_teams_that_hardly_are_one_are_drawn_too(changes: dict[str, Any]) -> None:
    made = plan(small(**changes))
    for name, spec in specs_of(made).items():
        assert json.dumps(spec, allow_nan=False), name
        assert Figure(spec).to_json(), name
    drawn = [t for t in _formation(made)["data"] if t["uid"].startswith("motion")]
    assert len(drawn) == len(made.unobservable)
