"""Recordings as bytes that hold every bit of them: an .npz file of plain arrays."""

import io
import json
from typing import Any
from zipfile import BadZipFile

import numpy as np

from syncplan.errors import InputError
from syncplan.recordings.log import Log, RobotLog

_NUMBERS = ("truth", "odometry", "times", "subjects", "bearings", "ranges")


def pack_log(log: Log) -> bytes:
    """Return a recording as bytes, compressed."""
    words = {
        "name": log.name,
        "robots": [(robot.name, robot.subject) for robot in log.robots],
        "landmarks": log.landmark_names,
    }
    arrays: dict[str, Any] = {
        f"{name}_{k}": getattr(robot, name)
        for k, robot in enumerate(log.robots)
        for name in _NUMBERS
    }
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        **arrays,
        landmark_subjects=log.landmark_subjects,
        landmarks=log.landmarks,
        words=np.frombuffer(json.dumps(words).encode(), np.uint8),
    )
    return buffer.getvalue()


def unpack_log(data: bytes) -> Log:
    """Return the recording that `pack_log` turned into bytes; raises InputError for others."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            words = json.loads(stored["words"].tobytes())
            robots = tuple(
                RobotLog(name, subject, **{one: stored[f"{one}_{k}"] for one in _NUMBERS})
                for k, (name, subject) in enumerate(words["robots"])
            )
            return Log(
                name=words["name"],
                robots=robots,
                landmark_names=tuple(words["landmarks"]),
                landmark_subjects=stored["landmark_subjects"],
                landmarks=stored["landmarks"],
            )
    except (OSError, EOFError, BadZipFile, ValueError, KeyError) as error:
        raise InputError(f"not a recording: {error}", key="recording") from None
