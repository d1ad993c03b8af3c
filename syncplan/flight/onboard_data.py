"""Inputs and outputs of a navigator: readings and sightings, estimates and commands.

Inputs are checked, and kept until late sightings can no longer arrive.
"""

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.errors import InputError
from syncplan.estimation.filter_setup import COMPASS_KIND
from syncplan.estimation.online_filter import Arrived
from syncplan.guidance.flown_team import FlownTeam
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS


class TimedSighting(NamedTuple):
    """Sighting of a target by an observer: kind, value, and age in samples.

    Fields
    ------
    observer, target : bodies by index; from n on landmarks, the observer itself for a compass
    kind : place in SIGHTING_KINDS: 0 bearing, 1 distance, 2 compass
    value : rad or m
    age : samples since it was made; 0 if at the end of the sample
    """

    observer: int
    target: int
    kind: int
    value: float
    age: int = 0


@dataclass(frozen=True, slots=True)
class Sensed:
    """Readings of a team in a sample.

    Attributes
    ----------
    speeds, turn_rates : (n,) m/s, rad/s, over the sample; NaN, or None for all, where there is no
        reading; the command then takes its place
    sightings : made at its end, or late
    """

    speeds: Array | None = None
    turn_rates: Array | None = None
    sightings: Sequence[TimedSighting] = ()


@dataclass(frozen=True, slots=True)
class Estimate:
    """Estimated state of a team.

    Attributes
    ----------
    time : s
    poses : (n, 3) m, m, rad
    errors : (e,) bias states, as the plan's filter has them
    sigmas : (n, 3) m, m, rad, the filter's own, at the time of the last sightings processed
    """

    time: float
    poses: Array
    errors: Array
    sigmas: Array


@dataclass(frozen=True, slots=True)
class Command:
    """Commands for the next sample: speeds through the air and turn rates, (n,) each."""

    speeds: Array
    turn_rates: Array


# --- samples that wait for late sightings ---------------------------------------------------------


_NO_ROWS = np.zeros(0, dtype=np.int64)

NOTHING = Arrived(_NO_ROWS, _NO_ROWS, _NO_ROWS, np.zeros(0), np.zeros(0))
"""No sightings."""


@dataclass(slots=True)
class SampleRead:
    """Readings (n,) of a sample, and the sightings at its end so far."""

    speeds: Array
    turn_rates: Array
    sightings: list[TimedSighting] = field(default_factory=list)


class Arrivals:
    """Samples that the filter has not processed yet, oldest first.

    Attributes
    ----------
    too_late : number of sightings that arrived after their sample was processed
    """

    def __init__(self, team: FlownTeam, names: Sequence[str]) -> None:
        self.too_late = 0
        self._names = names
        self._variances: list[list[float]] = np.square(team.setup.eyes.sigmas).tolist()
        self._bodies = team.team.count + len(team.team.landmarks)
        self._samples: deque[SampleRead] = deque()

    def __len__(self) -> int:
        return len(self._samples)

    def take(self, sensed: Sensed, commanded: Array) -> None:
        """Add a sample, flown with commands (n, 2), and sightings of it or of earlier ones.

        Raises InputError for input that does not fit the team, and then adds nothing.
        """
        speeds = _read(sensed.speeds, commanded[:, 0], "speeds")
        turn_rates = _read(sensed.turn_rates, commanded[:, 1], "turn_rates")
        made = self._made(sensed.sightings)
        self._samples.append(SampleRead(speeds, turn_rates))
        newest = len(self._samples) - 1
        for one in made:
            if one.age > newest:
                self.too_late += 1
            else:
                self._samples[newest - one.age].sightings.append(one)

    def oldest(self) -> tuple[SampleRead, Arrived]:
        """Remove and return the oldest sample, with its sightings in the order of flights."""
        sample = self._samples.popleft()
        if not sample.sightings:
            return sample, NOTHING
        observers, targets, kinds, values, _ = zip(*sorted(sample.sightings), strict=True)
        variances = [self._variances[k][o] for k, o in zip(kinds, observers, strict=True)]
        return sample, Arrived(
            np.array(observers),
            np.array(targets),
            np.array(kinds),
            np.array(variances),
            np.array(values),
        )

    @property
    def readings(self) -> tuple[Array, Array]:
        """Speeds and turn rates (k, n) of all samples."""
        return (
            np.array([one.speeds for one in self._samples]),
            np.array([one.turn_rates for one in self._samples]),
        )

    @property
    def memory(self) -> dict[str, Array | Index]:
        """All samples as arrays by name; set it to restore them in arrivals of the same team."""
        sighted = [(k, *one) for k, sample in enumerate(self._samples) for one in sample.sightings]
        speeds, turn_rates = self.readings
        return {
            "too_late": np.array(self.too_late),
            "pending_speeds": speeds,
            "pending_turn_rates": turn_rates,
            "pending_sightings": np.array(sighted, dtype=float).reshape(-1, 6),
        }

    @memory.setter
    def memory(self, kept: Mapping[str, Array | Index]) -> None:
        self.too_late = int(kept["too_late"])
        pairs = zip(kept["pending_speeds"], kept["pending_turn_rates"], strict=True)
        self._samples = deque(SampleRead(*one) for one in pairs)
        for place, observer, target, kind, value, age in kept["pending_sightings"].tolist():
            one = TimedSighting(int(observer), int(target), int(kind), value, int(age))
            self._samples[int(place)].sightings.append(one)

    def _made(self, sightings: Iterable[TimedSighting]) -> list[TimedSighting]:
        """Sightings without the missed ones, NaN; raises InputError for impossible ones."""
        variances, bodies, made = self._variances, self._bodies, []
        kinds, n = len(variances), len(variances[0])
        for one in sightings:
            observer, target, kind, value, age = one
            known = 0 <= kind < kinds and 0 <= observer < n and 0 <= target < bodies
            if not known or age < 0:
                raise InputError(f"{one}: no such observer, target, kind or age", key="sightings")
            if (kind == COMPASS_KIND) != (observer == target):
                problem = f"{one}: the target of a compass, and of it alone, is its own vehicle"
                raise InputError(problem, key="sightings")
            if variances[kind][observer] == math.inf:
                problem = f"{self._names[observer]} has no sigma for a {list(SIGHTING_KINDS)[kind]}"
                raise InputError(f"{problem}; give it in the scenario", key="sightings")
            if math.isfinite(value):
                made.append(one)
            elif not math.isnan(value):
                raise InputError(f"{one}: must be finite, or NaN if it is missed", key="sightings")
        return made


def _read(given: Array | None, commanded: Array, name: str) -> Array:
    """Readings (n,), with commands where there are none."""
    if given is None:
        return commanded.copy()
    found = np.asarray(given, dtype=float)
    if found.shape != commanded.shape:
        problem = f"must be {len(commanded)} numbers, has shape {found.shape}"
        raise InputError(problem, key=name)
    if math.isfinite(found @ found):
        return found
    if np.isinf(found).any():
        raise InputError("must be finite, or NaN where there is no reading", key=name)
    return np.where(np.isnan(found), commanded, found)
