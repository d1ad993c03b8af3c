"""Replays: recordings read, filtered as by the NumPy filter, reported; real robots' among them."""

import json
import os
import shutil
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import truncnorm
from typer.main import get_command

from syncplan import figures
from syncplan.arrays import Array
from syncplan.cli import command_line
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation import recorded_run
from syncplan.estimation.consistency import gate_threshold
from syncplan.estimation.filter_setup import FilterRun, MotionModel
from syncplan.estimation.lane_filter import LaneFilter, specimen
from syncplan.estimation.recorded_readings import longest_gap
from syncplan.estimation.replay_results import Replay
from syncplan.estimation.replay_settings import GROUND_ROBOTS, STARTS, ReplaySettings
from syncplan.estimation.replays import OPTIONS, replay
from syncplan.estimation.trials import series
from syncplan.orbits.circles import wrap
from syncplan.orbits.noise import Noise
from syncplan.recordings import mrclam, recorded_files
from syncplan.recordings.log import NOBODY, Log, RobotLog
from syncplan.recordings.recording_formats import load_log
from syncplan.reports.replay_report import replay_document
from tests.searches.recording import CASES
from tests.tools.processes import PATIENCE_S
from tests.tools.recordings import CLOCK, LANDMARKS, Recipe, refusal_of, write_recording
from tests.tools.reference_filter import predict_state, update_state

ALONE: dict[str, Any] = {
    "filter": "ekf",
    "distances": False,
    "speed_scale_sigma": 0.0,
    "turn_rate_bias_sigma": 0.0,
    "noise": Noise(0.15, 0.5, 0.01, 0.01),
}
"""Poses alone, from bearings alone, with wide sigmas."""

NOISY = Recipe(
    jitter=0.8, speed_sigma=0.4, turn_rate_sigma=0.05, bearing_sigma=0.08, wild=0.01, nobody=7
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
    time, code, distance, bearing = (float(word) for word in lines[5].split())
    subject = int(code) // 10 if code != 99 else NOBODY
    assert (first.times[5], first.subjects[5], first.bearings[5]) == (time, subject, bearing)
    assert first.ranges[5] == distance
    assert len(lines) == len(first.ranges)
    assert log.has_truth
    assert sum(int(np.sum(robot.subjects == NOBODY)) for robot in log.robots) == 3 * 7


def test_a_robots_own_barcode_was_misread_and_one_that_saw_nobody_is_no_fault(
    noisy: Path, tmp_path: Path
) -> None:
    folder = _copy(noisy, tmp_path)
    path = folder / "Robot2_Measurement.dat"
    lines = path.read_text().splitlines()
    words = lines[9].split()
    lines[9] = "\t".join([words[0], "23", *words[2:]])
    path.write_text("\n".join(lines))
    (folder / "Robot3_Measurement.dat").write_text("# nothing\n")
    _, misread, blind = load_log(folder).robots
    assert misread.subjects[7] == NOBODY
    assert len(blind.times) == 0


BAD = [
    ("Robot1_Odometry.dat", 9, "1.0\t2.0", "line 9 has 2 columns; needed are time, speed, turn"),
    ("Robot1_Odometry.dat", 9, "1.0\t2.0\tfast", "line 9: turn rate is 'fast'; a number is needed"),
    ("Robot2_Groundtruth.dat", 8, "1\t2\tinf\t4", "line 8, '1 2 inf 4': holds a value that is not"),
    ("Robot2_Groundtruth.dat", 8, "1\t2\t3\t4", "line 8, '1 2 3 4': its time is before that"),
    ("Robot3_Measurement.dat", 3, "1e300\t13\t3\t4", "line 3, '1e300 13 3 4': holds a value over"),
    ("Robot3_Measurement.dat", 3, "1\t1.5\t3\t4", "line 3, '1 1.5 3 4': barcode is not whole"),
    ("Barcodes.dat", 3, "2\t13\n1\t13", "barcode 13 appears twice"),
    ("Barcodes.dat", 3, "55\t13", "subject 55 has neither files such as Robot55_Odometry.dat nor"),
    ("Landmark_Groundtruth.dat", 3, "-1\t13\t2", "subject -1 is below 1"),
    ("Robot1_Odometry.dat", 9, "1.0,2.0,3.0", "line 9 has 1 column; needed are time, speed, turn"),
    ("Landmark_Groundtruth.dat", 3, "1\t13\t2", "subject 1 is a robot as well"),
    ("Landmark_Groundtruth.dat", 3, "6\t13\t2", "subject 6 appears twice"),
]


@pytest.mark.parametrize(("name", "line", "text", "problem"), BAD)
def test_a_fault_is_reported_with_file_and_line(
    name: str, line: int, text: str, problem: str, noisy: Path, tmp_path: Path, refused: Any
) -> None:
    folder = _copy(noisy, tmp_path)
    lines = (folder / name).read_text().splitlines()
    lines[line - 1] = text
    (folder / name).write_text("\n".join(lines) + "\n")
    err = refused("replay", str(folder))
    assert err.count("\n") == 1
    assert f"{folder / name}: {problem}" in err


def test_files_that_can_not_be_had_are_named(
    noisy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = _copy(noisy, tmp_path)
    assert "no such file or folder; check the path" in refusal_of(folder / "nowhere")
    assert "is no recording; the folder or archive of one holds" in refusal_of(
        folder / "Barcodes.dat"
    )
    (folder / "Robot3_Groundtruth.dat").write_text("# nothing yet\n")
    assert "Robot3_Groundtruth.dat: holds no rows" in refusal_of(folder)
    (folder / "Robot2_Measurement.dat").write_bytes(b"\xff\xfe1 2 3 4")
    assert "Robot2_Measurement.dat: is not a text file" in refusal_of(folder)
    (folder / "Robot2_Measurement.dat").unlink()
    assert "Robot2_Measurement.dat: is missing" in refusal_of(folder)
    (folder / "Robot2_Measurement.dat").mkdir()
    assert "Robot2_Measurement.dat: is a folder" in refusal_of(folder)
    monkeypatch.setattr(recorded_files, "LARGEST_FILE_BYTES", 50)
    assert "is larger than 0 MiB" in refusal_of(folder)
    monkeypatch.setattr(mrclam, "MOST_ROBOTS", 2)
    assert "holds 3 robots, more than 2" in refusal_of(folder)
    monkeypatch.undo()
    for path in folder.glob("Robot*"):
        path.rmdir() if path.is_dir() else path.unlink()
    assert "holds no Robot1_Odometry.dat" in refusal_of(folder)
    assert "can't be read: File name too long" in refusal_of(folder / ("x" * 5000))


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
        delay=0.03,
        **ALONE,
    )
    found = _by_numpy(log, landmarks, meetings=meetings)
    errors, used, rejected = found.errors, found.used, found.rejected
    assert len(errors) == replayed.result.steps == round(replayed.duration / 0.07)
    squares = np.mean(errors**2, axis=0)
    np.testing.assert_allclose(replayed.result.mean_squares[0], squares, rtol=1e-9)
    np.testing.assert_allclose(replayed.result.final_errors[0], errors[-1], rtol=1e-6, atol=1e-9)
    assert (int(replayed.result.accepted[0]), int(replayed.result.gated[0])) == (used, rejected)
    total = sum(len(robot.times) for robot in log.robots)
    assert replayed.not_asked_for + replayed.outside == total - used - rejected - 3 * 7
    assert rejected > 0
    document = replay_document(replayed)
    late = errors[len(errors) // 2 :]
    assert document.heading_rmse_rad == pytest.approx(np.sqrt(np.mean(errors[..., 2] ** 2)))
    for k, robot in enumerate(document.robots):
        squares = np.sum(late[:, k, :2] ** 2, axis=-1)
        assert robot.rms_second_half_m == pytest.approx(np.sqrt(np.mean(squares)))
        assert robot.rms_x_m == pytest.approx(np.sqrt(np.mean(errors[:, k, 0] ** 2)))
        assert robot.coverage_3sigma == pytest.approx(found.covered[k])
    assert document.coverage_3sigma == pytest.approx(np.mean(found.covered))
    assert document.anees is not None
    assert document.anees.value == pytest.approx(found.nees / 9)
    assert document.anees.count == 9
    z = np.sqrt(gate_threshold(0.99))
    assert document.nis.value == pytest.approx(found.nis / truncnorm(-z, z).var())


@dataclass(frozen=True)
class _Found:
    """errors (steps, n, 3); bearings; shares (n,) within 3 sigma, mean NEES, mean NIS."""

    errors: Array
    used: int
    rejected: int
    covered: Array
    nees: float
    nis: float


def _by_numpy(log: Log, landmarks: list[int] | None, *, meetings: bool) -> _Found:
    """What a filter finds that is written in plain loops."""
    time, noise = 0.07, ALONE["noise"]
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
                target = n + known.index(subject)
            elif meetings and 1 <= subject <= n:
                target = int(subject) - 1
            else:
                continue
            # recorded 0.03 s late
            readings.append((at - begin - 0.03, observer, target, bearing))
    readings.sort()
    x = _truth(truths, 0.0).ravel()
    plain = specimen(n)[0].setup._replace(
        landmarks=places, gate=gate_threshold(0.99), kinds=np.zeros(1, dtype=int), variances=[0.01]
    )
    P = np.diag(np.tile([1e-4, 1e-4, 1e-4], n))
    errors: list[Array] = []
    squares, rejected, nees, covered = [], 0, [], []
    ends = [step * time for step in range(1, steps + 1)]
    now = 0.0
    for at, seen in sorted(
        [*((end, None) for end in ends), *((one[0], one) for one in readings)],
        key=lambda event: (event[0], event[1] is None),
    ):
        if not 0.0 < at <= ends[-1]:
            continue
        if at > now:
            share = time / (at - now)
            motion = MotionModel(
                at - now, 0, noise.speed_sigma**2 * share, noise.turn_rate_sigma**2 * share
            )
            speeds, turns = _held_means(odometry, now, at)
            x, P = predict_state(x, P, speeds, turns, plain._replace(motion=motion))
            now = at
        if seen is not None:
            _, observer, target, bearing = seen
            one = plain._replace(observers=[observer], targets=[target])
            x, P, nu, variance = update_state(x, P, 0, bearing, one)
            if nu**2 <= plain.gate * variance:
                squares.append(nu**2 / variance)
            else:
                rejected += 1
            continue
        step = len(errors) + 1
        error = x.reshape(n, 3) - _truth(truths, at)
        error[:, 2] = wrap(error[:, 2])
        errors.append(error)
        if step % 10 == 0 or step == steps:
            nees.append(error.ravel() @ np.linalg.solve(P, error.ravel()))
            covered.append(error**2 <= 9.0 * np.diag(P).reshape(n, 3))
    return _Found(
        errors=np.array(errors),
        used=len(squares),
        rejected=rejected,
        covered=np.mean(covered, axis=(0, 2)),
        nees=float(np.mean(nees)),
        nis=float(np.mean(squares)),
    )


def _truth(truths: list[Array], at: float) -> Array:
    """(n, 3) straight between what is recorded."""
    whole = [np.column_stack([one[:, :3], np.unwrap(one[:, 3])]) for one in truths]
    return np.array([[np.interp(at, one[:, 0], one[:, k]) for k in (1, 2, 3)] for one in whole])


def _held_means(odometry: list[Array], begin: float, end: float) -> Array:
    """(2, n) means over a time of what was last read, by the way and the turn until then."""
    until = []
    for one in odometry:
        gone = np.cumsum(np.diff(one[:, 0])[:, None] * one[:-1, 1:], axis=0)
        gone = np.concatenate([np.zeros((1, 2)), gone])
        until.append([np.diff(np.interp((begin, end), one[:, 0], each))[0] for each in gone.T])
    return np.array(until).T / (end - begin)


def test_a_gap_of_the_truth_is_reported(noisy: Path, tmp_path: Path) -> None:
    folder = _copy(noisy, tmp_path)
    path = folder / "Robot2_Groundtruth.dat"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:1000] + lines[1100:]))
    assert _notes_of(folder, "robot", bearing_sigma=0.08, **ALONE) == [
        "the truth has gaps, 1.0 s in all, the longest of 1.01 s (robot2): errors there are not "
        "known, and figures leave them out"
    ]
    assert _notes_of(noisy, "robot", bearing_sigma=0.08, **ALONE) == []


def test_errors_in_a_gap_of_the_truth_do_not_count(noisy: Path, tmp_path: Path) -> None:
    folder = _copy(noisy, tmp_path)
    path = folder / "Robot2_Groundtruth.dat"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:1000] + lines[2300:]))
    asked: dict[str, Any] = {
        "sample_time": 0.2,
        "bearing_sigma": 0.08,
        "with_series": True,
        "filter": "ekf",
    }
    whole, gapped = (replay(load_log(each), **asked) for each in (noisy, folder))
    known = gapped.known
    assert gapped.unknown_truth_s == pytest.approx(13.0, abs=0.3)
    both = [series(each.result).position_rms for each in (whole, gapped)]
    np.testing.assert_allclose(both[1][known], both[0][known], atol=1e-9)
    assert np.isnan(both[1][~known]).all()
    counted = both[0][1:][known[1:]]
    late = np.arange(1, len(known)) > gapped.clock.samples / 2
    accuracy = gapped.accuracy
    np.testing.assert_allclose(accuracy.position, np.sqrt(np.mean(counted**2, axis=0)), rtol=1e-9)
    settled = both[0][1:][late & known[1:]]
    np.testing.assert_allclose(
        accuracy.late_position, np.sqrt(np.mean(settled**2, axis=0)), rtol=1e-9
    )
    assert gapped.result.coverage_samples < whole.result.coverage_samples
    assert np.all(gapped.coverage <= 1.0)
    # the sightings that the filter had are the same
    assert gapped.nis.value == pytest.approx(whole.nis.value, rel=1e-9)
    # a straight line across the gap is asked for
    bridged = replay(load_log(folder), **asked, max_truth_gap=60.0)
    assert bridged.unknown_truth_s == 0.0
    assert bridged.accuracy.position[1] > 3.0 * accuracy.position[1]


def _notes_of(folder: Path, word: str, **options: Any) -> list[str]:
    notes = replay_document(replay(load_log(folder), **options)).notes
    return [note for note in notes if word in note]


def test_gaps_across_the_ends_of_a_run_count() -> None:
    recorded = np.array([0.0, 5.0, 6.0, 7.0, 20.0])
    assert longest_gap(recorded, 2.0, 4.0) == 5.0
    assert longest_gap(recorded, 2.0, 8.0) == 13.0
    assert longest_gap(recorded, 5.5, 1.0) == 1.0


def _still(*times: float) -> Log:
    """Two robots that stand still and see nobody."""
    truth = np.array([[time, 0.0, 0.0, 0.0] for time in times])
    none = np.zeros(0)
    seen = (none, none.astype(int), none, none)
    robots = [RobotLog(f"robot{k}", k, truth, truth[:, :3], *seen) for k in (1, 2)]
    return Log("still", tuple(robots), (), none.astype(int), np.zeros((0, 2)))


def test_a_whole_number_of_samples_is_not_lost_to_rounding() -> None:
    assert int(0.3 / 0.1) == 2
    assert replay(_still(0.0, 0.3), sample_time=0.1).result.steps == 3


def test_a_filter_that_diverges_is_no_result(monkeypatch: pytest.MonkeyPatch) -> None:
    def diverge(*arguments: Any) -> tuple[Array, Array]:
        (statistics,) = (one.statistics for one in arguments if isinstance(one, FilterRun))
        statistics.squares[:] = np.nan
        return np.zeros((6, 1)), np.zeros((6, 6, 1))

    monkeypatch.setattr(LaneFilter, "run", diverge)
    with pytest.raises(NoSolutionError, match="the filter diverged"):
        replay(_still(0.0, 1.0), **ALONE)


def test_unused_parts_of_a_recording_are_reported(noisy: Path, tmp_path: Path) -> None:
    folder = _copy(noisy, tmp_path)
    path = folder / "Robot3_Odometry.dat"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:202], *lines[402:602]]))
    assert _notes_of(folder, "odometry") == [
        "odometry ends early; from then on they count as standing still: robot3 10.1 s",
        "the odometry of robot3 has a gap of 10.05 s: its last reading counts meanwhile",
    ]
    path.write_text("\n".join(lines[202:]))
    assert _notes_of(folder, "odometry") == [
        "odometry begins late; till then they count as standing still: robot3 9.9 s"
    ]
    path.write_text("\n".join(lines))
    path = folder / "Robot1_Groundtruth.dat"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:3002]))
    assert _notes_of(folder, "truth") == [
        "the truth of robot1 ends 10.0 s early: that part of the recording is not used"
    ]
    replayed = replay(load_log(folder))
    assert replayed.begin == pytest.approx(CLOCK + 0.1, abs=1e-6)
    assert replayed.duration == pytest.approx(29.85)
    path.write_text("\n".join([*lines[:2], *lines[1002:]]))
    assert _notes_of(folder, "truth") == [
        "the truth of robot1 begins 10.0 s late: that part of the recording is not used"
    ]


def test_files_of_other_clocks_and_units_are_reported(noisy: Path, tmp_path: Path) -> None:
    folder = _copy(noisy, tmp_path)
    for k in (1, 2, 3):
        _change(folder / f"Robot{k}_Measurement.dat", 0, lambda time: time + 5000.0)
    assert _notes_of(folder, "bearing")[0].startswith("all 3878 bearings and distances")
    assert "before or after the run: by another clock?" in _notes_of(folder, "bearing")[0]
    for k in (1, 2, 3):
        _change(folder / f"Robot{k}_Measurement.dat", 0, lambda time: time - 5000.0)
        _change(folder / f"Robot{k}_Measurement.dat", 3, np.degrees)
    rejected, degrees = _notes_of(folder, "bearings", bearing_sigma=0.01)[:2]
    assert rejected.startswith("the gate rejected")
    assert degrees.endswith("rad: are they in degrees?")
    _change(folder / "Robot2_Odometry.dat", 0, lambda time: time + 5000.0)
    with pytest.raises(InputError, match=r"odometry of robot2 is from 4999.* by another clock\?"):
        replay(load_log(folder))


def _change(path: Path, column: int, new: Callable[[float], float]) -> None:
    rows = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    for row in rows:
        row[column] = repr(float(new(float(row[column]))))
    path.write_text("\n".join("\t".join(row) for row in rows))


def test_files_of_other_editors_are_read(noisy: Path, tmp_path: Path) -> None:
    folder = _copy(noisy, tmp_path)
    for path in folder.iterdir():
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert replay(load_log(folder)).accuracy.overall().position == (
        replay(load_log(noisy)).accuracy.overall().position
    )


def test_an_interrupt_ends_a_long_run_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compiled code in the main thread would delay an interrupt until it returns."""
    threads, ended = [], threading.Event()

    def endless(*_: Any) -> None:
        threads.append(threading.current_thread())
        os.kill(os.getpid(), signal.SIGINT)
        assert ended.wait(PATIENCE_S)

    monkeypatch.setattr(recorded_run, "_run", endless)
    # a parent in the background has its children ignore interrupts
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            replay(_still(0.0, 1.0))
        assert threads != [threading.main_thread()]
    finally:
        ended.set()
        signal.signal(signal.SIGINT, before)


def test_sigmas_that_are_too_small_are_found_out(noisy: Path) -> None:
    log = load_log(noisy)
    honest = replay(log, bearing_sigma=0.1, **ALONE)
    sure = replay(log, bearing_sigma=0.004, gate_probability=1.0, **ALONE)
    assert sure.anees.verdict == "optimistic" != honest.anees.verdict
    assert sure.nis.value > 10.0 > honest.nis.value
    assert any("larger errors than its sigmas say" in note for note in replay_document(sure).notes)
    wide = replay(log, bearing_sigma=1.0, **ALONE)
    notes = replay_document(wide).notes
    assert any("smaller errors than its sigmas say" in note for note in notes)
    assert any(
        "bearings scatter less than the filter expects" in note and "less than 1 rad" in note
        for note in notes
    )
    notes = replay_document(sure).notes
    assert any("bearings scatter more" in note and "more than 0.004 rad" in note for note in notes)
    lost = replay(log, bearing_sigma=0.002, gate_probability=0.5, **ALONE)
    assert any(note.startswith("the gate rejected") for note in replay_document(lost).notes)


def test_what_can_not_be_run_is_refused(noisy: Path, tmp_path: Path) -> None:
    log = load_log(noisy)
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"landmarks": [9]}, "landmarks: no landmark 9; there are 8, 6, 7"),
        ({"landmarks": "67"}, "landmarks: no landmark '6'; there are 8, 6, 7"),
        ({"bearing_sigma": 0.0}, "bearing_sigma: 0 given; allowed is 1e-06 to 1e+06"),
        ({"bearing_sigma": 1e200}, "bearing_sigma: 1e+200 given; allowed is 1e-06 to 1e+06"),
        ({"sample_time": float("nan")}, "sample_time: nan given; allowed is 1e-06 to 1e+06"),
        ({"delay": 61.0}, "delay: 61 given; allowed is -60 to 60"),
        ({"sample_time": 1e-6}, "sample_time: 39.9 s at a sample time of 1e-06 s makes more than"),
        ({"sample_time": 100.0}, "recording: the truth of all robots is known together for 39.9"),
        ({"gate_probability": 0.0}, "gate_probability: 0 given; allowed is more than 0, up to 1"),
        (
            {"filter": "ideal"},
            "filter: 'ideal' needs the truth, which only trials have; choose ekf",
        ),
    ]
    for given_, problem in wrong:
        with pytest.raises(InputError) as refused:
            replay(log, **given_)
        assert str(refused.value).startswith(problem)
    with pytest.raises(InputError, match="speed_sigma: -1 given"):
        replay(log, noise=type(GROUND_ROBOTS)(-1.0, 0.5, 0.01, 0.01))
    first = replace(log.robots[0], truth=np.zeros((0, 4)))
    unknown = replace(log, robots=(first, *log.robots[1:]))
    assert not unknown.has_truth


# --- the report -----------------------------------------------------------------------------------


def test_at_a_terminal_there_is_a_table(noisy: Path, printed: Any) -> None:
    out = printed("replay", str(noisy), "--landmarks", "none", "--no-meetings", "--format", "table")
    assert "recording: a recording of" in out
    assert "robot3" in out
    assert "0 used, 0 rejected by the gate, 21 of unknown targets" in " ".join(out.split())
    shown = next(line.split() for line in out.splitlines() if line.startswith(" robot3"))
    alone = replay(load_log(noisy), landmarks=[], meetings=False).accuracy
    assert shown[1:6] == [
        f"{figure[2]:.3f}"
        for figure in (alone.x, alone.y, alone.position, alone.late_position, alone.heading)
    ]
    assert "this is odometry alone" in out


def test_a_filter_that_needs_the_truth_is_no_choice(noisy: Path, refused: Any) -> None:
    err = refused("replay", str(noisy), "--filter", "ideal")
    assert "'ideal' is not one of 'ekf', 'second-order', 'robust', 'paper'" in err


OPTIONS_OF_FILTER = [
    ("--filter", "paper", "filter", "model"),
    ("--bearing-sigma-rad", 0.11, "bearing_sigma", "bearing_sigma_rad"),
    ("--range-sigma-m", 0.4, "range_sigma", "range_sigma_m"),
    ("--speed-sigma-mps", 0.33, "", "speed_sigma_mps"),
    ("--turn-rate-sigma-rad-s", 0.07, "", "turn_rate_sigma_rad_s"),
    ("--speed-scale-sigma", 0.03, "speed_scale_sigma", "speed_scale_sigma"),
    ("--turn-rate-bias-sigma-rad-s", 0.02, "turn_rate_bias_sigma", "turn_rate_bias_sigma_rad_s"),
    ("--bearing-bias-sigma-rad", 0.015, "bearing_bias_sigma", "bearing_bias_sigma_rad"),
    ("--delay-s", 0.06, "delay", "delay_s"),
    ("--start", "prior", "start", "start"),
    ("--start-sigma-m", 0.7, "", "position_sigma_m"),
    ("--start-sigma-rad", 0.05, "", "heading_sigma_rad"),
    ("--sample-time-s", 0.08, "sample_time", "sample_time_s"),
    ("--gate", 0.98, "gate_probability", "gate_probability"),
]
"""Option and value, the library's argument where it is one of its own, key of the report."""


def test_every_option_reaches_the_filter(noisy: Path, run: Any) -> None:
    words = [word for option, value, *_ in OPTIONS_OF_FILTER for word in (option, str(value))]
    words += ["--no-meetings", "--landmarks", "8", "--seed", "5"]
    status, out, err = run("replay", str(noisy), *words)
    assert status == 0
    given: dict[str, Any] = {key: value for _, value, key, _ in OPTIONS_OF_FILTER if key}
    given |= {"landmarks": np.array([8]), "meetings": False, "seed": 5}
    replayed = replay(load_log(noisy), noise=Noise(0.33, 0.07, 0.7, 0.05), **given)
    found = json.loads(out)
    assert found == json.loads(json.dumps(replay_document(replayed).as_json()))
    assert found["filter"] == {key: value for _, value, _, key in OPTIONS_OF_FILTER}
    assert (found["landmarks"], found["meetings"]) == ([8], False)
    assert [line.partition(": ")[2] for line in err.splitlines()] == found["notes"]


def test_the_options_defaults_are_the_librarys() -> None:
    command: Any = get_command(command_line.application())
    options = {option.name: option.default for option in command.commands["replay"].params}
    shown = {field.name for field in fields(ReplaySettings)} & set(options)
    assert {"meetings", "bearing_sigma", "delay", "start", "window"} <= shown
    for name in shown:
        assert options[name] == getattr(ReplaySettings(), name)
    for name in ("gate_probability", "with_series", "seed", "filter"):
        assert options[name] == getattr(OPTIONS, name)
    assert options["speed_sigma"] == GROUND_ROBOTS.speed_sigma
    assert options["turn_rate_sigma"] == GROUND_ROBOTS.turn_rate_sigma
    assert STARTS["truth"].sigmas == (GROUND_ROBOTS.position_sigma, GROUND_ROBOTS.heading_sigma)


def test_a_report_is_drawn(noisy: Path, tmp_path: Path, run: Any, refused: Any) -> None:
    replayed = replay(load_log(noisy), with_series=True)
    assert list(figures.figures_of(replayed)) == ["accuracy", "errors", "consistency"]
    shown = figures.error_bands(replayed, ["robot2"])
    assert shown.layout.annotations[0].text == "robot2: x in m"
    assert "a recording of 39.9 s" in json.dumps(shown.to_plotly_json(), default=str)
    report, page = tmp_path / "report.json", tmp_path / "page.html"
    assert run("replay", str(noisy), "-o", str(report))[0] == 0
    assert run("plot", str(report), "-o", str(page))[0] == 0
    assert "recording: error found" in page.read_text()
    err = refused("plot", str(report), "--figure", "errors", "-o", str(page))
    assert "--series keeps them" in err


# --- real robots ----------------------------------------------------------------------------------


def test_real_robots_are_found_as_well_as_by_others(real: Log) -> None:
    """RMSE of a plain filter of other make, with the same sigmas: the README of the recording."""
    assert (len(real.robots), len(real.landmarks)) == (5, 15)
    cases: list[tuple[list[int] | None, bool, float]] = [
        ([], False, 2.75),
        ([], True, 0.73),
        ([7, 15], False, 0.64),
        ([7, 15], True, 0.20),
        (None, True, 0.139),
    ]
    given = {**ALONE, "bearing_sigma": 0.08, "window": 0.0}
    for landmarks, meetings, expected in cases:
        replayed = replay(real, landmarks=landmarks, meetings=meetings, **given)
        assert replayed.duration == pytest.approx(772.0, abs=0.5)
        assert replayed.accuracy.overall().position == pytest.approx(expected, rel=0.08)
        assert replayed.unknown == 6


@pytest.fixture(scope="module")
def found_of(real: Log) -> Callable[..., Replay]:
    """Replays of the real robots, each run once."""
    return lru_cache(lambda **given: replay(real, window=0.0, **given))


@pytest.mark.parametrize("case", CASES, ids=lambda case: case[0])
def test_one_set_of_settings_finds_real_robots(
    case: tuple[str, list[int] | None, bool, float], found_of: Callable[..., Replay]
) -> None:
    _, chosen, distances, limit = case
    landmarks = chosen and tuple(chosen)
    for delay in (0.0, 0.2):
        found = found_of(landmarks=landmarks, distances=distances, delay=delay)
        assert found.accuracy.overall().position < limit
        assert found.anees.verdict == "consistent"
    # wheels that are worn: the robots moved less than they read
    scales = [one.value for one in found.lasting_errors if one.name == "speed_scale"]
    assert -0.12 < min(scales) < max(scales) < 0.0


@pytest.mark.parametrize("landmarks", [(7, 15), None])
@pytest.mark.parametrize("distances", [False, True])
def test_a_bearing_walk_makes_the_filter_of_real_robots_more_consistent(
    landmarks: tuple[int, ...] | None, distances: bool, found_of: Callable[..., Replay]
) -> None:
    walk = {"bearing_sigma": 0.0065, "bearing_walk_sigma": 0.025, "bearing_walk_time": 3.0}
    plain, walking = (
        found_of(landmarks=landmarks, distances=distances, delay=0.0, **changes)
        for changes in ({}, walk)
    )
    assert walking.accuracy.overall().position <= plain.accuracy.overall().position
    for before, after in ((plain.anees, walking.anees), (plain.nis, walking.nis)):
        assert abs(after.value - 1.0) < abs(before.value - 1.0)


def _copy(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / "recording"))
