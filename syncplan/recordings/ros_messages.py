"""Messages of ROS 2 that hold what a recording needs, and what is taken from each.

Only these types are read, by definitions that stand here or come with rosbags: those that a bag
brings along would be compiled to code.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

Reading = tuple[tuple[float, ...], str]
"""Numbers, of which the first is a time in s, and the name of what was seen."""

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
"""As of vision_msgs 4, since ROS 2 Humble."""


@dataclass(frozen=True, slots=True)
class TopicKind:
    """What a topic holds.

    Attributes
    ----------
    columns : what the numbers of a reading are
    taken : what is taken from a message, by its type
    of_robot : whether each robot has its own
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
    """The place of each detection, with its likeliest name."""
    readings: list[Reading] = []
    for detection in message.detections:
        if detection.results:
            best = max(detection.results, key=lambda result: result.hypothesis.score)
            place = best.pose.pose.position
            readings.append(((_seconds(message), place.x, place.y), best.hypothesis.class_id))
    return readings


def _seconds(message: Any) -> float:
    stamp = message.header.stamp
    # the quotient of whole numbers is rounded once
    return float((stamp.sec * 1_000_000_000 + stamp.nanosec) / 1_000_000_000)


def _planar(pose: Any) -> tuple[float, float, float]:
    """Place in m and heading in rad, of a pose whose z axis is up."""
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
"""Topics that count, by the last part of their name."""
