"""Paths over time: poses as CSV, ROS 2 bags of nav_msgs/Path, Crazyswarm2's polynomials.

A bag has one topic for each vehicle and is stored in SQLite or MCAP. Crazyswarm2 reads one CSV file
for each vehicle. A row is a piece of degree 7: its duration, then eight coefficients each of x, y,
z and yaw, lowest power first. Source: `uav_trajectory.py` of Crazyswarm2's package crazyflie_py.
"""

import csv
import io
import math
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.exporting.exported_files import ExportedFile, Written, ros_names
from syncplan.exporting.scheduled_plan import (
    Poses,
    ScheduledPlan,
    moment,
    places_of,
    sampled_poses,
    start_of,
)
from syncplan.orbits.circles import Orbits, heading, wrap

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")
"""What begins a cell that spreadsheets take for a formula."""


def write_poses(flown: ScheduledPlan) -> Written:
    """Return one row for each vehicle at each sample: time, name, x, y, z in m, heading in rad.

    `utc` follows if the scenario has a start_time, `lat_deg` and `lon_deg` if it has a geo_origin.
    Headings are in [-pi, pi). Raises InputError as sampled_poses does, and for a name that a
    spreadsheet would take for a formula.
    """
    for name in flown.names:
        if name.startswith(FORMULA):
            allowed = "its name must not begin with =, +, -, @, a tab or a line break"
            problem = f"{name!r} would be a formula in a spreadsheet; rename the vehicle: {allowed}"
            raise InputError(problem, key="formation")
    poses, start = sampled_poses(flown), start_of(flown.plan)
    places = places_of(flown, poses.positions)
    headings = wrap(poses.headings)
    stream = io.StringIO()
    rows = csv.writer(stream, lineterminator="\n")
    located = [] if places is None else ["lat_deg", "lon_deg"]
    dated = [] if start is None else ["utc"]
    rows.writerow(["time_s", "vehicle", "x_m", "y_m", "z_m", "heading_rad", *dated, *located])
    heights = [f"{altitude:.6f}" for altitude in flown.altitudes]
    for k, time in enumerate(poses.times.tolist()):
        when = [] if start is None else [moment(start, time)]
        for i, name in enumerate(flown.names):
            x, y = poses.positions[k, i].tolist()
            row = [f"{time:.6f}", name, f"{x:.6f}", f"{y:.6f}", heights[i], f"{headings[k, i]:.9f}"]
            where = [] if places is None else [f"{value:.9f}" for value in places[k, i].tolist()]
            rows.writerow([*row, *when, *where])
    name = f"{flown.title}.poses.csv"
    return Written(files=(ExportedFile(name, stream.getvalue().encode()),))


# --- ROS 2 bags ---------------------------------------------------------------------------------


FRAME = "map"
BAG_VERSION: Literal[8] = 8
"""Version of the bag's metadata: the oldest that rosbags writes, which most readers know."""

LAST_SECOND = 2**31 - 1
"""Last second of stamps, which hold signed 32-bit seconds."""

_NANO = 1_000_000_000
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def write_rosbag2(flown: ScheduledPlan) -> Written:
    """Return a bag in SQLite; see write_mcap."""
    return _write(flown, "SQLITE3", "rosbag2")


def write_mcap(flown: ScheduledPlan) -> Written:
    """Return a bag in MCAP: a folder with metadata.yaml and the messages.

    Topic /NAME/path holds one nav_msgs/Path in frame `map` (x east, y north, z up), published at
    the start, its poses stamped from start_time, or from 0 if the scenario has none. Raises
    InputError if rosbags is missing, and for times that a stamp can't hold.
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
    """Time 0 in nanoseconds since 1970; raises InputError if stamps can't hold the run."""
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


# --- polynomials --------------------------------------------------------------------------------


TOLERANCE_M = 1e-4
"""Largest distance between a piece and its arc: a tenth of the requirement."""

MOST_PIECES = 31
"""Most pieces in a Crazyflie's trajectory memory of 4,096 bytes (crtp_commander_high_level.h)."""

MOST_PIECES_WRITTEN = 200_000
"""Most pieces written for all vehicles together."""

FEWEST_PIECES = 2
"""Fewest pieces: loaders that rely on numpy.loadtxt alone read a table of one row as a vector."""

ORDER = 8

HEADER = ",".join(
    ["Duration", *(f"{axis}^{power}" for axis in ("x", "y", "z", "yaw") for power in range(ORDER))]
)


def write_crazyswarm(flown: ScheduledPlan) -> Written:
    """Return a trajectory file for each vehicle, in the plan's own frame, yaw along the path.

    Pieces join with continuous position, velocity, acceleration and jerk; yaw is exact and not
    wrapped.
    """
    orbits = flown.plan.orbits
    names = [f"{flown.title}-{label}.trajectory.csv" for label in flown.labels]
    files, longest = [], 0
    for k, name in enumerate(names):
        count = _piece_count(float(orbits.radii[k]), orbits.rate * flown.duration)
        longest = max(longest, count)
        if longest * orbits.count > MOST_PIECES_WRITTEN:
            raise InputError(
                f"{flown.duration:g}: makes trajectories of {longest:,} pieces; a Crazyflie holds "
                f"{MOST_PIECES}: give a shorter one",
                key="duration",
            )
        rows = arc_pieces(orbits, k, flown.duration, count, flown.altitudes[k])
        lines = [HEADER, *(",".join(f"{value:.12g}" for value in row) for row in rows.tolist())]
        files.append(ExportedFile(name, ("\n".join(lines) + "\n").encode()))
    notes = ["upload as absolute (not relative) trajectories, and start all at once from the entry"]
    if longest > MOST_PIECES:
        notes.append(
            f"trajectories of up to {longest} pieces: a Crazyflie holds {MOST_PIECES}; "
            "fly fewer turns, and the file again and again"
        )
    return Written(tuple(files), kind="trajectories", own_files=tuple(names), notes=tuple(notes))


def arc_pieces(orbits: Orbits, k: int, duration: float, count: int, altitude: float) -> Array:
    """Return (count, 33) rows of vehicle k: duration in s, then coefficients in m, rad and s.

    Each piece meets the circle in position, velocity, acceleration and jerk at both ends. A
    polynomial of degree 7 that does so is off by at most R (delta / 2)^8 / 8! on each axis, with
    delta the angle of the piece (error of Hermite interpolation).
    """
    step = duration / count
    rate = orbits.senses[k] * orbits.rate
    phases = orbits.phases[k] + rate * step * np.arange(count)
    rows = np.zeros((count, 1 + 4 * ORDER))
    rows[:, 0] = step
    for axis, shift in enumerate((0.0, -np.pi / 2.0)):
        arc = _hermite(phases + shift, rate * step) * orbits.radii[k]
        arc[:, 0] += orbits.centers[k, axis]
        rows[:, 1 + axis * ORDER : 1 + (axis + 1) * ORDER] = arc / step ** np.arange(ORDER)
    rows[:, 1 + 2 * ORDER] = altitude
    rows[:, 1 + 3 * ORDER] = heading(orbits, step * np.arange(count))[:, k]
    rows[:, 2 + 3 * ORDER] = rate
    return rows


def _piece_count(radius: float, angle: float) -> int:
    """Fewest pieces of an arc of `angle` rad within TOLERANCE_M, each at most a third of a turn."""
    half = math.pow(TOLERANCE_M * math.factorial(ORDER) / radius, 1.0 / ORDER)
    return max(FEWEST_PIECES, math.ceil(angle / min(2.0 * half, 2.0 * math.pi / 3.0) - 1e-9))


def _hermite(phases: Array, angle: float) -> Array:
    """(k, 8) coefficients in s on [0, 1] that fit cos(phase + angle s) to third order at both ends.

    The first four are Taylor's; the others fit the derivatives at s = 1.
    """
    powers = np.arange(ORDER)
    derivatives = np.arange(4)
    start = _cosine_derivatives(phases, angle)
    end = _cosine_derivatives(phases + angle, angle)
    # falling[j, p]: the j-th derivative of s^p at s = 1
    falling = np.array([[math.perm(int(p), int(j)) for p in powers] for j in derivatives], float)
    low = start / np.array([math.factorial(int(j)) for j in derivatives])
    high = np.linalg.solve(falling[:, 4:], (end - low @ falling[:, :4].T).T).T
    return np.hstack([low, high])


def _cosine_derivatives(phases: Array, angle: float) -> Array:
    """(k, 4) derivatives by s, of order 0 to 3, of cos(phase + angle s) at s = 0."""
    order = np.arange(4)
    return np.asarray(np.cos(phases[:, None] + order * np.pi / 2.0) * angle**order)
