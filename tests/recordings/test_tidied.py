"""What recordings hold that does not count: the same rule in all layouts."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncplan.errors import InputError
from syncplan.estimation.replays import replay
from syncplan.recordings.log import NOBODY, Log, pack_log, unpack_log
from syncplan.recordings.recording_formats import load_log
from syncplan.reports.replay_report import replay_document
from tests.tools.recorded_bags import write_bag
from tests.tools.recordings import Recipe, assert_same, write_csv, write_recording

RECIPE = Recipe(duration=8.0, jitter=0.5, bearing_sigma=0.05)


@pytest.fixture(scope="module")
def numbers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording in the layout of MRCLAM."""
    return write_recording(tmp_path_factory.mktemp("tidied") / "numbers", RECIPE, seed=2)


def edited(numbers: Path, folder: Path, layout: str, **changes: Any) -> Log:
    """The recording in a layout, with rows changed: `changes` from a file's name to a function."""
    folder = write_csv(load_log(numbers), folder) if layout == "csv" else copied(numbers, folder)
    for name, change in changes.items():
        path = folder / (f"{name}.csv" if layout == "csv" else f"Robot1_{MRCLAM[name]}.dat")
        path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")
    return load_log(folder)


MRCLAM = {"odometry": "Odometry", "sightings": "Measurement", "truth": "Groundtruth"}


def copied(folder: Path, to: Path) -> Path:
    """A copy of a folder of files."""
    to.mkdir()
    for path in folder.iterdir():
        (to / path.name).write_bytes(path.read_bytes())
    return to


@pytest.mark.parametrize("layout", ["csv", "mrclam"])
@pytest.mark.parametrize("times", [2, 10])
def test_equal_sightings_count_once(numbers: Path, tmp_path: Path, layout: str, times: int) -> None:
    whole = edited(numbers, tmp_path / "whole", layout)

    def repeated(lines: list[str]) -> list[str]:
        head = [line for line in lines if line.startswith(("#", "robot,"))]
        return head + [line for line in lines[len(head) :] for _ in range(times)]

    log = edited(numbers, tmp_path / "twice", layout, sightings=repeated)
    (note,) = log.notes
    assert note.endswith("each counts once")
    again = edited(numbers, tmp_path / "edited", layout, sightings=lambda lines: lines)
    assert again.notes == ()
    for one, other in zip(whole.robots, log.robots, strict=True):
        for column in ("times", "subjects", "bearings", "ranges"):
            np.testing.assert_array_equal(getattr(one, column), getattr(other, column))
    document = replay_document(replay(log, window=0.0))
    assert document.notes[0] == note
    assert document.nis == replay_document(replay(whole, window=0.0)).nis
    assert unpack_log(pack_log(log)).notes == log.notes


def test_sightings_that_differ_in_anything_are_kept(numbers: Path, tmp_path: Path) -> None:
    rows = [
        "robot1,1.0,robot2,0.1,2.0",
        "robot1,1.0,robot2,0.1,2.0",
        "robot1,1.0,robot2,0.1,",
        "robot1,1.0,robot2,0.1,",
        "robot1,1.0,robot3,0.1,2.0",
        "robot1,1.5,robot2,0.1,2.0",
        "robot2,1.0,robot1,0.1,2.0",
    ]
    head = "robot,time_s,target,bearing_rad,range_m"
    log = edited(numbers, tmp_path / "log", "csv", sightings=lambda _: [head, *rows])
    assert [len(robot.times) for robot in log.robots] == [4, 1, 0]
    assert log.notes[0].startswith("2 sightings repeat another one")


@pytest.mark.parametrize("layout", ["csv", "mrclam"])
def test_rows_that_lack_a_number_are_left_out_and_counted(
    numbers: Path, tmp_path: Path, layout: str
) -> None:
    whole = edited(numbers, tmp_path / "whole", layout)

    def lacking(column: int) -> Any:
        def change(lines: list[str]) -> list[str]:
            split = "," if layout == "csv" else None
            cells = lines[20].split(split)
            cells[column - len(cells)] = "nan"
            return [*lines[:20], (split or " ").join(cells), *lines[21:]]

        return change

    log = edited(numbers, tmp_path / "odd", layout, odometry=lacking(2), truth=lacking(3))
    assert log.notes == (
        "1 rows of the odometry lack a number: they do not count",
        "1 rows of the truth lack a number: they do not count",
    )
    before, after = whole.robots[0], log.robots[0]
    assert len(after.odometry) == len(before.odometry) - 1
    assert len(after.truth) == len(before.truth) - 1
    assert np.isfinite(after.odometry).all()


def test_targets_that_nobody_knows_are_counted_by_their_names(
    numbers: Path, tmp_path: Path
) -> None:
    def renamed(lines: list[str]) -> list[str]:
        return [line.replace(",7,", ",a passer-by,") for line in lines]

    log = edited(numbers, tmp_path / "log", "csv", sightings=renamed)
    for known in (log, load_log(write_bag(log, tmp_path / "bag"))):
        count = sum(int(np.sum(robot.subjects == NOBODY)) for robot in known.robots)
        assert count > 0
        assert known.notes == (
            "targets that are neither robots nor landmarks count as not recognised: "
            f"a passer-by ({count})",
        )


@pytest.mark.parametrize(
    ("stamped", "words"),
    [
        (lambda time: 0.0, r"all equal \(0 s\): were stamps left empty\? --stamps received"),
        (lambda time: 1.248e9, r"all equal \(1248000000 s\): were their digits cut off"),
        (lambda time: np.floor(time), r"equal in runs of 18 rows .*: were their digits cut off"),
    ],
    ids=["zero", "rounded", "runs"],
)
def test_equal_stamps_are_refused_with_their_cause(
    numbers: Path, tmp_path: Path, stamped: Any, words: str
) -> None:
    def change(lines: list[str]) -> list[str]:
        rows = [line.split(",") for line in lines[1:]]
        return [
            lines[0],
            *(",".join([r, repr(float(stamped(float(t)))), *rest]) for r, t, *rest in rows),
        ]

    with pytest.raises(InputError, match=words):
        edited(numbers, tmp_path / "log", "csv", odometry=change)


def test_a_bag_is_read_by_times_of_receipt(numbers: Path, tmp_path: Path) -> None:
    log = load_log(numbers)
    stamped = write_bag(log, tmp_path / "stamped" / "bag")
    empty = write_bag(log, tmp_path / "empty" / "bag", empty_stamps=True)
    assert_same(load_log(empty, stamps="received"), load_log(stamped))
    with pytest.raises(
        InputError, match=r"all equal \(0 s\): were stamps left empty\? --stamps received"
    ):
        load_log(empty)
    with pytest.raises(InputError, match="stamps: 'received' given; MRCLAM recordings have header"):
        load_log(numbers, stamps="received")
    with pytest.raises(InputError, match="stamps: 'sent' given; ROS 2 bag recordings have header"):
        load_log(stamped, stamps="sent")  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["odometry", "truth"])
def test_a_robot_of_which_no_row_has_its_numbers_is_named(
    numbers: Path, tmp_path: Path, name: str
) -> None:
    def lacking(lines: list[str]) -> list[str]:
        rows = [line.split(",") for line in lines]
        of_one = [[*row[:-1], "nan"] if row[0] == "robot2" else row for row in rows]
        return [",".join(row) for row in of_one]

    with pytest.raises(InputError, match=f"no row of the {name} of robot2 has all its numbers"):
        edited(numbers, tmp_path / "log", "csv", **{name: lacking})


def test_equal_stamps_of_the_truth_are_refused_and_repeated_entries_are_not(
    numbers: Path, tmp_path: Path
) -> None:
    def cut(lines: list[str]) -> list[str]:
        rows = [line.split(",") for line in lines[1:]]
        return [lines[0], *(",".join([r, "0.0", *rest]) for r, _, *rest in rows)]

    with pytest.raises(InputError, match=r"the times of the truth of robot1 are all equal \(0 s\)"):
        edited(numbers, tmp_path / "cut", "csv", truth=cut)
    log = edited(
        numbers,
        tmp_path / "repeated",
        "csv",
        truth=lambda lines: [lines[0], *(line for line in lines[1:] for _ in range(5))],
    )
    assert log.has_truth
