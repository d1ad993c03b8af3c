"""Recordings whose robots and landmarks have names: who is who, and the log made of it."""

import re
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.errors import InputError
from syncplan.recordings.log import Log, RobotLog
from syncplan.recordings.recorded_files import MOST_ROBOTS, name_problem

RESERVED = ("all", "none")
"""Words that stand for landmarks where one is chosen."""


class SeenBodies(NamedTuple):
    """Sightings of one robot, by time: as in a RobotLog."""

    times: Array
    subjects: Index
    bearings: Array
    ranges: Array


@dataclass(frozen=True, slots=True)
class NamedTeam:
    """Robots, in order of their names, and landmarks; robots are subjects 1 to n, landmarks follow.

    Attributes
    ----------
    robots : names
    landmarks : places in m, by name
    """

    robots: tuple[str, ...]
    landmarks: Mapping[str, tuple[float, float]]

    @classmethod
    def of(
        cls, robots: Iterable[str], landmarks: Mapping[str, tuple[float, float]], source: str
    ) -> "NamedTeam":
        """Return the team; raises InputError where there are too many robots."""
        ordered = tuple(sorted(robots, key=_by_number))
        if len(ordered) > MOST_ROBOTS:
            problem = f"holds {len(ordered)} robots, more than {MOST_ROBOTS}"
            raise InputError(problem, source=source)
        return cls(ordered, dict(landmarks))

    @property
    def subjects(self) -> dict[str, int]:
        """Numbers of robots and landmarks by name."""
        return {name: number for number, name in enumerate((*self.robots, *self.landmarks), 1)}

    def log(
        self,
        name: str,
        odometry: Mapping[str, Array],
        seen: Mapping[str, SeenBodies],
        truth: Mapping[str, Array],
    ) -> Log:
        """Return the recording, of what each robot read and where it was, as in a RobotLog."""
        nothing = SeenBodies(np.zeros(0), np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
        unknown = np.zeros((0, 4))
        robots = tuple(
            RobotLog(
                robot,
                number,
                truth.get(robot, unknown),
                odometry[robot],
                **seen.get(robot, nothing)._asdict(),
            )
            for number, robot in enumerate(self.robots, 1)
        )
        count = len(self.robots)
        return Log(
            name=name,
            robots=robots,
            landmark_names=tuple(self.landmarks),
            landmark_subjects=count + 1 + np.arange(len(self.landmarks), dtype=np.int64),
            landmarks=np.array(list(self.landmarks.values()), np.float64).reshape(-1, 2),
        )


def landmark_problem(name: str, robots: Container[str]) -> str:
    """Return the fault of a landmark's name beside robots, or "" if there is none."""
    if name in robots:
        return "a robot has this name as well"
    if name in RESERVED:
        return "it stands for landmarks where some are chosen"
    return name_problem(name)


def _by_number(name: str) -> list[str]:
    """A key that sorts robot2 before robot10."""
    return [part.zfill(20) if part.isdigit() else part for part in re.split(r"(\d+)", name)]
