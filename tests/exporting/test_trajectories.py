"""Trajectories of Crazyswarm2 and ROS 2 bags: read as others read them, they are the plan."""

import io
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.errors import InputError
from syncplan.exporting.formats import ExportOptions, export, write_files
from syncplan.exporting.trajectories import TOLERANCE_M, arc_pieces
from syncplan.orbits.circles import Orbits, heading, position
from tests.tools.exported import START, contents, mixed_team, team


def _rows(text: bytes) -> Any:
    # what uav_trajectory.py reads: a header, then the first 33 columns
    return np.loadtxt(io.StringIO(text.decode()), delimiter=",", skiprows=1, usecols=range(33))


def _flown(rows: Any, times: Any, kind: Any = np.float64) -> Any:
    """(k, 4) of x, y, z, yaw: each piece from its own time 0 by Horner's rule."""
    rows = np.atleast_2d(rows)
    ends = np.cumsum(rows[:, 0])
    piece = np.minimum(np.searchsorted(ends, times), len(rows) - 1)
    since = (times - (ends - rows[:, 0])[piece]).astype(kind)
    coefficients = rows[piece, 1:].reshape(-1, 4, 8).astype(kind)
    value = np.zeros((len(times), 4), dtype=kind)
    for power in reversed(range(8)):
        value = value * since[:, None] + coefficients[:, :, power]
    return value


@pytest.mark.parametrize("kind", [np.float64, np.float32], ids=["exactly", "as on board"])
def test_trajectories_stay_within_a_millimetre_of_the_circles(kind: Any) -> None:
    plan = mixed_team()
    made = export(plan, "crazyswarm", ExportOptions(altitude_m=1.25))
    duration = plan.scenario.duration_s
    times = np.linspace(0.0, duration, 20_001)
    for k, text in enumerate(contents(made, ".csv").values()):
        rows = _rows(text)
        assert rows[:, 0].sum() == pytest.approx(duration, abs=1e-8)
        flown = _flown(rows, times, kind)
        off = np.hypot(*(flown[:, :2] - position(plan.orbits, times)[:, k]).T)
        assert off.max() < 1e-3
        assert np.abs(flown[:, 2] - 1.25).max() == 0.0
        assert np.abs(flown[:, 3] - heading(plan.orbits, times)[:, k]).max() < 1e-5


def test_pieces_join_up_to_their_third_derivative() -> None:
    for text in contents(export(mixed_team(), "crazyswarm"), ".csv").values():
        rows = _rows(text)
        for axis in range(4):
            pieces = [np.polynomial.Polynomial(row[1 + 8 * axis : 9 + 8 * axis]) for row in rows]
            for before, after, step in zip(pieces, pieces[1:], rows[:, 0], strict=False):
                for order in range(4):
                    end, start = before.deriv(order)(step), after.deriv(order)(0.0)
                    assert end == pytest.approx(start, abs=1e-8)


@given(
    st.floats(0.1, 1000.0), st.floats(0.05, 3.0), st.floats(0.0, 6.3), st.sampled_from([-1.0, 1.0])
)
def test_a_piece_is_off_by_no_more_than_hermites_bound(
    radius: float, angle: float, phase: float, sense: float
) -> None:
    orbits = Orbits(
        np.zeros((1, 2)), np.array([radius]), np.array([sense]), np.array([phase]), angle
    )
    rows = arc_pieces(orbits, 0, 1.0, 1, 0.0)
    times = np.linspace(0.0, 1.0, 101)
    off = np.abs(_flown(rows, times)[:, :2] - position(orbits, times)[:, 0]).max()
    assert off <= radius * (angle / 2.0) ** 8 / 40320.0 + 1e-9 * radius


def test_no_fewer_pieces_would_do() -> None:
    plan = mixed_team()
    for k, text in enumerate(contents(export(plan, "crazyswarm"), ".csv").values()):
        count = len(_rows(text)) - 1
        rows = arc_pieces(plan.orbits, k, 100.0, count, 0.0)
        times = np.linspace(0.0, 100.0, 20_001)
        off = np.abs(_flown(rows, times)[:, :2] - position(plan.orbits, times)[:, k]).max()
        assert off > 0.9 * TOLERANCE_M


def test_a_short_trajectory_is_still_a_table() -> None:
    made = export(mixed_team(), "crazyswarm", ExportOptions(duration=0.5))
    assert all(_rows(text).shape == (2, 33) for text in contents(made, ".csv").values())


def test_more_pieces_than_a_crazyflie_holds_are_reported_or_refused() -> None:
    assert any(
        "a Crazyflie holds 31" in one for one in export(team(duration_s=500.0), "crazyswarm").notes
    )
    assert not any("a Crazyflie" in one for one in export(mixed_team(), "crazyswarm").notes)
    with pytest.raises(InputError, match=r"^duration: .*give a shorter one"):
        export(mixed_team(), "crazyswarm", ExportOptions(duration=600_000.0))


# --- ROS 2 bags -----------------------------------------------------------------------------------


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


@pytest.mark.parametrize("name", ["rosbag2", "mcap"])
def test_the_paths_read_by_rosbags_are_the_plan(name: str, tmp_path: Path) -> None:
    write_files(export(mixed_team(), name, ExportOptions(altitude_m=12.5)), tmp_path)
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

    made = export(mixed_team(), "mcap")
    write_files(made, tmp_path)
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
    with pytest.raises(InputError, match=r"^start_time: .*from 1970 to 2038"):
        export(team(start_time=moment), "mcap")


def test_too_many_poses_are_refused() -> None:
    for name in ("mcap", "csv"):
        with pytest.raises(InputError, match=r"^sample_time_s: .*makes 3,000,003 poses"):
            export(mixed_team(), name, ExportOptions(sample_time_s=1e-4))
