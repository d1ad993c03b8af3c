"""Recordings as ROS 2 bags: read as the same in CSV, their faults named by topic and reading."""

import builtins
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_ros2.writer import Writer

from syncplan.recordings import ros_bags
from syncplan.recordings.log import NOBODY, Log, RobotLog
from syncplan.recordings.recording_formats import load_log
from tests.tools.recorded_bags import BagMessages, Message, write_bag, write_messages
from tests.tools.recordings import Recipe, refusal_of, with_robots, write_csv, write_recording

OF = BagMessages()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """A recording of which some sightings lack the direction or the distance."""
    folder = tmp_path_factory.mktemp("recorded")
    recipe = Recipe(duration=5.0, jitter=0.5, bearing_sigma=0.05, nobody=3)
    log = load_log(write_recording(folder / "numbers", recipe, seed=2))

    def lacking(robot: RobotLog) -> RobotLog:
        bearings, ranges = robot.bearings.copy(), robot.ranges.copy()
        bearings[1::5] = np.nan
        ranges[2::5] = np.nan
        return replace(robot, bearings=bearings, ranges=ranges)

    return with_robots(log, lacking)


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_a_bag_holds_what_the_same_in_csv_does(storage: str, recorded: Log, tmp_path: Path) -> None:
    plain = load_log(write_csv(recorded, tmp_path / "csv"))
    folder = write_bag(recorded, tmp_path / "bag", storage)
    log = load_log(folder)
    assert log.name == "bag"
    assert log.landmark_names == plain.landmark_names == ("8", "6", "7")
    np.testing.assert_array_equal(log.landmarks, plain.landmarks)
    for found, wanted in zip(log.robots, plain.robots, strict=True):
        assert (found.name, found.subject) == (wanted.name, wanted.subject)
        np.testing.assert_array_equal(found.odometry, wanted.odometry)
        np.testing.assert_array_equal(found.truth[:, :3], wanted.truth[:, :3])
        turned = np.angle(np.exp(1j * (found.truth[:, 3] - wanted.truth[:, 3])))
        assert np.abs(turned).max() < 1e-12
        order, other = _by_time_and_subject(found), _by_time_and_subject(wanted)
        np.testing.assert_array_equal(found.times, wanted.times)
        np.testing.assert_array_equal(found.subjects[order], wanted.subjects[other])
        for column in ("bearings", "ranges"):
            one, two = getattr(found, column)[order], getattr(wanted, column)[other]
            np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-12)
    for one in (one for one in folder.iterdir() if one.suffix in (".mcap", ".db3")):
        assert [len(robot.times) for robot in load_log(one).robots] == [
            len(robot.times) for robot in log.robots
        ]


def _by_time_and_subject(robot: Any) -> Any:
    return np.lexsort((robot.subjects, robot.times))


def _small() -> list[Message]:
    return [
        ("/landmarks", 0.0, OF.detections(0.0, [("pole", 1.0, 2.0)])),
        ("/team/r1/odom", 1.0, OF.odometry(1.0, 0.5, 0.1)),
        ("/team/r1/odom", 0.0, OF.odometry(0.0, 0.4, 0.1)),
        ("/r10/odom", 0.0, OF.twist(0.0, 0.3, 0.2)),
        ("/r2/odom", 0.0, OF.twist(0.0, 0.2, 0.2)),
        ("/r2/sightings", 0.5, OF.detections(0.5, [("pole", 3.0, 4.0), ("r2", 1.0, 0.0)])),
        ("/r2/sightings", 0.6, OF.detections(0.6, [])),
        ("/r2/camera_info", 0.5, OF.twist(0.5, 0.0, 0.0)),
    ]


def test_robots_are_their_name_spaces_and_truth_may_be_left_out(tmp_path: Path) -> None:
    log = load_log(write_messages(tmp_path / "bag", _small()))
    assert [robot.name for robot in log.robots] == ["r2", "r10", "team/r1"]
    assert not log.has_truth
    assert log.robots[2].odometry.tolist() == [[0.0, 0.4, 0.1], [1.0, 0.5, 0.1]]
    seen = log.robots[0]
    assert seen.subjects.tolist() == [4, NOBODY]
    assert seen.ranges.tolist() == [5.0, 1.0]
    assert seen.bearings.tolist() == [np.arctan2(4.0, 3.0), 0.0]


def test_a_bag_may_be_without_landmarks(tmp_path: Path) -> None:
    log = load_log(write_messages(tmp_path / "bag", _small()[1:]))
    assert log.landmarks.shape == (0, 2)
    assert log.robots[0].subjects.tolist() == [NOBODY, NOBODY]
    # as it is read without what says how several files belong together
    (tmp_path / "bag" / "metadata.yaml").unlink()
    assert [robot.name for robot in load_log(tmp_path / "bag").robots] == ["r2", "r10", "team/r1"]


_STAMPED = "std_msgs/Header header\n"
_PARTS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
    "vision_msgs/Detection3D": (
        _STAMPED + "vision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox3D bbox\nstring id"
    ),
    "vision_msgs/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose"
    ),
    "vision_msgs/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
}
"""Definitions of ROS 2 Humble and vision_msgs 4, as docs.ros.org shows them."""


def test_a_compressed_file_of_other_software_is_read(tmp_path: Path) -> None:
    more = "".join(f"\n{'=' * 80}\nMSG: {name}\n{text}" for name, text in _PARTS.items())
    header = {"stamp": {"sec": 7, "nanosec": 500_000_000}, "frame_id": "base_link"}
    guess = {
        "hypothesis": {"class_id": "r2", "score": 0.5},
        "pose": {"pose": {"position": {"x": 0.0, "y": 2.0, "z": 9.0}}, "covariance": [0.0] * 36},
    }
    detections = {"header": header, "detections": [{"header": header, "results": [guess]}]}
    moved = {"header": header, "twist": {"linear": {"x": 1.5}, "angular": {"z": -0.5}}}
    with (tmp_path / "one.mcap").open("wb") as stream:
        writer = Writer(stream)
        twist = writer.register_msgdef(
            "geometry_msgs/msg/TwistStamped", _STAMPED + "geometry_msgs/Twist twist" + more
        )
        seen = writer.register_msgdef(
            "vision_msgs/msg/Detection3DArray",
            _STAMPED + "vision_msgs/Detection3D[] detections" + more,
        )
        for topic, schema, message in (
            ("/r1/odom", twist, moved),
            ("/r2/odom", twist, moved),
            ("/r1/sightings", seen, detections),
        ):
            writer.write_message(topic, schema, message, log_time=8_000_000_000)
        writer.finish()  # type: ignore[no-untyped-call]
    robot = load_log(tmp_path / "one.mcap").robots[0]
    assert robot.odometry.tolist() == [[7.5, 1.5, -0.5]]
    assert (robot.times.tolist(), robot.subjects.tolist()) == ([7.5], [2])
    assert (robot.bearings.tolist(), robot.ranges.tolist()) == ([np.pi / 2], [2.0])


PLACED = OF.placed(1.0, 0.0, 0.0, 0.0)


def _seen(name: str, x: float, y: float) -> object:
    return OF.detections(1.0, [(name, x, y)])


FAULTS: list[tuple[str, object, str]] = [
    ("/r2/odom", PLACED, "has messages geometry_msgs/msg/PoseStamped; allowed are nav_msgs/msg"),
    ("/r3/sightings", OF.detections(1.0, []), "is there without /r3/odom; record both"),
    ("/r2/odom", OF.twist(1.0, np.inf, 0.0), "reading 2: speed is inf; a finite number up to 1"),
    ("/r2/bearings", _seen("pole", 0.0, 0.0), "reading 1: the target is where the robot is; no"),
    ("/landmarks", _seen("pole", 1.0, 3.0), "class_id is 'pole'; it is at two places; landmarks"),
    ("/landmarks", _seen("r2", 1.0, 3.0), "class_id is 'r2'; a robot has this name as well"),
    ("/r2/ground_truth", PLACED, "holds no messages, but others have truth; record that of all"),
    (f"/{'x' * 65}/odom", OF.twist(1.0, 0.0, 0.0), "a name has at most 64 characters"),
]


@pytest.mark.parametrize(("topic", "message", "reported"), FAULTS, ids=[one[2] for one in FAULTS])
def test_a_fault_is_reported_with_topic_and_reading(
    topic: str, message: Any, reported: str, tmp_path: Path, refused: Any
) -> None:
    folder = write_messages(tmp_path / "bag", [*_small(), (topic, 1.0, message)])
    err = refused("replay", str(folder))
    # where truth is of some robots alone, those that have none are named
    named = topic.replace("r2", "r10") if "truth" in topic else topic
    assert err.startswith(f"syncplan: {folder}: {named}: ")
    assert reported in err


def test_bags_that_can_not_be_had_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = write_messages(tmp_path / "other", [("/tf", 0.0, OF.twist(0.0, 0.0, 0.0))])
    assert "other: holds no topic /NAME/odom; its topics are /tf" in refusal_of(other)
    folder = write_messages(tmp_path / "bag", _small())
    monkeypatch.setattr(ros_bags, "MOST_READINGS", 4)
    assert "bag: holds more than 4 readings; record fewer topics" in refusal_of(folder)
    monkeypatch.undo()
    described = (folder / "metadata.yaml").read_text()
    whole = described.replace("compression_mode: ''", 'compression_mode: "F\\x49LE"')
    assert whole != described
    (folder / "metadata.yaml").write_text(whole)
    assert "bag: its files are compressed whole; write them plain with `ros2" in refusal_of(folder)
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: {}")
    assert "bag: can't be read as a ROS 2 bag: A metadata key is missing" in refusal_of(folder)
    (folder / "metadata.yaml").unlink()
    (folder / "more.mcap").write_bytes(b"")
    assert "bag: holds no metadata.yaml; `ros2 bag reindex bag` writes it" in refusal_of(folder)
    (tmp_path / "short.mcap").write_bytes(b"\x89MCAP0\r\n")
    assert "short.mcap: can't be read as a ROS 2 bag: " in refusal_of(tmp_path / "short.mcap")
    (tmp_path / "empty.db3").write_bytes(b"")
    assert "empty.db3: can't be read as a ROS 2 bag: " in refusal_of(tmp_path / "empty.db3")
    real = builtins.__import__

    def without_rosbags(name: str, *others: Any) -> Any:
        if name.startswith("rosbags"):
            raise ImportError(name)
        return real(name, *others)

    monkeypatch.setattr(builtins, "__import__", without_rosbags)
    problem = "bag: is a ROS 2 bag, which needs rosbags: pip install 'syncplan[export]'"
    assert problem in refusal_of(folder)
