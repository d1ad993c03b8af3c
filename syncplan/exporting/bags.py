"""ROS 2 bags of nav_msgs/Path, one topic for each vehicle, stored in SQLite or MCAP."""

import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from syncplan.errors import InputError
from syncplan.exporting.exported_files import ExportedFile, Written
from syncplan.exporting.safe_names import ros_names
from syncplan.exporting.scheduled_plan import Poses, ScheduledPlan, sampled_poses, start_of

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

FRAME = "map"
BAG_VERSION: Literal[8] = 8
"""Of the bag's metadata: the oldest that rosbags writes, so that the most readers know it."""

LAST_SECOND = 2**31 - 1
"""Stamps hold signed 32-bit seconds."""

_NANO = 1_000_000_000
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def write_rosbag2(flown: ScheduledPlan) -> Written:
    """Return a bag in SQLite; see write_mcap."""
    return _write(flown, "SQLITE3", "rosbag2")


def write_mcap(flown: ScheduledPlan) -> Written:
    """Return a bag in MCAP: a folder with metadata.yaml and the messages.

    Topic /NAME/path holds one nav_msgs/Path in frame `map` (x east, y north, z up), published at
    the start, its poses stamped from start_time, or from 0 where the scenario has none. Raises
    InputError where rosbags is missing, and for times that a stamp can't hold.
    """
    return _write(flown, "MCAP", "mcap")


def _write(flown: ScheduledPlan, storage: str, kind: str) -> Written:
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InputError("needs rosbags: pip install 'syncplan[export]'") from error
    poses, start = sampled_poses(flown), _start(flown)
    store = get_typestore(Stores.ROS2_HUMBLE)
    topics = tuple(f"/{token}/path" for token in ros_names(flown.names))
    with tempfile.TemporaryDirectory(prefix="syncplan-") as folder:
        # the bag's own name is in its metadata
        bag = Path(folder) / f"{flown.title}_{kind}"
        with Writer(bag, version=BAG_VERSION, storage_plugin=StoragePlugin[storage]) as writer:
            for k, topic in enumerate(topics):
                message = _path(store, poses, k, start, flown.altitudes[k])
                raw = store.serialize_cdr(message, message.__msgtype__)
                to = writer.add_connection(topic, message.__msgtype__, typestore=store)
                writer.write(to, start, raw)
        files = tuple(
            ExportedFile(f"{bag.name}/{path.name}", path.read_bytes())
            for path in sorted(bag.iterdir())
        )
    note = (
        "each topic has one message: play the bag with transient-local durability, or listen first"
    )
    return Written(files, topics=topics, notes=(note,))


def _start(flown: ScheduledPlan) -> int:
    """Time 0 in nanoseconds since 1970. Raises InputError if the run is not within the stamps."""
    start = start_of(flown.plan)
    if start is None:
        return 0
    since = start - _EPOCH
    nanoseconds = (since.days * 86_400 + since.seconds) * _NANO + since.microseconds * 1000
    if nanoseconds < 0 or nanoseconds / _NANO + flown.duration > LAST_SECOND:
        raise InputError(
            f"{flown.plan.scenario.start_time}: stamps of ROS messages go from 1970 to 2038-01-19",
            key="start_time",
        )
    return nanoseconds


def _path(store: "Typestore", poses: Poses, k: int, start: int, altitude: float) -> Any:
    """The nav_msgs/Path of vehicle k."""
    types = store.types
    time = types["builtin_interfaces/msg/Time"]
    header = types["std_msgs/msg/Header"]
    pose = types["geometry_msgs/msg/Pose"]
    stamped = types["geometry_msgs/msg/PoseStamped"]
    point = types["geometry_msgs/msg/Point"]
    quaternion = types["geometry_msgs/msg/Quaternion"]
    half = poses.headings[:, k] / 2.0
    stamps = [divmod(start + nano, _NANO) for nano in np.rint(poses.times * _NANO).astype(int)]
    positions = poses.positions[:, k].tolist()
    turns = zip(np.cos(half).tolist(), np.sin(half).tolist(), strict=True)
    return types["nav_msgs/msg/Path"](
        header(time(*divmod(start, _NANO)), FRAME),
        [
            stamped(
                header(time(int(second), int(nano)), FRAME),
                pose(point(x, y, altitude), quaternion(0.0, 0.0, sin, cos)),
            )
            for (second, nano), (x, y), (cos, sin) in zip(stamps, positions, turns, strict=True)
        ],
    )
