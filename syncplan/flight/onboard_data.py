"""What a navigator is given and gives: readings and sightings, an estimate and commands."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from syncplan.arrays import Array


class TimedSighting(NamedTuple):
    """A sighting: who sighted whom, what was measured, and how many samples ago.

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
    """What a team has read in a sample.

    Attributes
    ----------
    speeds, turn_rates : (n,) m/s, rad/s, over the sample; NaN, or None for all, where there is no
        reading: the command counts
    sightings : made at its end, or late
    """

    speeds: Array | None = None
    turn_rates: Array | None = None
    sightings: Sequence[TimedSighting] = ()


@dataclass(frozen=True, slots=True)
class Estimate:
    """Where a team is.

    Attributes
    ----------
    time : s
    poses : (n, 3) m, m, rad
    errors : (e,) bias states, as the plan's filter has them
    sigmas : (n, 3) m, m, rad, the filter's own; of the time of the last sightings taken in
    """

    time: float
    poses: Array
    errors: Array
    sigmas: Array


@dataclass(frozen=True, slots=True)
class Command:
    """What a team does in the next sample: speeds through the air and turn rates, (n,) each."""

    speeds: Array
    turn_rates: Array
