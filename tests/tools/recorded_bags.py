"""Recordings written as ROS 2 bags, as robots would have recorded them."""

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from syncplan.recordings.log import Log
from syncplan.recordings.ros_bags import DETECTIONS, typestore
from tests.tools.recordings import names_of

Message = tuple[str, float, Any]
"""A topic, a time in s, and what is said on it then."""

NANO = 1_000_000_000


class BagMessages:
    """Messages of the types that recordings need; with `empty_stamps`, all are of time 0."""

    def __init__(self, *, empty_stamps: bool = False) -> None:
        self._types = typestore().types
        self._pace = 0 if empty_stamps else NANO

    def detections(
        self, time: float, seen: Iterable[tuple[str, float, float]], *, others: bool = False
    ) -> Any:
        """Names at places (x, y) in m; with `others`, each beside a likelier-looking stranger."""
        found = []
        for name, x, y in seen:
            results = [self._hypothesis(name, 0.9, x, y)]
            if others:
                results.insert(0, self._hypothesis("a stranger", 0.1, 0.0, 0.0))
            box = self._new("vision_msgs/msg/BoundingBox3D", self._pose(x, y, 0.0), self._vector())
            detection = "vision_msgs/msg/Detection3D"
            found.append(self._new(detection, self._header(time), results, box, ""))
        return self._new(DETECTIONS, self._header(time), found)

    def odometry(self, time: float, speed: float, turn: float, pose: Any = None) -> Any:
        """A nav_msgs/Odometry."""
        twist = self._new("geometry_msgs/msg/TwistWithCovariance", self._twist(speed, turn), _NONE)
        place = pose or self._pose(0.0, 0.0, 0.0)
        return self._new(
            "nav_msgs/msg/Odometry",
            self._header(time),
            "base_link",
            self._new("geometry_msgs/msg/PoseWithCovariance", place, _NONE),
            twist,
        )

    def twist(self, time: float, speed: float, turn: float) -> Any:
        """A geometry_msgs/TwistStamped."""
        twist = self._twist(speed, turn)
        return self._new("geometry_msgs/msg/TwistStamped", self._header(time), twist)

    def placed(self, time: float, x: float, y: float, heading: float) -> Any:
        """A geometry_msgs/PoseStamped."""
        pose = self._pose(x, y, heading)
        return self._new("geometry_msgs/msg/PoseStamped", self._header(time), pose)

    def placed_by_odometry(self, time: float, x: float, y: float, heading: float) -> Any:
        """A nav_msgs/Odometry that states a pose."""
        return self.odometry(time, 0.0, 0.0, self._pose(x, y, heading))

    def _hypothesis(self, name: str, score: float, x: float, y: float) -> Any:
        pose = self._new("geometry_msgs/msg/PoseWithCovariance", self._pose(x, y, 0.0), _NONE)
        guess = self._new("vision_msgs/msg/ObjectHypothesis", name, score)
        return self._new("vision_msgs/msg/ObjectHypothesisWithPose", guess, pose)

    def _pose(self, x: float, y: float, heading: float) -> Any:
        half = heading / 2.0
        return self._new(
            "geometry_msgs/msg/Pose",
            self._new("geometry_msgs/msg/Point", x, y, 0.5),
            self._new("geometry_msgs/msg/Quaternion", 0.0, 0.0, np.sin(half), np.cos(half)),
        )

    def _twist(self, speed: float, turn: float) -> Any:
        return self._new("geometry_msgs/msg/Twist", self._vector(x=speed), self._vector(z=turn))

    def _vector(self, x: float = 0.0, z: float = 0.0) -> Any:
        return self._new("geometry_msgs/msg/Vector3", x, 0.0, z)

    def _header(self, time: float) -> Any:
        stamp = self._new(
            "builtin_interfaces/msg/Time", *divmod(round(Fraction(time) * self._pace), NANO)
        )
        return self._new("std_msgs/msg/Header", stamp, "map")

    def _new(self, name: str, *values: Any) -> Any:
        return self._types[name](*values)


_NONE = np.zeros(36)


def write_bag(log: Log, folder: Path, storage: str = "MCAP", *, empty_stamps: bool = False) -> Path:
    """Write a recording as a bag; return its folder. Times of receipt are those of the log."""
    return write_messages(folder, _messages(log, BagMessages(empty_stamps=empty_stamps)), storage)


def write_messages(folder: Path, messages: Iterable[Message], storage: str = "MCAP") -> Path:
    """Write messages as a bag; return its folder."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    store = typestore()
    connections: dict[tuple[str, str], Any] = {}
    with Writer(folder, version=8, storage_plugin=StoragePlugin[storage]) as writer:
        for topic, time, message in messages:
            key = (topic, message.__msgtype__)
            if key not in connections:
                connections[key] = writer.add_connection(*key, typestore=store)
            raw = store.serialize_cdr(message, message.__msgtype__)
            writer.write(connections[key], round(Fraction(time) * NANO), raw)
    return folder


def _messages(log: Log, of: BagMessages) -> list[Message]:
    names = names_of(log)
    begin = min(float(robot.odometry[0, 0]) for robot in log.robots)
    fixed = [
        (str(name), *place)
        for name, place in zip(log.landmark_names, log.landmarks.tolist(), strict=True)
    ]
    # published twice, as by a node that is started again
    messages: list[Message] = [
        ("/landmarks", begin, of.detections(begin, fixed)),
        ("/landmarks", begin + 1.0, of.detections(begin, fixed[:1])),
    ]
    for number, robot in enumerate(log.robots):
        moved = of.twist if number == 1 else of.odometry
        stood = of.placed_by_odometry if number == 1 else of.placed
        for row in robot.odometry.tolist():
            messages.append((f"/{robot.name}/odom", row[0], moved(*row)))
        for row in robot.truth.tolist():
            messages.append((f"/{robot.name}/ground_truth", row[0], stood(*row)))
        for time, subject, bearing, away in zip(
            robot.times.tolist(),
            robot.subjects.tolist(),
            robot.bearings.tolist(),
            robot.ranges.tolist(),
            strict=True,
        ):
            name = names.get(subject, "a passer-by")
            kind, reach, turn = "sightings", away, bearing
            if np.isnan(away):
                kind, reach = "bearings", 7.0
            elif np.isnan(bearing):
                kind, turn = "ranges", 0.3
            at = (name, reach * np.cos(turn), reach * np.sin(turn))
            seen = of.detections(time, [at], others=True)
            messages.append((f"/{robot.name}/{kind}", time, seen))
    # recorded in the order of arrival
    return sorted(messages, key=lambda message: message[1])
