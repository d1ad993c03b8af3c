"""What is worth knowing of a recording before it is used."""

from dataclasses import dataclass

import numpy as np

from syncplan.recordings.log import Log


@dataclass(frozen=True, slots=True)
class Overview:
    """A recording in short.

    Attributes
    ----------
    name, robots, landmarks : names; numbers where the layout numbers landmarks
    begin_s, duration_s : s, of the odometry, by the recording's clock
    bearings, distances : number of readings that have them
    has_truth : whether it is recorded where every robot truly was
    """

    name: str
    robots: tuple[str, ...]
    landmarks: tuple[int | str, ...]
    begin_s: float
    duration_s: float
    bearings: int
    distances: int
    has_truth: bool


def overview_of(log: Log) -> Overview:
    """Return a recording in short."""
    begin = min(float(robot.odometry[0, 0]) for robot in log.robots)
    end = max(float(robot.odometry[-1, 0]) for robot in log.robots)
    return Overview(
        name=log.name,
        robots=tuple(robot.name for robot in log.robots),
        landmarks=log.landmark_names,
        begin_s=begin,
        duration_s=end - begin,
        bearings=sum(int(np.isfinite(robot.bearings).sum()) for robot in log.robots),
        distances=sum(int(np.isfinite(robot.ranges).sum()) for robot in log.robots),
        has_truth=log.has_truth,
    )
