"""Recordings as ROS 2 bags, in SQLite or MCAP.

    /NAME/odom           nav_msgs/Odometry or geometry_msgs/TwistStamped, of which the twist is read
    /NAME/sightings      vision_msgs/Detection3DArray: class_id names what was seen, the pose says
                         where, seen from the robot: x ahead, y to the left
    /NAME/bearings       the same where only the direction was measured
    /NAME/ranges         the same where only the distance was
    /NAME/ground_truth   geometry_msgs/PoseStamped or nav_msgs/Odometry, of which the pose is read
    /landmarks           vision_msgs/Detection3DArray: names, and places on the ground

Times are those of the messages' headers. Targets that are neither robots nor landmarks count as
not recognised: detectors also report other things.
"""

from collections.abc import Container, Iterable
from pathlib import Path

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.recordings.log import NOBODY, Log
from syncplan.recordings.named_teams import NamedTeam, SeenBodies, landmark_problem
from syncplan.recordings.ros_bags import SUFFIXES, Topic, TopicReadings, read_topics

SEEN = {"sightings": (True, True), "bearings": (True, False), "ranges": (False, True)}
"""Whether direction and distance were measured, by the kind of topic."""


def holds_bag(path: Path) -> bool:
    """Return whether a file is a bag, or a folder holds one; raises OSError if it can't be read."""
    if path.is_dir():
        return any(one.name == "metadata.yaml" or one.suffix in SUFFIXES for one in path.iterdir())
    return path.suffix in SUFFIXES


def read_bag(path: Path) -> Log:
    """Return the recording in a bag, its folder or one file of it.

    Raises InputError naming the topic and the reading at fault, and where rosbags is missing.
    """
    topics = read_topics(path)
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
    return team.log(path.resolve().name, odometry, seen, truth)


def _check_odometry(
    odometry: Container[str], truth: dict[str, Array], topics: Iterable[Topic], path: Path
) -> None:
    """Raise InputError if a robot has no odometry, or no truth where others have."""
    robots = sorted({topic.robot for topic in topics} - {""})
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
    """Places by name; each may be there many times, at one place."""
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
    """What a topic says that its robot saw; a robot that sees itself was mistaken."""
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
    """What one robot saw, of several topics, in order of time."""
    order = np.argsort(np.concatenate([one.times for one in parts]), kind="stable")
    return SeenBodies(
        times=np.concatenate([one.times for one in parts])[order],
        subjects=np.concatenate([one.subjects for one in parts])[order],
        bearings=np.concatenate([one.bearings for one in parts])[order],
        ranges=np.concatenate([one.ranges for one in parts])[order],
    )
