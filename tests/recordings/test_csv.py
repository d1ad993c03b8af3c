"""Recordings as CSV files: read as those of MRCLAM, their faults named by file, line and cell."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.errors import InputError
from syncplan.estimation.replays import replay
from syncplan.recordings import csv_layout, log
from syncplan.recordings.log import NOBODY
from syncplan.recordings.recording_formats import load_log
from syncplan.reports.replay_report import replay_document
from tests.tools.recordings import Recipe, assert_same, refusal_of, write_csv, write_recording

SMALL = {
    "odometry.csv": """\
robot,time_s,speed_mps,turn_rate_rad_s
rover,0.0,1.0,0.1
mule 10,0.0,0.5,0
mule 2,0.0,0.5,0
rover,1.0,1.5,0.2
""",
    "sightings.csv": """\
range_m,target,robot,bearing_rad,time_s
2.5,rover,mule 2,,0.5
,"pole",rover,-0.25,0.5

1.0,,rover,0.5,0.75
3.5, mule 10 ,rover,nan,0.75
""",
    "landmarks.csv": """\
name,y_m,x_m
pole,2.0,1.0
porté,4.0,3.0
""",
    "truth.csv": """\
robot,time_s,x_m,y_m,heading_rad
rover,0.0,0.0,0.0,0.0
rover,1.0,1.0,0.0,0.1
mule 2,0.0,5.0,5.0,1e-3
mule 10,0.0,6.0,5.0,3.0
""",
}


def _written(folder: Path, **changed: str | None) -> Path:
    """The small recording, with files replaced, or left out where None."""
    folder.mkdir(exist_ok=True)
    for name, usual in SMALL.items():
        text = changed.get(name.removesuffix(".csv"), usual)
        if text is not None:
            (folder / name).write_text(text)
    return folder


def test_columns_in_any_order_with_names_and_gaps_are_read(tmp_path: Path) -> None:
    log = load_log(_written(tmp_path / "small"))
    assert log.name == "small"
    assert [robot.name for robot in log.robots] == ["mule 2", "mule 10", "rover"]
    assert [robot.subject for robot in log.robots] == [1, 2, 3]
    assert log.landmark_names == ("pole", "porté")
    assert log.landmark_subjects.tolist() == [4, 5]
    assert log.landmarks.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    mule, other, rover = log.robots
    assert rover.odometry.tolist() == [[0.0, 1.0, 0.1], [1.0, 1.5, 0.2]]
    assert rover.truth.tolist() == [[0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.1]]
    assert rover.times.tolist() == [0.5, 0.75, 0.75]
    assert rover.subjects.tolist() == [4, NOBODY, 2]
    np.testing.assert_array_equal(rover.bearings, [-0.25, 0.5, np.nan])
    np.testing.assert_array_equal(rover.ranges, [np.nan, 1.0, 3.5])
    assert (mule.subjects.tolist(), mule.ranges.tolist()) == ([3], [2.5])
    assert np.isnan(mule.bearings).all()
    assert len(other.times) == 0
    assert log.has_truth


def test_truth_may_be_left_out_and_robots_may_see_nothing(tmp_path: Path) -> None:
    nothing = SMALL["sightings.csv"].splitlines()[0]
    log = load_log(_written(tmp_path / "small", truth=None, sightings=nothing))
    assert [len(robot.times) for robot in log.robots] == [0] * 3
    assert not log.has_truth
    assert all(robot.truth.shape == (0, 4) for robot in log.robots)


def test_the_same_recording_is_the_same_in_either_layout(tmp_path: Path) -> None:
    recipe = Recipe(duration=8.0, jitter=0.5, bearing_sigma=0.05, nobody=3)
    by_number = load_log(write_recording(tmp_path / "numbers", recipe, seed=2))
    by_name = load_log(write_csv(by_number, tmp_path / "names"))
    for one, other in zip(by_number.robots, by_name.robots, strict=True):
        for column in ("name", "truth", "odometry", "times", "bearings", "ranges"):
            np.testing.assert_array_equal(getattr(one, column), getattr(other, column))
    first, second = (
        replay_document(replay(log, landmarks=log.landmark_names)).as_json()
        for log in (by_number, by_name)
    )
    assert (first.pop("name"), second.pop("name")) == ("numbers", "names")
    assert (first.pop("landmarks"), second.pop("landmarks")) == ([8, 6, 7], ["8", "6", "7"])
    assert first == second


def test_long_files_are_read_piece_by_piece(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = load_log(_written(tmp_path / "small"))
    monkeypatch.setattr(csv_layout, "ROWS_AT_ONCE", 1)
    assert_same(whole, load_log(tmp_path / "small"))
    with pytest.raises(InputError, match=r"odometry.csv: line 4: speed_mps is 'fast'; a number"):
        load_log(
            _written(
                tmp_path / "bad", odometry=SMALL["odometry.csv"].replace("2,0.0,0.5", "2,0.0,fast")
            )
        )


def test_files_of_spreadsheets_are_read(tmp_path: Path) -> None:
    folder = _written(tmp_path / "small")
    plain = load_log(folder)
    for path in folder.iterdir():
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert_same(plain, load_log(folder))


FAULTS = [
    ("odometry", "robot,time_s", "robot,time", "line 1: no column is named 'time'; the co"),
    ("sightings", "range_m,target", "range_m,seen", "bearing_rad (optional), range_m (opt"),
    ("odometry", ",speed_mps", "", "line 1: column speed_mps is missing; the"),
    ("odometry", "speed_mps,", "speed_mps,robot,", "line 1: column robot is there twice"),
    ("odometry", SMALL["odometry.csv"], "", "line 1 must name columns, with"),
    ("landmarks", SMALL["landmarks.csv"], "name;x_m;y_m", "line 1 must name columns, with"),
    ("odometry", "0,1.0,0.1", "0,1.0", "line 2 has 3 cells; line 1 names 4"),
    ("sightings", "0.5,0.75\n", "0.5,,\n", "line 5 has 6 cells; line 1"),
    ("sightings", "-0.25", "-inf", "line 3: bearing_rad is '-inf'; a finite"),
    ("truth", "6.0,5.0", "6.0,5e12", "line 5: y_m is '5e12'; allowed is up to"),
    ("odometry", "rover,1.0", "rover,-1.0", "line 5: time_s is '-1.0'; the row before of"),
    ("sightings", "nan,0.75", "0,0.7", "line 6: time_s is '0.7'; the row"),
    ("odometry", "mule 2", "", "line 4: robot is ''; a name is needed"),
    ("odometry", "mule 2", "x" * 65, "a name has at most 64 characters"),
    ("odometry", "mule 2", "a\x1bb", "robot is 'a\\x1bb'; a name has neither commas nor"),
    ("landmarks", "pole", '"a,b"', "line 2: name is 'a,b'; a name has neither"),
    ("landmarks", "porté", "pole", "line 3: name is 'pole'; it is there twice"),
    ("landmarks", "porté", "rover", "line 3: name is 'rover'; a robot has this"),
    ("landmarks", "porté", "none", "line 3: name is 'none'; it stands for"),
    ("sightings", "2.5,rover", "-2.5,rover", "line 2: range_m is '-2.5'; allowed is 0 or"),
    ("sightings", "rover,mule 2", "rover,mule", "line 2: robot is 'mule'; it has no rows"),
    ("truth", "mule 10", "mule", "line 5: robot is 'mule'; it has no rows in"),
    ("truth", "mule 10,0.0,6.0,5.0,3.0\n", "", "holds no rows of robot 'mule 10'"),
    ("odometry", "rover,0", 'rover,"0', "line 5: unexpected end of data"),
]


@pytest.mark.parametrize(
    ("file", "old", "new", "reported"), FAULTS, ids=[fault[-1][:50] for fault in FAULTS]
)
def test_a_fault_is_reported_with_file_line_column_and_cell(
    file: str, old: str, new: str, reported: str, tmp_path: Path, refused: Any
) -> None:
    before = SMALL[f"{file}.csv"]
    assert old in before
    folder = _written(tmp_path / "small", **{file: before.replace(old, new, 1)})
    err = refused("replay", str(folder))
    assert err.count("\n") == 1
    place, _, problem = err.partition(f"{folder}/{file}.csv: ")
    assert (place, reported in problem) == ("syncplan: ", True)


def test_sightings_are_bearings_or_distances(tmp_path: Path) -> None:
    neither = "robot,time_s,target\nrover,0.5,pole\n"
    with pytest.raises(InputError, match="line 1: names neither bearing_rad nor range_m; at"):
        load_log(_written(tmp_path / "neither", sightings=neither))
    distances = "robot,time_s,target,range_m\nrover,0.5,pole,2\n"
    (robot,) = load_log(_written(tmp_path / "distances", sightings=distances)).robots[2:]
    assert (robot.ranges.tolist(), np.isnan(robot.bearings).tolist()) == ([2.0], [True])
    gap = load_log(_written(tmp_path / "gap", sightings=distances.replace(",2\n", ",\n")))
    assert len(gap.robots[2].times) == 0
    assert gap.notes == ("1 sightings have neither a bearing nor a distance: they do not count",)


def test_files_that_can_not_be_had_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = _written(tmp_path / "small", landmarks=None)
    assert "landmarks.csv: is missing; its first line names the columns name, x_m, y_m" in (
        refusal_of(folder)
    )
    (folder / "landmarks.csv").write_bytes(b"name,x_m,y_m\n\xff,1,2\n")
    assert "landmarks.csv: is not a text file in UTF-8" in refusal_of(folder)
    (folder / "landmarks.csv").write_text("name,x_m,y_m\n" + "x" * 200_000)
    assert "landmarks.csv: line 2: field larger than field limit" in refusal_of(folder)
    (folder / "odometry.csv").write_text(SMALL["odometry.csv"].splitlines()[0])
    assert "odometry.csv: holds no rows below its first line" in refusal_of(folder)
    _written(folder)
    monkeypatch.setattr(log, "MOST_ROBOTS", 2)
    assert "small: holds 3 robots, more than 2" in refusal_of(folder)


def test_a_folder_holds_one_recording(tmp_path: Path, refused: Any) -> None:
    folder = _written(tmp_path / "small")
    (folder / "Barcodes.dat").write_text("1 1\n")
    err = refused("replay", str(folder))
    assert "holds 2 recordings, Robot1_Odometry.dat (MRCLAM), odometry.csv (CSV); keep each" in err
    (tmp_path / "empty").mkdir()
    err = refused("replay", str(tmp_path / "empty"))
    assert (
        "is no recording; the folder or archive of one holds Robot1_Odometry.dat (MRCLAM), odometry"
        in err
    )


def test_landmarks_are_chosen_by_name(tmp_path: Path, refused: Any) -> None:
    folder = _written(tmp_path / "small")
    err = refused("replay", str(folder), "--landmarks", "pole,door")
    assert "--landmarks: no landmark 'door'; there are pole, porté" in err
    before = (folder / "truth.csv").read_bytes()
    err = refused("replay", str(folder), "-o", str(folder / "truth.csv"))
    assert "is the file that is read" in err
    assert (folder / "truth.csv").read_bytes() == before


NAMES = st.sampled_from(["r1", "r2", "r10", "été"])
VALUES = st.floats(-1e6, 1e6)
SEEN = st.tuples(
    NAMES,
    st.sampled_from(["", "L1", "dock 2"]),
    st.none() | VALUES,
    st.none() | st.floats(0.0, 1e6),
).filter(lambda row: row[2:] != (None, None))


@given(
    odometry=st.lists(st.tuples(NAMES, VALUES, VALUES), min_size=1, max_size=30),
    seen=st.lists(SEEN, max_size=30),
)
def test_rows_come_back_as_they_were_written(
    odometry: list[Any], seen: list[Any], tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.getbasetemp() / "rows"
    folder.mkdir(exist_ok=True)
    robots = {robot for robot, *_ in odometry}
    seen = [row for row in seen if row[0] in robots]
    lines = ["robot,time_s,speed_mps,turn_rate_rad_s"]
    lines += [
        f"{robot},{time},{speed!r},{turn!r}" for time, (robot, speed, turn) in enumerate(odometry)
    ]
    (folder / "odometry.csv").write_text("\n".join(lines))
    lines = ["target,range_m,bearing_rad,time_s,robot"]
    lines += [
        f"{target},{'' if away is None else away},{'' if angle is None else angle},{time},{robot}"
        for time, (robot, target, angle, away) in enumerate(seen)
    ]
    (folder / "sightings.csv").write_text("\n".join(lines))
    (folder / "landmarks.csv").write_text("name,x_m,y_m\ndock 2,1,2\nL1,3,4")
    log = load_log(folder)
    assert {robot.name for robot in log.robots} == robots
    subjects = dict(zip(log.landmark_names, log.landmark_subjects.tolist(), strict=True))
    for robot in log.robots:
        mine = [(t, *row[1:]) for t, row in enumerate(odometry) if row[0] == robot.name]
        assert robot.odometry.tolist() == [list(row) for row in mine]
        theirs = [(t, *row[1:]) for t, row in enumerate(seen) if row[0] == robot.name]
        assert robot.times.tolist() == [row[0] for row in theirs]
        assert robot.subjects.tolist() == [subjects.get(row[1], NOBODY) for row in theirs]
        for values, place in ((robot.bearings, 2), (robot.ranges, 3)):
            wanted = [np.nan if row[place] is None else row[place] for row in theirs]
            np.testing.assert_array_equal(values, wanted)
