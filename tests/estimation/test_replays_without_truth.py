"""Replays of recordings without truth: estimates and innovations in place of errors."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncplan import figures
from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.estimation.recorded_readings import clock_of, true_poses
from syncplan.estimation.replay_results import Replay
from syncplan.estimation.replay_tuning import FIT_SHARE, MOST_RUNS
from syncplan.estimation.replays import OPTIONS, replay, replay_with
from syncplan.estimation.trials import series
from syncplan.orbits.circles import wrap
from syncplan.orbits.noise import Noise
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.figures import specs_of
from syncplan.plotting.series_figures import MOST_ROBOTS
from syncplan.recordings.log import Log, RobotLog
from syncplan.recordings.recording_formats import load_log
from syncplan.reports.replay_report import ReplayDocument, replay_document
from tests.tools.recorded_bags import write_bag
from tests.tools.recordings import Recipe, refusal_of, with_robots, write_csv, write_recording

ODD = Recipe(jitter=0.8, speed_sigma=0.1, turn_rate_sigma=0.02, bearing_sigma=0.02, wild=0.01)

KEPT: dict[str, Any] = {"with_series": True, "landmarks": [6, 7]}

REFUSAL = "needs the truth, which odd does not hold; give the start: 'given' with start_poses"


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """A recording whose truth and odometry last equally long."""
    folder = write_recording(tmp_path_factory.mktemp("odd") / "odd", ODD, seed=2)
    log = load_log(folder)
    begin, end = clock_of(log, 0.05).begin, clock_of(log, 0.05).begin + 39.0

    def cut(robot: RobotLog) -> RobotLog:
        read, true = robot.odometry, robot.truth
        within = read[(read[:, 0] > begin) & (read[:, 0] < end)]
        held = read[np.searchsorted(read[:, 0], begin, side="right") - 1, 1:]
        ends = [[begin, *held]], [[end, *within[-1, 1:]]]
        odometry = np.concatenate([ends[0], within, ends[1]])
        return replace(robot, odometry=odometry, truth=true[true[:, 0] < end + 0.005])

    return with_robots(log, cut)


@pytest.fixture(scope="module")
def start(known: Log) -> Array:
    """A little off the truth, as who sets robots down knows it."""
    truth = true_poses(known, clock_of(known, 0.05))[0]
    return np.asarray(np.add(truth, [0.3, -0.4, 0.05]))


@pytest.fixture(scope="module")
def found(known: Log, start: Array) -> Replay:
    return replay(without(known), start="given", start_poses=start, **KEPT)


def without(log: Log) -> Log:
    return with_robots(log, lambda robot: replace(robot, truth=np.zeros((0, 4))))


def text_of(poses: Array) -> str:
    return ";".join(",".join(repr(float(value)) for value in pose) for pose in poses)


# --- what is found --------------------------------------------------------------------------------


def test_estimates_and_innovations_are_those_of_the_same_with_truth(
    known: Log, start: Array, found: Replay
) -> None:
    wanted = replay(known, start="given", start_poses=start, **KEPT)
    assert wanted.from_truth is not None
    assert found.clock == wanted.clock
    np.testing.assert_allclose(found.estimates[..., :2], wanted.estimates[..., :2], atol=1e-9)
    turned = wrap(found.estimates[..., 2] - wanted.estimates[..., 2])
    np.testing.assert_allclose(turned, 0.0, atol=1e-9)
    truth = true_poses(known, found.clock)
    off = np.hypot(*np.moveaxis(found.estimates - truth, -1, 0)[:2])
    np.testing.assert_allclose(off, series(wanted.result).position_rms, atol=1e-9)
    for name in ("position_sigma", "heading_sigma", "axis_sigma"):
        one, other = (getattr(series(run.result), name) for run in (found, wanted))
        np.testing.assert_array_equal(one, other)
    assert found.nis == wanted.nis
    assert found.counts == wanted.counts
    assert found.lasting_errors == wanted.lasting_errors


def test_windows_are_judged_along_estimates(known: Log, start: Array) -> None:
    given: dict[str, Any] = {"start": "given", "start_poses": start, "window": 8.0}
    wanted = replay(known, **given).seen
    seen = replay(without(known), **given).seen
    assert seen is not None
    assert wanted is not None
    assert (seen.judged, seen.window, seen.step) == (wanted.judged, wanted.window, wanted.step)
    assert seen.observable == wanted.observable > 0.0
    np.testing.assert_allclose(seen.position_sigmas, wanted.position_sigmas, rtol=0.1)


def test_the_run_lasts_while_all_robots_have_odometry(known: Log, start: Array) -> None:
    first, second, third = without(known).robots
    begin, end = first.odometry[0, 0], first.odometry[-1, 0]
    second = replace(second, odometry=second.odometry[second.odometry[:, 0] > begin + 6.0])
    third = replace(third, odometry=third.odometry[third.odometry[:, 0] < end - 4.0])
    short = replace(known, robots=(first, second, third))
    replayed = replay(short, start="given", start_poses=start)
    assert replayed.begin == second.odometry[0, 0]
    assert replayed.duration == pytest.approx(third.odometry[-1, 0] - replayed.begin, abs=0.06)
    notes = replay_document(replayed).notes
    assert any("the odometry of robot2 begins 6.0 s late: that part" in note for note in notes)
    assert any("the odometry of robot3 ends 4.0 s early: that part" in note for note in notes)
    apart = replace(third, odometry=third.odometry - [100.0, 0.0, 0.0])
    with pytest.raises(InputError, match="odd: all robots have odometry together for 0 s; at"):
        replay(replace(short, robots=(first, second, apart)), start="given", start_poses=start)


def test_fitted_sigmas_begin_the_rest_where_the_filter_was(known: Log) -> None:
    log = without(known)
    start = true_poses(known, clock_of(known, 0.05))[0]
    # where robots turn evenly, nothing but a start well known shows a delay
    noise = Noise(0.1, 0.22, 0.01, 0.01)
    given: dict[str, Any] = {"start": "given", "start_poses": start, "noise": noise}
    replayed = replay(log, tune=True, with_series=True, **given)
    tuning = replayed.tuning
    assert tuning is not None
    assert tuning.runs <= MOST_RUNS
    assert tuning.after.bearing_sigma == pytest.approx(0.02, rel=0.3)
    assert tuning.verdict.gain > 0.0
    assert replayed.duration == pytest.approx(26.0, abs=0.1)
    assert tuning.after.delay == pytest.approx(0.0, abs=0.03)
    noise = replace(replayed.noise, position_sigma=0.01, heading_sigma=0.01)
    first = replace(tuning.after, portion=(0.0, FIT_SHARE), start_poses=start, noise=noise)
    fitted = replay_with(log, first, replace(OPTIONS, with_series=True))
    end = series(fitted.result)
    begun = np.array(replayed.settings.start_poses)
    np.testing.assert_allclose(begun, fitted.estimates[-1], atol=1e-9)
    assert replayed.noise.position_sigma == pytest.approx(end.axis_sigma[-1].max())
    assert replayed.noise.heading_sigma == pytest.approx(end.heading_sigma[-1].max())
    assert replayed.begin == pytest.approx(fitted.begin + fitted.duration)
    truth = true_poses(known, replayed.clock)
    # a filter that began where the first third did would be lost
    assert np.hypot(*(start - truth[0])[:, :2].T).min() > 5.0
    assert np.hypot(*(replayed.estimates[-1] - truth[-1])[:, :2].T).max() < 0.5
    document = replay_document(replayed)
    assert tuning.accepted
    assert document.filter.bearing_sigma_rad == tuning.after.bearing_sigma
    assert document.filter.position_sigma_m == replayed.noise.position_sigma
    fitted_to = "fitted to the first 13.0 s, without truth; figures are of the rest"
    assert any(fitted_to in note for note in document.notes)
    assert "the rest starts where the filter was at the end" in "; ".join(document.notes)


# --- what is refused ------------------------------------------------------------------------------


def test_starts_about_the_truth_are_refused(known: Log, tmp_path: Path, refused: Any) -> None:
    folder = write_csv(without(known), tmp_path / "odd")
    assert not (folder / "truth.csv").exists()
    for kind in ("truth", "prior"):
        for tune in (False, True):
            with pytest.raises(InputError) as refusal:
                replay(without(known), start=kind, tune=tune)
            assert str(refusal.value).startswith(f"start: {kind!r} {REFUSAL}")
        for words in ([], ["--tune"]):
            err = refused("replay", str(folder), "--start", kind, *words)
            assert f"--start: {kind!r} {REFUSAL} (--start given --start-poses ...)" in err
    assert "--start: 'truth' needs the truth" in refused("replay", str(folder))


def test_figures_of_errors_are_not_to_be_had(found: Replay) -> None:
    for name in ("accuracy", "coverage", "anees"):
        with pytest.raises(InputError, match="odd: holds no truth, so errors are not known"):
            getattr(found, name)


def test_truth_is_of_all_robots_or_of_none(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "recording", ODD, seed=2)
    assert load_log(folder).has_truth
    (folder / "Robot2_Groundtruth.dat").unlink()
    problem = "Robot2_Groundtruth.dat: is missing, but others have truth; add it, or remove"
    assert problem in refusal_of(folder)
    for k in (1, 3):
        (folder / f"Robot{k}_Groundtruth.dat").unlink()
    log = load_log(folder)
    assert not log.has_truth
    assert [robot.truth.shape for robot in log.robots] == [(0, 4)] * 3


# --- the report -----------------------------------------------------------------------------------


def test_every_layout_is_replayed(
    known: Log, start: Array, found: Replay, tmp_path: Path, run: Any, printed: Any
) -> None:
    csv = write_csv(without(known), tmp_path / "odd")
    bag = write_bag(without(known), tmp_path / "bag" / "odd")
    listed = tmp_path / "start.txt"
    listed.write_text("# x y heading\n" + text_of(start).replace(";", "\n"))
    words = ("--start", "given", "--landmarks", "6,7", "--series", "--start-poses")
    wanted = json.loads(json.dumps(replay_document(found).as_json()))
    status, out, err = run("replay", str(csv), *words, str(listed))
    assert status == 0
    shown = json.loads(out)
    assert shown == {**wanted, "landmarks": ["6", "7"]}
    assert "the recording has no truth: errors, ANEES and coverage are not known" in err
    of_bag = json.loads(printed("replay", str(bag), *words, text_of(start)))
    assert of_bag["nis"]["value"] == pytest.approx(wanted["nis"]["value"], rel=1e-6)
    assert of_bag["readings"] == wanted["readings"]


def test_what_takes_truth_is_null_and_sigmas_take_its_place(known: Log, found: Replay) -> None:
    document = replay_document(found)
    values = document.as_json()
    nothing = ("position_rmse_m", "heading_rmse_rad", "coverage_3sigma", "anees")
    assert [values[key] for key in nothing] == [None] * 4
    assert "series" not in values
    assert values["notes"][0].startswith("the recording has no truth: errors, ANEES and coverage")
    kept = values["estimates"]
    assert len(kept["time_s"]) == found.clock.samples + 1
    for k, robot in enumerate(values["robots"]):
        names = [key for key in robot if key.startswith(("rms_", "final_e", "coverage"))]
        assert {key: robot[key] for key in names if robot[key] is not None} == {
            "rms_sigma_m": robot["rms_sigma_m"]
        }
        path = kept["robots"][k]
        assert robot["name"] == path["name"] == f"robot{k + 1}"
        for key in ("x_m", "y_m", "heading_rad", "sigma_m", "sigma_heading_rad"):
            assert robot[f"final_{key}"] == path[key][-1]
            assert len(path[key]) == len(kept["time_s"])
        assert robot["rms_sigma_m"] == pytest.approx(
            np.sqrt(np.mean(np.array(path["sigma_m"][1:]) ** 2))
        )
        assert path["sigma_x_m"][0] == path["sigma_y_m"][0] == 1.0
        assert path["x_m"] == found.estimates[:, k, 0].tolist()
    read_back = ReplayDocument.model_validate(json.loads(json.dumps(values)))
    assert read_back.as_json() == values
    assert not read_back.has_errors
    briefly = replay_document(replace(found, options=replace(found.options, with_series=False)))
    assert "estimates" not in briefly.as_json()
    frame = found.to_dataframe()
    assert {"final_x_m", "rms_sigma_m"} <= set(frame.columns)
    assert "rms_m" not in frame.columns
    assert repr(found) == "<Replay: 3 robots over 39 s, no truth>"


def test_paths_are_places_at_moments_of_the_run(known: Log, found: Replay) -> None:
    replayed = replay(known, with_series=True)
    unknown = np.arange(replayed.clock.samples + 1) < 100
    gapped = replace(replayed, known=replayed.known & ~unknown)
    for case, hidden in ((gapped, unknown), (found, np.ones_like(unknown))):
        paths = replay_document(case).paths
        assert paths is not None
        moments = np.searchsorted(case.clock.times, np.array(paths.track_time_s) - 1e-6)
        assert len(moments) == min(case.clock.samples, 1000) + 1 == len(set(moments.tolist()))
        truth = true_poses(known, case.clock)[moments]
        truth[hidden[moments]] = np.nan
        for k, path in enumerate(paths.vehicles):
            assert path.name == known.robots[k].name
            for i, axis in enumerate("xy"):
                kept = [getattr(path, f"{kind}_{axis}_m") for kind in ("true", "estimated")]
                wanted = [truth[:, k, i], case.estimates[moments, k, i]]
                np.testing.assert_allclose(np.array(kept, dtype=float), wanted, atol=5.1e-4)
        assert [mark.name for mark in paths.landmarks] == [str(name) for name in case.landmarks]
        places = known.landmarks[known.landmark_places(case.landmarks)]
        np.testing.assert_allclose([mark.position_m for mark in paths.landmarks], places)


def test_with_truth_a_report_is_as_before(known: Log) -> None:
    replayed = replay(known, with_series=True)
    values = replay_document(replayed).as_json()
    assert list(values)[-3:] == ["series", "paths", "notes"]
    errors = ("rms_m", "rms_second_half_m", "rms_x_m", "rms_y_m", "rms_heading_rad")
    expected = [*errors, "final_error_m", "coverage_3sigma", "name"]
    assert [list(robot) for robot in values["robots"]] == [expected] * 3
    # the report of an earlier version
    assert ReplayDocument.model_validate(values).as_json() == values
    assert set(replayed.to_dataframe().columns) == set(expected)


def test_at_a_terminal_estimates_take_the_place_of_errors(
    known: Log, start: Array, tmp_path: Path, printed: Any
) -> None:
    folder = write_csv(without(known), tmp_path / "odd")
    words = ("--start", "given", "--start-poses", text_of(start), "--format", "table")
    out = printed("replay", str(folder), *words)
    assert "odd: a recording of 39 s; no truth, so errors are not known" in out
    assert "estimate at the end in m, and the filter's own sigmas" in out
    alone = replay(load_log(folder), start="given", start_poses=start)
    shown = next(line.split() for line in out.splitlines() if line.startswith(" robot3"))
    last = alone.estimates[-1, 2]
    sigma = series(alone.result).position_sigma[-1, 2]
    assert shown[1:5] == [f"{value:.3f}" for value in (*last, sigma)]
    assert "RMS error" not in out
    assert "ANEES 0" not in out.replace("\n", " ")
    assert "\nNIS " in out
    assert "lasting errors at the end" in out
    assert "observable over the last" in out


# --- figures --------------------------------------------------------------------------------------


def test_a_report_without_truth_is_drawn(
    found: Replay, tmp_path: Path, run: Any, refused: Any
) -> None:
    assert list(figures.figures_of(found)) == ["sigmas", "estimates", "consistency"]
    document = replay_document(found)
    bars = {one["uid"]: one["y"] for one in specs_of(document, ["sigmas"])["sigmas"]["data"]}
    for uid, key in (("late", "final_sigma_m"), ("whole", "rms_sigma_m")):
        expected = [getattr(robot, key) for robot in document.robots]
        np.testing.assert_allclose(bars[uid], expected, atol=1e-5)
    kept = document.estimates
    assert kept is not None
    drawn = {one["uid"]: one for one in specs_of(document)["estimates"]["data"]}
    assert len(drawn) == 3 * 5
    line, band = (np.array(drawn[f"{key}-robot2-1"]["y"]) for key in ("line", "band"))
    every = -(-len(kept.time_s) // 400)
    np.testing.assert_allclose(line, np.array(kept.robots[1].y_m)[::every], atol=1e-5)
    sigma = np.array(kept.robots[1].sigma_y_m)[::every]
    np.testing.assert_allclose(band[: len(line)] - line, 3.0 * sigma, atol=2e-5)
    np.testing.assert_allclose(line - band[len(line) :][::-1], 3.0 * sigma, atol=2e-5)
    np.testing.assert_allclose(
        drawn["line-robot1-2"]["y"], np.array(kept.robots[0].sigma_m)[::every], atol=1e-5
    )
    for width in (1000, 400):
        honest = specs_of(document, ["consistency"], style=FigureStyle(width=width))["consistency"]
        uids = {one["uid"] for one in honest["data"]}
        assert uids == {"NIS-tolerated", "NIS-band", "NIS-ideal", "NIS-value"}
        assert "yaxis3" not in honest["layout"]
    report, page = tmp_path / "report.json", tmp_path / "page.html"
    report.write_text(json.dumps(document.as_json()))
    assert run("plot", str(report), "-o", str(page))[0] == 0
    assert "odd: the filter" in page.read_text()
    for name, problem in (
        ("accuracy", "has no truth, so errors are"),
        ("errors", "--series keeps"),
    ):
        assert problem in refused("plot", str(report), "--figure", name, "-o", str(page))
    with pytest.raises(InputError, match="series: the recording has no truth, so errors are not"):
        figures.error_bands(found)


def test_of_many_robots_the_least_known_are_drawn(found: Replay) -> None:
    document = replay_document(found)
    assert document.estimates is not None
    (path, *_) = document.estimates.robots
    many = [
        path.model_copy(update={"name": f"r{k}", "sigma_m": [0.1 * k] * len(path.sigma_m)})
        for k in range(MOST_ROBOTS + 2)
    ]
    estimates = document.estimates.model_copy(update={"robots": many})
    spec = specs_of(document.model_copy(update={"estimates": estimates}), ["estimates"])
    uids = {one["uid"] for one in spec["estimates"]["data"] if one["uid"].startswith("line")}
    assert uids == {f"line-r{k}-{column}" for k in range(2, 10) for column in range(3)}
    note = spec["estimates"]["layout"]["title"]["subtitle"]["text"]
    assert "the 8 of 10 robots that the filter knows least" in note
