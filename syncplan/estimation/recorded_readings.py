"""Readings of a recording at their own times, on a clock that begins with its truth, if any.

odometry    held from one reading to the next, and averaged over each step of the filter; zero
            before the first and after the last
sightings   in the order of their times, which end the filter's steps
truth       straight lines between its entries; headings unwrapped; zeros where there is none. In an
            interval between entries that is too long, it is not known
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.errors import InputError
from syncplan.estimation.replay_settings import ReplaySettings
from syncplan.orbits.sighting_kinds import BEARING, DISTANCE, place_of
from syncplan.recordings.log import NOBODY, Log
from syncplan.scenario.rules import excess

INTERVALS_BRIDGED = 3.0
"""Median intervals of the truth over which it is a straight line, unless a length is given."""

SAME_TIME = 1e-6
"""Tolerance in s for a sighting at a sample. Present-day timestamps resolve 2e-7 s."""


@dataclass(frozen=True, slots=True)
class Clock:
    """Samples k = 0..samples at begin + k sample_time, in s by the recording's clock."""

    begin: float
    sample_time: float
    samples: int

    @property
    def times(self) -> Array:
        """Times (samples + 1,) of the samples in s since the beginning."""
        return np.asarray(self.sample_time * np.arange(self.samples + 1))

    @property
    def duration(self) -> float:
        """Duration in s."""
        return self.samples * self.sample_time

    def later(self, samples: int) -> "Clock":
        """Return the clock of a run that begins so many samples later and ends with this one."""
        begin = self.begin + samples * self.sample_time
        return Clock(begin, self.sample_time, self.samples - samples)

    def since_begin(self, recorded: Array) -> Array:
        """Return recorded times in s since the beginning."""
        return recorded - self.begin


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Numbers of readings of one kind that the filter does not receive, by reason.

    Attributes
    ----------
    unknown : of an unknown subject
    not_asked_for : of landmarks or robots that the settings exclude
    outside : requested, but from before or after the run
    """

    unknown: int
    not_asked_for: int
    outside: int


@dataclass(frozen=True, slots=True)
class RecordedSightings:
    """Sightings for the filter, (s,) each, in order of time.

    Attributes
    ----------
    times : s since the beginning, less the delay
    observers, targets : targets from n on are landmarks, in the order they were chosen
    kinds : places in SIGHTING_KINDS
    values : rad, m
    left_out : by place in SIGHTING_KINDS, of the requested kinds
    """

    times: Array
    observers: Index
    targets: Index
    kinds: Index
    values: Array
    left_out: Mapping[int, LeftOut]


def clock_of(log: Log, sample_time: float, portion: tuple[float, float] = (0.0, 1.0)) -> Clock:
    """Return the samples in a portion of the time for which the truth of all robots is known.

    Without truth, that time is the one for which all robots have odometry. Raises InputError if
    samples are too few or too many, or if a robot has no odometry in that time.
    """
    tables = [robot.truth if log.has_truth else robot.odometry for robot in log.robots]
    begin = max(float(table[0, 0]) for table in tables)
    end = min(float(table[-1, 0]) for table in tables)
    duration = end - begin
    if duration < sample_time:
        known = "the truth of all robots is known" if log.has_truth else "all robots have odometry"
        raise InputError(
            f"{known} together for {max(duration, 0.0):g} s; at least one sample time, "
            f"{sample_time:g} s, is needed",
            source=log.name,
        )
    problem = excess(duration, sample_time, duration, len(log.robots))
    if problem:
        raise InputError(problem, key="sample_time")
    for robot in log.robots:
        read = robot.odometry[:, 0]
        if read[-1] <= begin or read[0] >= end:
            raise InputError(
                f"the odometry of {robot.name} is from {read[0] - begin:.6g} to "
                f"{read[-1] - begin:.6g} s after the beginning of the run, which lasts "
                f"{duration:.6g} s: by another clock?",
                source=log.name,
            )
    # rounding must not lose the last sample
    samples = int(duration / sample_time + 1e-4)
    first, last = (int(share * samples) for share in portion)
    return Clock(begin + first * sample_time, sample_time, max(last - first, 1))


def true_poses(log: Log, clock: Clock) -> Array:
    """Return the true poses (samples + 1, n, 3) in m, m, rad; zeros if the recording has none."""
    poses = np.zeros((clock.samples + 1, len(log.robots), 3))
    if not log.has_truth:
        return poses
    for k, robot in enumerate(log.robots):
        known = clock.since_begin(robot.truth[:, 0])
        poses[:, k, 0] = np.interp(clock.times, known, robot.truth[:, 1])
        poses[:, k, 1] = np.interp(clock.times, known, robot.truth[:, 2])
        poses[:, k, 2] = np.interp(clock.times, known, np.unwrap(robot.truth[:, 3]))
    return poses


def truth_known(log: Log, clock: Clock, longest: float | None = None) -> Flags:
    """Return whether the truth of all robots is known at each sample (samples + 1,).

    It is at its entries, and between two that are at most `longest` s apart. If None, that is
    INTERVALS_BRIDGED of a robot's median interval between different times, and at least two
    samples. True without truth.
    """
    known = np.ones(clock.samples + 1, dtype=bool)
    for robot in log.robots if log.has_truth else ():
        recorded = clock.since_begin(robot.truth[:, 0])
        intervals = np.diff(recorded, append=np.inf)
        bridged = longest
        if bridged is None:
            usual = float(np.median(intervals[intervals > 0.0]))
            bridged = max(INTERVALS_BRIDGED * usual, 2.0 * clock.sample_time)
        entry = np.maximum(np.searchsorted(recorded, clock.times + SAME_TIME) - 1, 0)
        at_entry = clock.times - recorded[entry] < SAME_TIME
        known &= at_entry | (intervals[entry] <= bridged + SAME_TIME)
    return known


def mean_odometry(log: Log, clock: Clock, ends: Array, column: int) -> Array:
    """Return (steps, n) means of an odometry column over the steps between `ends` (steps + 1,) s.

    A reading is held until the next.
    """
    means = np.empty((len(ends) - 1, len(log.robots)))
    for k, robot in enumerate(log.robots):
        known, values = clock.since_begin(robot.odometry[:, 0]), robot.odometry[:, column]
        integral = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(known))])
        means[:, k] = np.diff(np.interp(ends, known, integral)) / np.diff(ends)
    return means


def sightings_of(
    log: Log, clock: Clock, used: Index, settings: ReplaySettings
) -> RecordedSightings:
    """Return the sightings that count: those of robots and of the landmarks `used`."""
    robots = log.robots
    counts = [len(robot.times) for robot in robots]
    observers = np.repeat(np.arange(len(robots)), counts)
    taken = clock.since_begin(np.concatenate([robot.times for robot in robots])) - settings.delay
    taken = _at_samples(taken, clock)
    subjects = np.concatenate([robot.subjects for robot in robots])
    targets = _targets(log, subjects, used, meetings=settings.meetings)
    within = (taken > 0.0) & (taken <= clock.times[-1])
    read = {place_of(BEARING): np.concatenate([robot.bearings for robot in robots])}
    if settings.distances:
        read[place_of(DISTANCE)] = np.concatenate([robot.ranges for robot in robots])
    left_out: dict[int, LeftOut] = {}
    chosen = []
    for kind, values in read.items():
        there = ~np.isnan(values)
        unknown = int(np.sum(there & (subjects == NOBODY)))
        asked_for = there & (targets >= 0)
        rows = np.flatnonzero(asked_for & within)
        outside, wanted = int(asked_for.sum()) - len(rows), int(asked_for.sum())
        left_out[kind] = LeftOut(unknown, int(there.sum()) - unknown - wanted, outside)
        chosen.append((rows, np.full(len(rows), kind), values[rows]))
    row, kinds, measured = (np.concatenate(parts) for parts in zip(*chosen, strict=True))
    order = np.lexsort((kinds, row, taken[row]))
    row = row[order]
    return RecordedSightings(
        times=taken[row],
        observers=observers[row],
        targets=targets[row],
        kinds=kinds[order],
        values=measured[order],
        left_out=left_out,
    )


def longest_gap(recorded: Array, begin: float, duration: float) -> float:
    """Return the longest interval in s between recorded times (k,) during a run."""
    first, last = np.searchsorted(recorded, (begin, begin + duration))
    return float(np.diff(recorded[max(first - 1, 0) : last + 1]).max(initial=0.0))


def _at_samples(times: Array, clock: Clock) -> Array:
    """Times, with those within SAME_TIME of a sample moved to it."""
    sample = clock.sample_time * np.rint(times / clock.sample_time)
    return np.where(np.abs(times - sample) < SAME_TIME, sample, times)


def _targets(log: Log, subjects: Index, used: Index, *, meetings: bool) -> Index:
    """Bodies (s,) of the subjects seen; -1 where they do not count."""
    bodies = {robot.subject: k for k, robot in enumerate(log.robots)} if meetings else {}
    for place, subject in enumerate(log.landmark_subjects[used].tolist()):
        bodies[subject] = len(log.robots) + place
    return np.array([bodies.get(one, -1) for one in subjects.tolist()], np.int64)
