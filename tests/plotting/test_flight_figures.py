"""Figures of flights: what is drawn is what the report holds."""

import json
from typing import Any

import numpy as np
import pytest
from plotly.graph_objects import Figure

from syncplan import figures
from syncplan.errors import InputError
from syncplan.planning.validation import Validation
from syncplan.plotting.figure_style import PLAIN, FigureStyle
from syncplan.plotting.figures import names_of, specs_of
from syncplan.plotting.flight_figures import MOST_VEHICLES, flight_errors_spec
from syncplan.plotting.flight_tracks_figure import SIGMAS, flight_tracks_spec
from syncplan.reports.flight_report import FlightDocument, flight_document
from syncplan.reports.flight_series import FlightOverTime
from syncplan.reports.validation_report import ValidationDocument
from tests.tools.figure_parts import lines_of, note_of, spec_of, trace_of
from tests.tools.flown import LOST_AT, short_flight

RUN_NAMES = ["accuracy", "errors", "consistency"]
NAMES = ["tracks", "tracking", "phases", "separation", "meetings", "events"]


@pytest.fixture(scope="module")
def flown() -> FlightDocument:
    return flight_document(short_flight())


@pytest.fixture(scope="module")
def series(flown: FlightDocument) -> FlightOverTime:
    assert flown.series is not None
    return flown.series


def test_a_run_and_its_report_give_the_same_figures(
    run_with_series: Validation, report: ValidationDocument, flown: FlightDocument
) -> None:
    subjects = ((run_with_series, report, RUN_NAMES), (short_flight(), flown, NAMES))
    for subject, document, names in subjects:
        read_back = type(document).model_validate(json.loads(json.dumps(document.as_json())))
        one, two, three = (json.dumps(specs_of(of)) for of in (subject, document, read_back))
        assert one == two == three
        drawn = figures.figures_of(document, theme="dark")
        assert list(drawn) == list(specs_of(document)) == names
        for name, figure in drawn.items():
            assert figure.to_json(), name
    assert names_of(flown)[0] == "tracks"


@pytest.mark.parametrize("width", [240, 400, 1200])
def test_legends_have_an_entry_once_and_texts_fit(flown: FlightDocument, width: int) -> None:
    for name, spec in specs_of(flown, style=FigureStyle(width=width)).items():
        shown = [t for t in spec["data"] if t.get("showlegend", True) and t.get("name")]
        assert len({trace["name"] for trace in shown}) == len(shown), name
        texts = [spec["layout"]["title"]["text"], spec["layout"]["title"]["subtitle"]["text"]]
        for text, size in zip(texts, (17.0, 13.0), strict=True):
            longest = max(map(len, text.split("<br>")))
            assert longest <= max(8, (width - 28) / (0.5 * size)), name
        for axis in ("xaxis", "yaxis"):
            title = spec["layout"][axis]["title"]["text"]
            assert 0.5 * 13.0 * len(title) <= width - 68, name


def test_without_series_figures_over_time_say_how_to_get_them(flown: FlightDocument) -> None:
    without = flown.model_copy(update={"series": None, "events": []})
    assert list(specs_of(without)) == ["separation", "meetings"]
    for name in ("tracks", "tracking", "phases"):
        with pytest.raises(InputError, match="--series"):
            specs_of(without, [name])
    with pytest.raises(InputError, match="--lose"):
        specs_of(without, ["events"])
    for draw in (flight_tracks_spec, flight_errors_spec):
        with pytest.raises(InputError, match="--series"):
            draw(without, PLAIN)


def test_the_last_turns_of_paths_stand_apart(flown: FlightDocument, series: FlightOverTime) -> None:
    spec = spec_of(flown, "tracks")
    period = series.ground.period_s
    times = np.array(series.track_time_s)
    for uid, x, y in (
        ("true", "true_x_m", "true_y_m"),
        ("estimated", "estimated_x_m", "estimated_y_m"),
    ):
        last, earlier = lines_of(trace_of(spec, uid)), lines_of(trace_of(spec, f"{uid}-earlier"))
        for k, vehicle in enumerate(series.tracks[0].vehicles):
            path = np.array([getattr(vehicle, x), getattr(vehicle, y)], dtype=float).T
            known = np.flatnonzero(np.isfinite(path[:, 0]))
            begin = int(np.searchsorted(times, times[known[-1]] - period))
            np.testing.assert_allclose(last[k], path[begin : known[-1] + 1], atol=0.02)
            # one that is lost within its first turn has no earlier one
            if begin:
                np.testing.assert_allclose(earlier.pop(0), path[: begin + 1], atol=0.02)
        assert not earlier
        assert trace_of(spec, f"{uid}-earlier")["opacity"] < 0.5
        assert "opacity" not in trace_of(spec, uid)
    others = [trace_of(spec, f"trial-{number}") for number in (1, 2)]
    assert {one["name"] for one in others} == {"true path, other trials, last turn"}


def test_one_turn_has_no_earlier_ones(flown: FlightDocument, series: FlightOverTime) -> None:
    ground = series.ground.model_copy(update={"period_s": 1000.0})
    slow = flown.model_copy(update={"series": series.model_copy(update={"ground": ground})})
    uids = {trace["uid"] for trace in spec_of(slow, "tracks")["data"]}
    assert {"true", "estimated", "ellipses"} <= uids
    assert not any(uid.endswith("-earlier") for uid in uids)


def test_rims_of_ellipses_are_three_sigma(flown: FlightDocument, series: FlightOverTime) -> None:
    spec = spec_of(flown, "tracks")
    rims = [lines_of(trace_of(spec, uid)) for uid in ("ellipses-earlier", "ellipses")]
    kept = short_flight().result.tracks[0].covariances
    solid = []
    for k, vehicle in enumerate(series.tracks[0].vehicles):
        known = [t for t, x in zip(series.track_time_s, vehicle.true_x_m, strict=True) if x]
        begin = known[-1] - series.ground.period_s
        for one, (xx, yy, xy) in zip(vehicle.ellipses, kept[:, k], strict=False):
            off = rims[one.time_s >= begin].pop(0) - one.center_m
            own = np.einsum("ki,ij,kj->k", off, np.linalg.inv([[xx, xy], [xy, yy]]), off)
            np.testing.assert_allclose(own, SIGMAS**2, rtol=0.05)
            solid.append(one.time_s >= begin)
    assert rims == [[], []]
    opacity = trace_of(spec, "moments")["marker"]["opacity"]
    assert [one == 1.0 for one in opacity] == solid
    assert set(solid) == {True, False}


def test_tracks_that_leave_the_map_are_noted(flown: FlightDocument, series: FlightOverTime) -> None:
    near = spec_of(flown, "tracks")
    assert "tracks leave the map" not in note_of(near)
    first = series.tracks[0]
    away = first.vehicles[0].model_copy(update={"true_x_m": [9000.0] * len(series.track_time_s)})
    track = first.model_copy(update={"vehicles": [away, *first.vehicles[1:]]})
    tracks = series.model_copy(update={"tracks": [track, *series.tracks[1:]]})
    astray = flown.model_copy(update={"series": tracks})
    far = spec_of(astray, "tracks")
    assert "tracks leave the map" in note_of(far)
    assert far["layout"]["xaxis"]["range"][1] < 2.0 * near["layout"]["xaxis"]["range"][1]


def test_losses_and_holds_have_their_place(flown: FlightDocument, series: FlightOverTime) -> None:
    spec = spec_of(flown, "tracks")
    for uid, name, time in (("loss", "v6", LOST_AT), ("hold", "v2", 12.0)):
        vehicle = next(one for one in series.tracks[0].vehicles if one.name == name)
        known = [k for k, x in enumerate(vehicle.true_x_m) if x is not None]
        before = max(k for k in known if series.track_time_s[k] <= time)
        assert trace_of(spec, uid)["x"] == pytest.approx([vehicle.true_x_m[before]], abs=1e-3)
        assert trace_of(spec, uid)["y"] == pytest.approx([vehicle.true_y_m[before]], abs=1e-3)


def test_curves_over_time_are_the_reports(flown: FlightDocument, series: FlightOverTime) -> None:
    errors, phases = (spec_of(flown, name) for name in ("tracking", "phases"))
    by_name = {one.name: one for one in flown.vehicles}
    for one in series.vehicles:
        for spec, key, values in (
            (errors, "sigma", one.sigma_m),
            (errors, "bound", one.bound_m),
            (errors, "tracking", one.tracking_rms_m),
            (errors, "error", one.rms_m),
            (phases, "phase", one.phase_rms_s),
        ):
            drawn = trace_of(spec, f"{key}-{one.name}")
            assert drawn["x"] == series.time_s
            expected, shown = (np.array(v, dtype=float) for v in (values, drawn["y"]))
            np.testing.assert_allclose(shown, expected, atol=1e-5)
        vehicle = by_name[one.name]
        level = trace_of(phases, f"tolerance-{one.name}")["y"]
        assert level == pytest.approx([vehicle.phase_tolerance_s] * 2, abs=1e-5)
        if vehicle.errors is not None and vehicle.phase_error_s is not None:
            level = trace_of(errors, f"predicted-{one.name}")["y"]
            assert level == pytest.approx([vehicle.errors.predicted_rms_m] * 2, abs=1e-5)
            level = trace_of(phases, f"worst-{one.name}")["y"]
            assert level == pytest.approx([vehicle.phase_error_s.worst] * 2, abs=1e-5)


def test_errors_in_flight_have_marks_that_stand_apart(flown: FlightDocument) -> None:
    spec = spec_of(flown, "tracking")
    marks = [trace_of(spec, f"marks-{key}-v1") for key in ("sigma", "error", "bound", "tracking")]
    times = [time for one in marks for time in one["x"]]
    assert len(set(times)) == len(times) == 16
    assert len({one["marker"]["symbol"] for one in marks}) == 4
    assert not [one for one in spec_of(flown, "phases")["data"] if "marks" in one["uid"]]


def test_axes_over_time_hold_all_and_mark_events(flown: FlightDocument) -> None:
    for name in ("tracking", "phases"):
        spec = spec_of(flown, name)
        every = [v for t in spec["data"] for v in t.get("y", []) if v is not None]
        for key, axis in spec["layout"].items():
            if key.startswith("yaxis"):
                low, high = 10.0 ** np.array(axis["range"])
                assert high > max(every)
                assert low < min(every) or low == pytest.approx(high * 10.0**-2.5, rel=1e-3)
                assert len(axis["tickvals"]) >= 2
                assert axis["ticktext"] == [f"{mark:g}" for mark in axis["tickvals"]]
        for axis in {trace["xaxis"] for trace in spec["data"] if "xaxis" in trace}:
            mine = [shape for shape in spec["layout"]["shapes"] if shape["xref"] == axis]
            assert {(shape["x0"], shape["x1"]) for shape in mine} == {
                (12.0, 18.0),
                (LOST_AT, LOST_AT),
            }
        assert "v6 is lost at 30 s" in note_of(spec)
        assert {"losses", "holds"} <= {trace["uid"] for trace in spec["data"]}


def test_vehicles_furthest_off_are_drawn(flown: FlightDocument, series: FlightOverTime) -> None:
    def thrice(of: Any) -> dict[str, Any]:
        named = [(one, f"{one.name}{letter}") for letter in "abc" for one in of.vehicles]
        return {"vehicles": [one.model_copy(update={"name": name}) for one, name in named]}

    team = series.model_copy(update=thrice(series))
    many = flown.model_copy(update={**thrice(flown), "series": team})
    spec = spec_of(many, "tracking")
    drawn = {t["uid"].removeprefix("error-") for t in spec["data"] if t["uid"].startswith("error-")}
    off = {one.name: one.errors.tracking_rms_m for one in many.vehicles if one.errors is not None}
    least = min(off[name] for name in drawn)
    assert len(drawn) == MOST_VEHICLES
    assert all(value <= least for name, value in off.items() if name not in drawn)
    assert f"the {MOST_VEHICLES} worst of 18 vehicles" in note_of(spec)


def test_least_separations_rise_to_all_trials(flown: FlightDocument) -> None:
    found = flown.least_separation_m
    assert found is not None
    spec = spec_of(flown, "separation")
    curve = trace_of(spec, "trials")
    assert (curve["y"][0], curve["y"][-1]) == (0.0, 100.0)
    np.testing.assert_allclose(curve["x"], found.quantiles, atol=1e-4)
    assert trace_of(spec, "planned")["x"] == pytest.approx([found.planned] * 2, abs=1e-4)
    assert trace_of(spec, "asked")["x"] == [22.0, 22.0]
    assert spec["layout"]["xaxis"]["range"][1] > found.planned
    alone = specs_of(flown.model_copy(update={"least_separation_m": None}), ["separation"])
    assert alone["separation"]["data"] == []


def test_meetings_that_were_missed_are_hatched_and_on_top(flown: FlightDocument) -> None:
    links = [
        one.model_copy(update={"kept_share": 0.5 if k == 2 else 1.0})
        for k, one in enumerate(flown.links)
    ]
    spec = spec_of(flown.model_copy(update={"links": links}), "meetings")
    missed, kept = trace_of(spec, "missed"), trace_of(spec, "kept")
    assert missed["y"] == ["-".join(links[2].between)]
    assert missed["x"] == [50.0]
    assert missed["marker"]["pattern"]["shape"]
    assert set(kept["x"]) == {100.0}
    assert spec["layout"]["yaxis"]["categoryarray"][0] == missed["y"][0]
    none = spec_of(flown.model_copy(update={"links": []}), "meetings")
    assert "no meeting" in none["layout"]["annotations"][0]["text"]


def test_rows_of_events_last_as_long_as_they_do(flown: FlightDocument) -> None:
    hold = flown.events[0].model_copy(update={"settled_s": 9.0})
    spec = spec_of(flown.model_copy(update={"events": [hold, flown.events[1]]}), "events")
    loss, held, settling = (trace_of(spec, uid) for uid in ("loss", "hold", "settling"))
    assert (loss["y"], loss["base"], loss["x"]) == (["v6"], [LOST_AT], [48.0 - LOST_AT])
    assert (held["y"], held["base"], held["x"]) == (["v2"], [12.0], [6.0])
    assert (settling["base"], settling["x"]) == ([18.0], [9.0])
    assert Figure(spec).to_json()
