"""Sensors: what each vehicle can see, how often and how well."""

from dataclasses import dataclass, field, fields, replace

import numpy as np

from syncplan.arrays import Array, Index, short_repr


@dataclass(frozen=True, slots=True, repr=False)
class Sensors:
    """What each of n vehicles can see, how often and how well.

    What a plain camera has not may be left out, or be one value for all.

    Attributes
    ----------
    ranges : (n,) m
    fields_of_view : (n,) rad, full angle; 2 pi or more sees all round
    boresights : (n,) rad, from the heading, counter-clockwise
    bearing_sigmas : (n,) rad
    sample_time : s, common to all
    range_sigmas : (n,) m, of distances; infinite where none are measured
    compass_sigmas : (n,) rad, of the vehicle's own heading; infinite without a compass
    compass_every : (n,) samples from one reading of the compass to the next
    every : (n,) samples from one sighting of a target to the next
    detection : (n,) share of the sightings within range and view that are made
    false_bearings : (n,) share of the bearings made that are of nothing, anywhere in view
    bearing_bias_sigmas : (n,) rad, of an error of the sensor's bearings that is constant in a run
    bearing_walk_sigmas, bearing_walk_times : (n,) rad, s, of one that is a first-order Gauss-Markov
        process: its standard deviation, and the time over which its correlation falls to 1/e
    """

    ranges: Array
    fields_of_view: Array
    boresights: Array
    bearing_sigmas: Array
    sample_time: float
    range_sigmas: Array = field(default_factory=lambda: np.array(np.inf))
    compass_sigmas: Array = field(default_factory=lambda: np.array(np.inf))
    compass_every: Index = field(default_factory=lambda: np.array(1))
    every: Index = field(default_factory=lambda: np.array(1))
    detection: Array = field(default_factory=lambda: np.array(1.0))
    false_bearings: Array = field(default_factory=lambda: np.array(0.0))
    bearing_bias_sigmas: Array = field(default_factory=lambda: np.array(0.0))
    bearing_walk_sigmas: Array = field(default_factory=lambda: np.array(0.0))
    bearing_walk_times: Array = field(default_factory=lambda: np.array(np.inf))

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Give each vehicle its own where one value stands for all."""
        for name in self._names():
            value = np.asarray(getattr(self, name))
            if value.ndim == 0:
                object.__setattr__(self, name, np.full(len(self.ranges), value))

    @classmethod
    def _names(cls) -> list[str]:
        """Attributes that are arrays."""
        return [one.name for one in fields(cls) if one.name != "sample_time"]

    def only(self, vehicles: Index) -> "Sensors":
        """Return the sensors of the vehicles (k,), in that order; a vehicle may stand twice."""
        return replace(self, **{name: getattr(self, name)[vehicles] for name in self._names()})

    @property
    def compass_sigmas_each_sample(self) -> Array:
        """(n,) rad: of readings at every sample that say as much as those that there are."""
        return np.asarray(self.compass_sigmas * np.sqrt(self.compass_every))

    def scaled(self, unit: float) -> "Sensors":
        """Return the same sensors with all lengths in units of `unit` m."""
        return replace(self, ranges=self.ranges / unit, range_sigmas=self.range_sigmas / unit)
