"""What a recording holds, whatever layout it came in."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.errors import InputError
from syncplan.phrases import listed

NOBODY = -1
"""Subject of a reading that belongs to no subject."""

MOST_LISTED = 20
"""Most landmarks that a message names."""


@dataclass(frozen=True, slots=True)
class RobotLog:
    """The recording of one robot; times in s never decrease.

    Attributes
    ----------
    name : in reports
    subject : its number, which no other robot and no landmark has
    truth : (k, 4) time s, x m, y m, heading rad; no rows where it is not known
    odometry : (k, 3) time s, speed m/s, turn rate rad/s
    times, subjects, bearings, ranges : (s,) s; number of the subject seen, NOBODY where unknown;
        rad and m, NaN where not recorded
    """

    name: str
    subject: int
    truth: Array
    odometry: Array
    times: Array
    subjects: Index
    bearings: Array
    ranges: Array


@dataclass(frozen=True, slots=True)
class Log:
    """A recording of n robots among m landmarks.

    Attributes
    ----------
    name : of the folder or file
    robots : n of them, in order
    landmark_names : m of them; numbers where the layout has no other names
    landmark_subjects : (m,) the numbers by which they are seen
    landmarks : (m, 2) m
    """

    name: str
    robots: tuple[RobotLog, ...]
    landmark_names: tuple[int | str, ...]
    landmark_subjects: Index
    landmarks: Array

    @property
    def has_truth(self) -> bool:
        """Whether it is recorded where every robot truly was."""
        return all(len(robot.truth) for robot in self.robots)

    def landmark_places(self, names: Iterable[int | str] | None) -> Index:
        """Return the places of the named landmarks among all, in their order; of all if None.

        Raises InputError naming one that there is not.
        """
        return np.array(chosen_landmarks(self.landmark_names, names), dtype=np.int64)


def chosen_landmarks(known: Iterable[int | str], names: Iterable[int | str] | None) -> list[int]:
    """Return the places of the named landmarks among those known, in their order; all if None.

    Raises InputError naming one that there is not.
    """
    all_names = dict.fromkeys(known)
    wanted = dict.fromkeys(all_names if names is None else names)
    for name in wanted:
        if name not in all_names:
            there = listed([str(one) for one in all_names], MOST_LISTED) or "none"
            raise InputError(f"no landmark {name!r}; there are {there}", key="landmarks")
    return [place for place, name in enumerate(all_names) if name in wanted]
