"""ROS 2 bags, in SQLite or MCAP: the readings of the topics that count."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.phrases import listed
from syncplan.recordings.recorded_files import LARGEST_VALUE, name_problem
from syncplan.recordings.ros_messages import TOPICS, Reading, typestore

if TYPE_CHECKING:
    from rosbags.rosbag2 import Reader

SUFFIXES = (".mcap", ".db3")
"""Of files of bags."""

MOST_READINGS = 5_000_000
"""Most readings of all topics together."""

MOST_LISTED = 10
"""Most topics that a message names."""


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic that counts: whose it is, "" where nobody's, and of which kind."""

    robot: str
    kind: str

    @property
    def name(self) -> str:
        """As in the bag."""
        return f"/{self.robot}/{self.kind}" if self.robot else f"/{self.kind}"


@dataclass(frozen=True, slots=True)
class TopicReadings:
    """What a topic holds, in order of time: numbers (k, c), and names where it names something."""

    numbers: Array
    names: tuple[str, ...]


def read_topics(path: Path) -> dict[Topic, TopicReadings]:
    """Return what a bag, its folder or one file of it, holds of the topics that count.

    Each robot has odometry. Raises InputError naming the topic and the message at fault, and where
    rosbags is missing.
    """
    found: dict[Topic, list[Reading]] = {}
    left = MOST_READINGS
    with _opened(path) as bag:
        topics = _topics_in(bag, path)
        wanted = [one for one in bag.connections if one.topic in topics]
        store = typestore()
        for connection, _, raw in bag.messages(wanted):
            topic = topics[connection.topic]
            message = store.deserialize_cdr(raw, connection.msgtype)
            taken = TOPICS[topic.kind].taken[connection.msgtype](message)
            found.setdefault(topic, []).extend(taken)
            left -= len(taken)
            if left < 0:
                problem = f"holds more than {MOST_READINGS} readings; record fewer topics"
                raise InputError(problem, source=str(path))
    return {topic: _in_order(topic, readings, path) for topic, readings in found.items()}


@contextmanager
def _opened(path: Path) -> Iterator["Reader"]:
    """The bag, whose faults raise InputError."""
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
        # a broken bag raises whatever its bytes lead to, lack of memory among it
        problem = f"can't be read as a ROS 2 bag: {str(error) or type(error).__name__}"
        raise InputError(problem, source=str(path)) from error


def _only_file(folder: Path) -> Path:
    """The file of a bag without metadata.yaml, which says how several belong together."""
    files = [one for one in folder.iterdir() if one.suffix in SUFFIXES]
    if len(files) != 1:
        problem = f"holds no metadata.yaml; `ros2 bag reindex {folder.name}` writes it"
        raise InputError(problem, source=str(folder))
    return files[0]


def _refuse_whole_files(path: Path) -> None:
    """Raise InputError for a bag whose files are compressed whole: they may be of any size."""
    from ruamel.yaml import YAML

    if not path.is_dir():
        return
    described = YAML(typ="safe").load((path / "metadata.yaml").read_text())
    mode = described["rosbag2_bagfile_information"].get("compression_mode", "")
    if mode.lower() == "file":
        problem = "its files are compressed whole; write them plain with `ros2 bag convert`"
        raise InputError(problem, source=str(path))


def _topic_of(name: str) -> Topic | None:
    """The topic of a name; None if it does not count."""
    robot, _, last = name.strip("/").rpartition("/")
    kind = TOPICS.get(last)
    return Topic(robot, last) if kind and kind.of_robot == bool(robot) else None


def _topics_in(bag: "Reader", path: Path) -> dict[str, Topic]:
    """Topics that count, by name; raises InputError if one can't be read, or lacks odometry."""
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
    """The readings by time; raises InputError for a number that can't be."""
    columns = TOPICS[topic.kind].columns
    numbers = np.array([one for one, _ in readings], np.float64).reshape(-1, len(columns))
    wrong = ~(np.abs(numbers) <= LARGEST_VALUE)
    if wrong.any():
        row, column = np.argwhere(wrong)[0].tolist()
        problem = (
            f"reading {row + 1}: {columns[column]} is {numbers[row, column]:g}; a finite number up "
            f"to {LARGEST_VALUE:g} is needed"
        )
        raise InputError(problem, source=f"{path}: {topic.name}")
    order = np.argsort(numbers[:, 0], kind="stable")
    return TopicReadings(numbers[order], tuple(readings[k][1] for k in order.tolist()))
