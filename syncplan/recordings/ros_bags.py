"""Recordings as ROS 2 bags, in SQLite or MCAP.

    /NAME/odom           nav_msgs/Odometry or geometry_msgs/TwistStamped: its twist
    /NAME/sightings      vision_msgs/Detection3DArray: class_id names the target, the pose is its
                         position relative to the robot: x ahead, y to the left
    /NAME/bearings       the same, if only the direction was measured
    /NAME/ranges         the same, if only the distance was measured
    /NAME/ground_truth   geometry_msgs/PoseStamped or nav_msgs/Odometry: its pose
    /landmarks           vision_msgs/Detection3DArray: names, and positions on the ground

Times are those of the message headers, or of receipt if these are asked for. Targets that are
neither robots nor landmarks count as not recognised: detectors also report other things. Only these
types are read, and only by the definitions here and in rosbags: a bag's own definitions would be
compiled to code.
"""

import math
from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.phrases import listed
from syncplan.recordings.log import NOBODY, Log, NamedTeam, SeenBodies, landmark_problem
from syncplan.recordings.recorded_files import LARGEST_VALUE, name_problem

if TYPE_CHECKING:
    from rosbags.rosbag2 import Reader
    from rosbags.typesys.store import Typestore


Reading = tuple[tuple[float, ...], str]
"""Numbers, the first a time in s, and the name of the target, "" if there is none."""

ODOMETRY = "nav_msgs/msg/Odometry"
DETECTIONS = "vision_msgs/msg/Detection3DArray"

_VISION = {
    DETECTIONS: "std_msgs/Header header\nvision_msgs/Detection3D[] detections",
    "vision_msgs/msg/Detection3D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox3D bbox\nstring id"
    ),
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose"
    ),
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/msg/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
}
"""Definitions of vision_msgs 4, in use since ROS 2 Humble."""


@dataclass(frozen=True, slots=True)
class TopicKind:
    """Kind of a topic.

    Attributes
    ----------
    columns : names of the numbers of a reading
    taken : function from a message to its readings, by type of message
    of_robot : whether each robot has its own topic
    """

    columns: tuple[str, ...]
    taken: Mapping[str, Callable[[Any], list[Reading]]]
    of_robot: bool = True


@cache
def typestore() -> "Typestore":
    """Return the definitions of all types that are read; raises ImportError without rosbags."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in _VISION.items():
        store.register(get_types_from_msg(text, name))
    return store


def _moved(message: Any) -> list[Reading]:
    return [((_seconds(message), message.twist.linear.x, message.twist.angular.z), "")]


def _moved_by_odometry(message: Any) -> list[Reading]:
    twist = message.twist.twist
    return [((_seconds(message), twist.linear.x, twist.angular.z), "")]


def _placed(message: Any) -> list[Reading]:
    return [((_seconds(message), *_planar(message.pose)), "")]


def _placed_by_odometry(message: Any) -> list[Reading]:
    return [((_seconds(message), *_planar(message.pose.pose)), "")]


def _detected(message: Any) -> list[Reading]:
    """Position of each detection, with its most likely name."""
    readings: list[Reading] = []
    for detection in message.detections:
        if detection.results:
            best = max(detection.results, key=lambda result: result.hypothesis.score)
            place = best.pose.pose.position
            readings.append(((_seconds(message), place.x, place.y), best.hypothesis.class_id))
    return readings


def _seconds(message: Any) -> float:
    stamp = message.header.stamp
    # the quotient of integers is rounded only once
    return float((stamp.sec * 1_000_000_000 + stamp.nanosec) / 1_000_000_000)


def _planar(pose: Any) -> tuple[float, float, float]:
    """Position in m and heading in rad of a pose whose z axis points up."""
    q = pose.orientation
    heading = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2))
    return pose.position.x, pose.position.y, heading


_PLACES = ("time", "x", "y")

TOPICS: Mapping[str, TopicKind] = MappingProxyType(
    {
        "odom": TopicKind(
            ("time", "speed", "turn rate"),
            {ODOMETRY: _moved_by_odometry, "geometry_msgs/msg/TwistStamped": _moved},
        ),
        "sightings": TopicKind(_PLACES, {DETECTIONS: _detected}),
        "bearings": TopicKind(_PLACES, {DETECTIONS: _detected}),
        "ranges": TopicKind(_PLACES, {DETECTIONS: _detected}),
        "ground_truth": TopicKind(
            ("time", "x", "y", "heading"),
            {"geometry_msgs/msg/PoseStamped": _placed, ODOMETRY: _placed_by_odometry},
        ),
        "landmarks": TopicKind(_PLACES, {DETECTIONS: _detected}, of_robot=False),
    }
)
"""Kinds of topics that are read, by the last part of their name."""


# --- topics -------------------------------------------------------------------------------------


SUFFIXES = (".mcap", ".db3")
"""Suffixes of the files of bags."""

MOST_READINGS = 5_000_000
"""Most readings of all topics together."""

MOST_LISTED = 10
"""Most topics that a message names."""


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic that is read: its robot, "" if it has none, and its kind."""

    robot: str
    kind: str

    @property
    def name(self) -> str:
        """Name in the bag."""
        return f"/{self.robot}/{self.kind}" if self.robot else f"/{self.kind}"


@dataclass(frozen=True, slots=True)
class TopicReadings:
    """Readings of a topic in order of time: (k, c) numbers, and names of targets, "" if none."""

    numbers: Array
    names: tuple[str, ...]


def read_topics(path: Path, *, stamps: str = "header") -> dict[Topic, TopicReadings]:
    """Return the readings of a bag by topic; `path` is its folder or one file of it.

    `stamps` is "header", or "received" for times of receipt. Each robot has odometry. Raises
    InputError naming the topic and the message at fault, and if rosbags is missing.
    """
    found: dict[Topic, list[Reading]] = {}
    left = MOST_READINGS
    with _opened(path) as bag:
        topics = _topics_in(bag, path)
        wanted = [one for one in bag.connections if one.topic in topics]
        store = typestore()
        for connection, received_ns, raw in bag.messages(wanted):
            topic = topics[connection.topic]
            message = store.deserialize_cdr(raw, connection.msgtype)
            taken = TOPICS[topic.kind].taken[connection.msgtype](message)
            if stamps == "received":
                time_s = received_ns / 1_000_000_000
                taken = [((time_s, *numbers[1:]), name) for numbers, name in taken]
            found.setdefault(topic, []).extend(taken)
            left -= len(taken)
            if left < 0:
                problem = f"holds more than {MOST_READINGS} readings; record fewer topics"
                raise InputError(problem, source=str(path))
    return {topic: _in_order(topic, readings, path) for topic, readings in found.items()}


@contextmanager
def _opened(path: Path) -> Iterator["Reader"]:
    """Open a bag, whose faults raise InputError."""
    try:
        from rosbags.rosbag2 import Reader
    except ImportError as error:
        problem = "is a ROS 2 bag, which needs rosbags: pip install 'syncplan[export]'"
        raise InputError(problem, source=str(path)) from error
    if path.is_dir() and not (path / "metadata.yaml").exists():
        path = _only_file(path)
    try:
        _refuse_whole_files(path)
        with Reader(path) as bag:
            yield bag
    except InputError:
        raise
    except Exception as error:
        # a broken bag can raise any error, even MemoryError
        problem = f"can't be read as a ROS 2 bag: {str(error) or type(error).__name__}"
        raise InputError(problem, source=str(path)) from error


def _only_file(folder: Path) -> Path:
    """The only file of a bag without metadata.yaml, which several files would need."""
    files = [one for one in folder.iterdir() if one.suffix in SUFFIXES]
    if len(files) != 1:
        problem = f"holds no metadata.yaml; `ros2 bag reindex {folder.name}` writes it"
        raise InputError(problem, source=str(folder))
    return files[0]


def _refuse_whole_files(path: Path) -> None:
    """Raise InputError for a bag whose files are compressed whole: they may unpack to any size."""
    from ruamel.yaml import YAML

    if not path.is_dir():
        return
    described = YAML(typ="safe").load((path / "metadata.yaml").read_text())
    mode = described["rosbag2_bagfile_information"].get("compression_mode", "")
    if mode.lower() == "file":
        problem = "its files are compressed whole; write them plain with `ros2 bag convert`"
        raise InputError(problem, source=str(path))


def _topic_of(name: str) -> Topic | None:
    """Topic of a name; None if it is not read."""
    robot, _, last = name.strip("/").rpartition("/")
    kind = TOPICS.get(last)
    return Topic(robot, last) if kind and kind.of_robot == bool(robot) else None


def _topics_in(bag: "Reader", path: Path) -> dict[str, Topic]:
    """Topics to read, by name; raises InputError if one can't be read or lacks odometry."""
    topics: dict[str, Topic] = {}
    for connection in bag.connections:
        topic = _topic_of(connection.topic)
        if topic is None:
            continue
        source, types = f"{path}: {connection.topic}", TOPICS[topic.kind].taken
        if connection.msgtype not in types:
            problem = f"has messages {connection.msgtype}; allowed are {', '.join(types)}"
            raise InputError(problem, source=source)
        if name_problem(topic.robot or "-"):
            raise InputError(f"{topic.robot!r}: {name_problem(topic.robot)}", source=source)
        topics[connection.topic] = topic
    for name, topic in topics.items():
        odometry = Topic(topic.robot, "odom")
        if topic.robot and odometry not in topics.values():
            problem = f"is there without {odometry.name}; record both"
            raise InputError(problem, source=f"{path}: {name}")
    if not any(topic.robot for topic in topics.values()):
        there = listed(sorted({one.topic for one in bag.connections}), MOST_LISTED) or "none"
        problem = f"holds no topic /NAME/odom; its topics are {there}"
        raise InputError(problem, source=str(path))
    return topics


def _in_order(topic: Topic, readings: list[Reading], path: Path) -> TopicReadings:
    """Readings in order of time; raises InputError for a number out of range or not finite."""
    columns = TOPICS[topic.kind].columns
    numbers = np.array([one for one, _ in readings], np.float64).reshape(-1, len(columns))
    wrong = np.abs(numbers) > LARGEST_VALUE
    if not topic.robot:
        wrong |= np.isnan(numbers)
    if wrong.any():
        row, column = np.argwhere(wrong)[0].tolist()
        problem = (
            f"reading {row + 1}: {columns[column]} is {numbers[row, column]:g}; a finite number up "
            f"to {LARGEST_VALUE:g} is needed"
        )
        raise InputError(problem, source=f"{path}: {topic.name}")
    order = np.argsort(numbers[:, 0], kind="stable")
    return TopicReadings(numbers[order], tuple(readings[k][1] for k in order.tolist()))


# --- recordings ---------------------------------------------------------------------------------


SEEN = {"sightings": (True, True), "bearings": (True, False), "ranges": (False, True)}
"""Whether direction and distance were measured, by kind of topic."""


def holds_bag(path: Path) -> bool:
    """Return whether a file is a bag, or a folder holds one; raises OSError if it can't be read."""
    if path.is_dir():
        return any(one.name == "metadata.yaml" or one.suffix in SUFFIXES for one in path.iterdir())
    return path.suffix in SUFFIXES


def read_bag(path: Path, *, stamps: str = "header") -> Log:
    """Return the recording in a bag; `path` is its folder or one file of it.

    `stamps` is "header", or "received" for times of receipt. Raises InputError naming the topic
    and the reading at fault, and if rosbags is missing.
    """
    topics = read_topics(path, stamps=stamps)
    odometry = {topic.robot: one.numbers for topic, one in topics.items() if topic.kind == "odom"}
    truth = {
        topic.robot: one.numbers for topic, one in topics.items() if topic.kind == "ground_truth"
    }
    _check_odometry(odometry, truth, topics, path)
    landmarks = _landmarks(topics.get(Topic("", "landmarks")), odometry, path)
    team = NamedTeam.of(odometry, landmarks, str(path))
    seen = {}
    for robot in team.robots:
        parts = [
            _seen(topics[topic], topic, team, path)
            for topic in (Topic(robot, kind) for kind in SEEN)
            if topic in topics
        ]
        if parts:
            seen[robot] = _merged(parts)
    targets = Counter[str]()
    for topic, readings in topics.items():
        if topic.kind in SEEN:
            targets.update(readings.names)
    return team.log(path.resolve().name, odometry, seen, truth, team.notes_on(targets))


def _check_odometry(
    odometry: Container[str], truth: dict[str, Array], topics: Iterable[Topic], path: Path
) -> None:
    """Raise InputError if a robot has no odometry, or no truth where others have."""
    robots = sorted({topic.robot for topic in topics} - {""})
    if not robots:
        raise InputError("holds no messages of any robot", source=str(path))
    for robot in robots:
        if robot not in odometry:
            raise InputError("holds no messages", source=f"{path}: {Topic(robot, 'odom').name}")
        if truth and robot not in truth:
            problem = "holds no messages, but others have truth; record that of all, or of none"
            source = f"{path}: {Topic(robot, 'ground_truth').name}"
            raise InputError(problem, source=source)


def _landmarks(
    readings: TopicReadings | None, robots: Container[str], path: Path
) -> dict[str, tuple[float, float]]:
    """Positions by name; a landmark may occur many times, always at one position."""
    places: dict[str, tuple[float, float]] = {}
    if readings is None:
        return places
    for name, (_, x, y) in zip(readings.names, readings.numbers.tolist(), strict=True):
        problem = landmark_problem(name, robots)
        if places.setdefault(name, (x, y)) != (x, y):
            problem = "it is at two places; landmarks stay where they are"
        if problem:
            raise InputError(f"class_id is {name!r}; {problem}", source=f"{path}: /landmarks")
    return places


def _seen(readings: TopicReadings, topic: Topic, team: NamedTeam, path: Path) -> SeenBodies:
    """Sightings of a topic's robot; one of the robot itself counts as not recognised."""
    subjects = {name: number for name, number in team.subjects.items() if name != topic.robot}
    times, x, y = readings.numbers.T
    nowhere = (x == 0.0) & (y == 0.0)
    directions, distances = SEEN[topic.kind]
    if directions and nowhere.any():
        problem = f"reading {nowhere.argmax() + 1}: the target is where the robot is; no direction"
        raise InputError(problem, source=f"{path}: {topic.name}")
    not_measured = np.full(len(times), np.nan)
    return SeenBodies(
        times=times,
        subjects=np.array([subjects.get(name, NOBODY) for name in readings.names], np.int64),
        bearings=np.arctan2(y, x) if directions else not_measured,
        ranges=np.hypot(x, y) if distances else not_measured,
    )


def _merged(parts: list[SeenBodies]) -> SeenBodies:
    """Sightings of one robot from several topics, in order of time."""
    order = np.argsort(np.concatenate([one.times for one in parts]), kind="stable")
    return SeenBodies(*(np.concatenate(columns)[order] for columns in zip(*parts, strict=True)))
