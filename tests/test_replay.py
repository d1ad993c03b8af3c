"""Replays: recordings read, filtered as by the NumPy filter, reported; real robots' among them."""

import contextlib
import inspect
import json
import tarfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.main import get_command

from syncplan import cli, figures
from syncplan.arcs import Motion, predict, update
from syncplan.consistency import gate_threshold
from syncplan.errors import InputError
from syncplan.logs import NOBODY, Log, load_log
from syncplan.orbits import wrap
from syncplan.replay_report import replay_document
from syncplan.replays import GROUND_ROBOTS, replay
from tests.recordings import LANDMARKS, REAL, Recipe, write_recording

NOISY = Recipe(
    jitter=0.8,
    speed_sigma=0.4,
    turn_rate_sigma=0.05,
    bearing_sigma=0.08,
    wild=0.01,
    nobody=7,
)


@pytest.fixture(scope="module")
def noisy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("noisy") / "recording", NOISY, seed=4)


# --- the recording --------------------------------------------------------------------------------


def test_a_recording_holds_what_was_written(noisy: Path) -> None:
    log = load_log(noisy)
    assert log.name == "recording"
    assert [robot.name for robot in log.robots] == ["robot1", "robot2", "robot3"]
    assert dict(zip(log.landmark_subjects.tolist(), map(tuple, log.landmarks), strict=True)) == (
        LANDMARKS
    )
    first = log.robots[0]
    lines = (noisy / "Robot1_Measurement.dat").read_text().splitlines()[2:]
    assert len(lines) == len(first.times) == len(first.bearings)
    time, code, _, bearing = (float(word) for word in lines[5].split())
    subject = int(code) // 10 if code != 99 else NOBODY
    assert (first.times[5], first.subjects[5], first.bearings[5]) == (time, subject, bearing)
    assert sum(int(np.sum(robot.subjects == NOBODY)) for robot in log.robots) == 3 * 7


def test_a_robots_own_barcode_was_misread(noisy: Path, tmp_path: Path) -> None:
    folder = _copy(noisy, tmp_path)
    path = folder / "Robot2_Measurement.dat"
    lines = path.read_text().splitlines()
    words = lines[9].split()
    lines[9] = "\t".join([words[0], "23", *words[2:]])
    path.write_text("\n".join(lines))
    assert load_log(folder).robots[1].subjects[7] == NOBODY


BAD = [
    ("Robot1_Odometry.dat", 9, "1.0\t2.0", "line 9 has 2 columns; needed are time, speed, turn"),
    ("Robot1_Odometry.dat", 9, "1.0\t2.0\tfast", "line 9: turn rate is 'fast'; a number is needed"),
    ("Robot2_Groundtruth.dat", 8, "1\t2\tnan\t4", "line 8, '1 2 nan 4': holds a value that is not"),
    ("Robot2_Groundtruth.dat", 8, "1\t2\t3\t4", "line 8, '1 2 3 4': its time is before that"),
    ("Robot3_Measurement.dat", 3, "1e300\t13\t3\t4", "line 3, '1e300 13 3 4': holds a value over"),
    ("Robot3_Measurement.dat", 3, "1\t1.5\t3\t4", "line 3, '1 1.5 3 4': barcode is not whole"),
    ("Barcodes.dat", 3, "2\t13\n1\t13", "barcode 13 stands there twice"),
    ("Barcodes.dat", 3, "55\t13", "subject 55 is neither a robot with files nor a landmark"),
    ("Landmark_Groundtruth.dat", 3, "1\t13\t2", "subject 1 is a robot as well"),
    ("Landmark_Groundtruth.dat", 3, "6\t13\t2", "subject 6 stands there twice"),
]


@pytest.mark.parametrize(("name", "line", "text", "told"), BAD)
def test_a_fault_is_told_with_file_and_line(
    name: str, line: int, text: str, told: str, noisy: Path, tmp_path: Path, run: Any
) -> None:
    folder = _copy(noisy, tmp_path)
    lines = (folder / name).read_text().splitlines()
    lines[line - 1] = text
    (folder / name).write_text("\n".join(lines) + "\n")
    status, out, err = run("replay", str(folder))
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert f"{folder / name}: {told}" in err


def test_files_that_are_not_there_are_named(noisy: Path, tmp_path: Path, run: Any) -> None:
    def refused(folder: Path) -> str:
        status, out, err = run("replay", str(folder))
        assert (status, out, err.count("\n")) == (2, "", 1)
        return str(err)

    folder = _copy(noisy, tmp_path)
    assert "no such folder" in refused(folder / "nowhere")
    assert "is not a folder" in refused(folder / "Barcodes.dat")
    (folder / "Robot3_Groundtruth.dat").write_text("# nothing yet\n")
    assert "Robot3_Groundtruth.dat: holds no rows" in refused(folder)
    (folder / "Robot2_Measurement.dat").write_bytes(b"\xff\xfe1 2 3 4")
    assert "Robot2_Measurement.dat: is not a text file" in refused(folder)
    (folder / "Robot2_Measurement.dat").unlink()
    assert "Robot2_Measurement.dat: is missing" in refused(folder)
    (folder / "Robot2_Measurement.dat").mkdir()
    assert "Robot2_Measurement.dat: is a folder" in refused(folder)
    for k in range(1, 4):
        (folder / f"Robot{k}_Odometry.dat").unlink()
    assert "holds no Robot1_Odometry.dat" in refused(folder)


def test_a_robot_that_saw_nobody_is_no_fault(noisy: Path, tmp_path: Path) -> None:
    folder = _copy(noisy, tmp_path)
    (folder / "Robot2_Measurement.dat").write_text("# nothing\n")
    assert len(load_log(folder).robots[1].times) == 0


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_whatever_a_file_holds_is_read_or_refused(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = _small_recording(tmp_path_factory)
    path = folder / data.draw(st.sampled_from(sorted(path.name for path in folder.iterdir())))
    before = path.read_bytes()
    try:
        at = data.draw(st.integers(0, len(before)))
        new = data.draw(st.binary(max_size=12) | st.sampled_from([b"\n", b" ", b"#", b"1e400 "]))
        cut = data.draw(st.integers(0, 30))
        path.write_bytes(before[:at] + new + before[at + cut :])
        with contextlib.suppress(InputError):
            replay(load_log(folder))
    finally:
        path.write_bytes(before)


# --- the filter -----------------------------------------------------------------------------------


def test_without_noise_there_is_no_error(tmp_path: Path) -> None:
    log = load_log(write_recording(tmp_path / "exact", Recipe()))
    replayed = replay(log)
    # truth is known every 10 ms, and straight between
    assert replayed.accuracy.overall().position < 1e-3
    assert replayed.accuracy.overall().heading < 1e-4
    assert replayed.result.gated.sum() == replayed.unknown == 0
    assert (replayed.result.covered == replayed.result.coverage_samples).all()


@pytest.mark.parametrize(
    ("landmarks", "meetings"), [(None, True), ([6, 8], True), ([7], False), ([], True)]
)
def test_errors_are_those_of_the_numpy_filter(
    landmarks: list[int] | None, meetings: bool, tmp_path: Path
) -> None:
    brief = replace(NOISY, duration=12.0, wild=0.05)
    log = load_log(write_recording(tmp_path / "brief", brief, seed=8))
    replayed = replay(
        log,
        landmarks=landmarks,
        meetings=meetings,
        sample_time=0.07,
        bearing_sigma=0.1,
        gate_probability=0.99,
    )
    errors, used, rejected = _by_numpy(log, landmarks, meetings=meetings)
    assert len(errors) == replayed.result.steps == round(replayed.duration / 0.07)
    squares = np.mean(errors**2, axis=0)
    np.testing.assert_allclose(replayed.result.mean_squares[0], squares, rtol=1e-9)
    np.testing.assert_allclose(replayed.result.final_errors[0], errors[-1], rtol=1e-6, atol=1e-9)
    assert (int(replayed.result.accepted[0]), int(replayed.result.gated[0])) == (used, rejected)
    total = sum(len(robot.times) for robot in log.robots)
    assert replayed.left_out == total - used - rejected - 3 * 7
    assert rejected > 0


def _by_numpy(
    log: Log, landmarks: list[int] | None, *, meetings: bool
) -> tuple[np.ndarray, int, int]:
    """Errors (steps, n, 3), and how many bearings were used and rejected; all by plain loops."""
    time, motion = 0.07, Motion(0.07, GROUND_ROBOTS.speed_sigma, GROUND_ROBOTS.turn_rate_sigma)
    begin = max(robot.truth[0, 0] for robot in log.robots)
    end = min(robot.truth[-1, 0] for robot in log.robots) - begin
    truths = [robot.truth - [begin, 0.0, 0.0, 0.0] for robot in log.robots]
    odometry = [robot.odometry - [begin, 0.0, 0.0] for robot in log.robots]
    known = [s for s in log.landmark_subjects.tolist() if landmarks is None or s in landmarks]
    places = np.array([LANDMARKS[s] for s in known]).reshape(-1, 2)
    n, steps = len(log.robots), int(end / time)
    readings = []
    for observer, robot in enumerate(log.robots):
        for at, subject, bearing in zip(robot.times, robot.subjects, robot.bearings, strict=True):
            if subject in known:
                readings.append((at - begin, observer, n + known.index(subject), bearing))
            elif meetings and 1 <= subject <= n:
                readings.append((at - begin, observer, int(subject) - 1, bearing))
    readings.sort()
    x = _truth(truths, 0.0)
    P = np.diag(np.tile([1e-4, 1e-4, 1e-4], n))
    errors, used, rejected = [], 0, 0
    for step in range(1, steps + 1):
        span = ((step - 1) * time, step * time)
        speeds = np.array([_held_mean(one, 1, *span) for one in odometry])
        turns = np.array([_held_mean(one, 2, *span) for one in odometry])
        x, P = predict(x, P, speeds, turns, motion)
        for at, observer, target, bearing in readings:
            if round(at / time) == step:
                gate = gate_threshold(0.99)
                x, P, nu, variance = update(x, P, observer, target, bearing, 0.1, places, gate)
                used, rejected = (
                    (used + 1, rejected) if nu**2 <= gate * variance else (used, rejected + 1)
                )
        error = x - _truth(truths, span[1])
        error[:, 2] = wrap(error[:, 2])
        errors.append(error)
    return np.array(errors), used, rejected


def _truth(truths: list[np.ndarray], at: float) -> np.ndarray:
    poses = []
    for truth in truths:
        after = max(int(np.searchsorted(truth[:, 0], at)), 1)
        (t0, *a), (t1, *b) = truth[after - 1], truth[after]
        share = (at - t0) / (t1 - t0)
        turn = wrap(np.array(b[2] - a[2]))
        poses.append(
            [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * float(turn)]
        )
    return np.array(poses)


def _held_mean(odometry: np.ndarray, column: int, begin: float, end: float) -> float:
    """Mean over a time of what was last read, piece by piece."""
    total = 0.0
    for (since, *_), (until, *_), values in zip(odometry, odometry[1:], odometry, strict=False):
        total += max(0.0, min(until, end) - max(since, begin)) * values[column]
    return total / (end - begin)


def test_a_gap_of_the_truth_is_told(noisy: Path, tmp_path: Path) -> None:
    folder = _copy(noisy, tmp_path)
    path = folder / "Robot2_Groundtruth.dat"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:1000] + lines[1100:]))
    replayed = replay(load_log(folder))
    assert replayed.longest_gap == pytest.approx([0.01, 1.01, 0.01], abs=1e-6)
    notes = replay_document(replayed).notes
    assert [note for note in notes if "robot2" in note] == [
        "the truth of robot2 has a gap of 1.01 s: its errors there are from a straight line"
    ]


def test_sigmas_that_are_too_small_are_found_out(noisy: Path) -> None:
    honest = replay(load_log(noisy), bearing_sigma=0.1)
    sure = replay(load_log(noisy), bearing_sigma=0.004, gate_probability=1.0)
    assert sure.anees.verdict == "optimistic" != honest.anees.verdict
    assert sure.nis.value > 10.0 > honest.nis.value
    assert any("larger errors than its sigmas say" in note for note in replay_document(sure).notes)
    lost = replay(load_log(noisy), bearing_sigma=0.002, gate_probability=0.5)
    assert any(note.startswith("the gate rejected") for note in replay_document(lost).notes)


def test_what_can_not_be_run_is_refused(noisy: Path, tmp_path: Path) -> None:
    log = load_log(noisy)
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"landmarks": [9]}, "landmarks: no landmark 9; there are 8, 6, 7"),
        ({"bearing_sigma": 0.0}, "bearing_sigma: 0 rad given; it must be positive"),
        ({"sample_time": float("nan")}, "sample_time: nan s given; it must be positive"),
        ({"sample_time": 1e-7}, "sample_time: 39.9 s at a sample time of 1e-07 s makes more than"),
        ({"sample_time": 100.0}, "recording: the truth of all robots is known together for 39.9"),
        ({"gate_probability": 0.0}, "gate_probability: 0 given; allowed is more than 0, up to 1"),
    ]
    for given_, told in wrong:
        with pytest.raises(InputError) as refused:
            replay(log, **given_)
        assert str(refused.value).startswith(told)
    with pytest.raises(InputError, match="speed_sigma: -1 given"):
        replay(log, noise=type(GROUND_ROBOTS)(-1.0, 0.5, 0.01, 0.01))


# --- the report -----------------------------------------------------------------------------------


def test_the_command_says_what_the_library_finds(noisy: Path, tmp_path: Path, run: Any) -> None:
    report = tmp_path / "report.json"
    status, out, err = run(
        "replay", str(noisy), "--landmarks", "7,6", "--series", "-o", str(report)
    )
    assert (status, out) == (0, "")
    assert f"wrote {report}" in err
    found = json.loads(report.read_text())
    replayed = replay(load_log(noisy), landmarks=[6, 7], with_series=True)
    assert found == json.loads(json.dumps(replay_document(replayed).as_json()))
    assert found["landmarks"] == [6, 7]
    assert found["position_rmse_m"] == pytest.approx(
        np.sqrt(np.mean([robot["rms_m"] ** 2 for robot in found["robots"]]))
    )
    counts = found["readings"]
    assert counts["unknown"] == 21
    assert sum(counts.values()) == sum(len(robot.times) for robot in replayed.log.robots)
    errors = np.array(found["series"]["vehicles"][1]["rms_m"])
    assert np.sqrt(np.mean(errors[1:] ** 2)) == pytest.approx(found["robots"][1]["rms_m"])
    assert {"value", "band", "verdict"} <= set(found["anees"])


def test_at_a_terminal_there_is_a_table(noisy: Path, run: Any) -> None:
    status, out, _ = run(
        "replay", str(noisy), "--landmarks", "none", "--no-meetings", "--format", "table"
    )
    assert status == 0
    assert "recording: a recording of" in out
    assert "robot3" in out
    assert "0 used, 0 rejected by the gate, 21 of unknown barcodes" in " ".join(out.split())
    assert "this is odometry alone" in out


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--landmarks", "six"], "--landmarks: 'six': must be all, none or numbers"),
        (["--landmarks", "6,99"], "--landmarks: no landmark 99; there are 8, 6, 7"),
        (["--gate", "2"], "--gate: 2 given"),
        (["--sample-time-s", "0"], "--sample-time-s: 0 s given"),
    ],
)
def test_options_that_can_not_be_are_refused(
    options: list[str], told: str, noisy: Path, run: Any
) -> None:
    status, out, err = run("replay", str(noisy), *options)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert told in err


def test_a_recording_is_never_written_over(noisy: Path, run: Any) -> None:
    path = noisy / "Robot1_Odometry.dat"
    before = path.read_bytes()
    status, _, err = run("replay", str(noisy), "-o", str(path))
    assert status == 2
    assert "is the file that is read" in err
    assert path.read_bytes() == before


def test_the_options_defaults_are_the_librarys() -> None:
    command: Any = get_command(cli.app)
    options = {option.name: option.default for option in command.commands["replay"].params}
    defaults = inspect.signature(replay).parameters
    same = {
        "meetings": "meetings",
        "bearing_sigma_rad": "bearing_sigma",
        "sample_time_s": "sample_time",
        "gate": "gate_probability",
    }
    for option, argument in same.items():
        assert options[option] == defaults[argument].default
    assert options["speed_sigma_mps"] == GROUND_ROBOTS.speed_sigma
    assert options["turn_rate_sigma_rad_s"] == GROUND_ROBOTS.turn_rate_sigma


def test_a_report_is_drawn(noisy: Path, tmp_path: Path, run: Any) -> None:
    replayed = replay(load_log(noisy), with_series=True)
    assert list(figures.figures_of(replayed)) == ["accuracy", "errors", "consistency"]
    shown = figures.error_bands(replayed, ["robot2"])
    assert shown.layout.annotations[0].text == "robot2: x in m"
    assert "a recording of 39.9 s" in json.dumps(shown.to_plotly_json(), default=str)
    report, page = tmp_path / "report.json", tmp_path / "page.html"
    assert run("replay", str(noisy), "-o", str(report))[0] == 0
    assert run("plot", str(report), "-o", str(page))[0] == 0
    assert "recording: error found" in page.read_text()
    status, _, err = run("plot", str(report), "--figure", "errors", "-o", str(page))
    assert status == 2
    assert "--series keeps them" in err


# --- real robots ----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.skipif(
    not REAL.exists(), reason=f"needs the recording {REAL.name} beside the checkout"
)
def test_real_robots_are_found_as_well_as_by_others(tmp_path: Path) -> None:
    """RMSE of a plain filter of other make, with the same sigmas: the README of the recording."""
    with tarfile.open(REAL) as archive:
        archive.extractall(tmp_path, filter="data")
    log = load_log(next(tmp_path.rglob("Barcodes.dat")).parent)
    assert (len(log.robots), len(log.landmarks)) == (5, 15)
    cases: list[tuple[list[int] | None, bool, float]] = [
        ([], False, 2.75),
        ([], True, 0.73),
        ([7, 15], False, 0.64),
        ([7, 15], True, 0.20),
        (None, True, 0.139),
    ]
    for landmarks, meetings, expected in cases:
        replayed = replay(log, landmarks=landmarks, meetings=meetings)
        assert replayed.duration == pytest.approx(772.0, abs=0.5)
        assert replayed.accuracy.overall().position == pytest.approx(expected, rel=0.08)
        assert replayed.unknown == 6


def _copy(folder: Path, tmp_path: Path) -> Path:
    target = tmp_path / "recording"
    target.mkdir()
    for path in folder.iterdir():
        (target / path.name).write_bytes(path.read_bytes())
    return target


def _small_recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.getbasetemp() / "small"
    if not folder.exists():
        write_recording(folder, Recipe(duration=2.0, period=0.1, nobody=1))
    return folder
