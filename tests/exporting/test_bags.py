"""ROS 2 bags: read back by rosbags and by Foxglove's MCAP reader, they hold the plan."""

import io
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncplan.errors import InputError
from syncplan.exporting.formats import Export, ExportOptions, export, write_files
from syncplan.orbits.circles import heading, position
from tests.tools.exported import START, contents, mixed_team, team

TOPICS = ["/left/path", "/mid/path", "/far_out/path"]


def _read(bag: Path) -> dict[str, Any]:
    """The one message of each topic and when it was published, as rosbags reads them."""
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(bag) as reader:
        assert {one.msgtype for one in reader.connections} == {"nav_msgs/msg/Path"}
        return {
            connection.topic: (time, store.deserialize_cdr(raw, connection.msgtype))
            for connection, time, raw in reader.messages()
        }


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _exported(name: str, folder: Path, **options: Any) -> Export:
    made = export(mixed_team(), name, ExportOptions(**options))
    write_files(made, folder)
    return made


@pytest.mark.parametrize("name", ["rosbag2", "mcap"])
def test_the_paths_read_by_rosbags_are_the_plan(name: str, tmp_path: Path) -> None:
    _exported(name, tmp_path, altitude_m=12.5)
    plan, read = mixed_team(), _read(tmp_path / f"team_{name}")
    assert list(read) == TOPICS
    start = round(datetime.fromisoformat(START).timestamp() * 1000) * 1_000_000
    times = 0.1 * np.arange(1001)
    for k, (published, path) in enumerate(read.values()):
        assert published == _nanoseconds(path.header.stamp) == start
        assert {path.header.frame_id, *(one.header.frame_id for one in path.poses)} == {"map"}
        stamps = np.array([_nanoseconds(one.header.stamp) - start for one in path.poses])
        assert np.array_equal(stamps, np.rint(times * 1e9))
        points = [one.pose.position for one in path.poses]
        flown = np.array([[one.x, one.y] for one in points])
        assert np.abs(flown - position(plan.orbits, times)[:, k]).max() < 1e-9
        assert {one.z for one in points} == {12.5}
        turns = [one.pose.orientation for one in path.poses]
        yaw = np.array([2.0 * np.arctan2(one.z, one.w) for one in turns])
        off = np.exp(1j * yaw) - np.exp(1j * heading(plan.orbits, times)[:, k])
        assert np.abs(off).max() < 1e-9
        assert {(one.x, one.y) for one in turns} == {(0.0, 0.0)}


def test_foxglove_reads_the_mcap_as_rosbags_does(tmp_path: Path) -> None:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    made = _exported("mcap", tmp_path)
    (content,) = contents(made, ".mcap").values()
    ours = _read(tmp_path / "team_mcap")
    reader = make_reader(io.BytesIO(content), decoder_factories=[DecoderFactory()])
    read = {channel.topic: message for _, channel, _, message in reader.iter_decoded_messages()}
    assert sorted(read) == sorted(TOPICS)
    for topic, message in read.items():
        _, expected = ours[topic]
        assert len(message.poses) == len(expected.poses) == 1001
        for one, other in zip(message.poses, expected.poses, strict=True):
            assert one.pose.position.x == other.pose.position.x
            assert one.pose.orientation.z == other.pose.orientation.z
            assert one.header.stamp.nanosec == other.header.stamp.nanosec


@pytest.mark.parametrize("name", ["rosbag2", "mcap"])
def test_without_a_start_time_stamps_begin_at_zero(name: str, tmp_path: Path) -> None:
    write_files(export(team(start_time=None), name), tmp_path)
    for published, path in _read(tmp_path / f"team_{name}").values():
        assert published == _nanoseconds(path.header.stamp) == 0
        assert _nanoseconds(path.poses[1].header.stamp) == 100_000_000


@pytest.mark.parametrize("moment", ["1969-12-31T23:59:59Z", "2038-01-19T03:14:00Z"])
def test_moments_that_a_stamp_cannot_hold_are_refused(moment: str) -> None:
    with pytest.raises(InputError, match="from 1970 to 2038") as caught:
        export(team(start_time=moment), "mcap")
    assert caught.value.key == "start_time"


def test_too_many_poses_are_refused() -> None:
    for name in ("mcap", "csv"):
        with pytest.raises(InputError, match="makes 3,000,003 poses") as caught:
            export(mixed_team(), name, ExportOptions(sample_time_s=1e-4))
        assert caught.value.key == "sample_time_s"
