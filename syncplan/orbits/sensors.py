"""Sensors: what each vehicle can see, and how well."""

from dataclasses import dataclass, replace

from syncplan.arrays import Array, Index, short_repr

__all__ = ["Sensors"]


@dataclass(frozen=True, slots=True, repr=False)
class Sensors:
    """What each of n vehicles can see, and how well.

    Attributes
    ----------
    ranges : (n,) m
    fields_of_view : (n,) rad, full angle; 2 pi or more sees all round
    boresights : (n,) rad, from the heading, counter-clockwise
    bearing_sigmas : (n,) rad
    sample_time : s, common to all
    """

    ranges: Array
    fields_of_view: Array
    boresights: Array
    bearing_sigmas: Array
    sample_time: float

    __repr__ = short_repr

    def only(self, vehicles: Index) -> "Sensors":
        """Return the sensors of the vehicles (k,), in that order; a vehicle may stand twice."""
        return Sensors(
            self.ranges[vehicles],
            self.fields_of_view[vehicles],
            self.boresights[vehicles],
            self.bearing_sigmas[vehicles],
            self.sample_time,
        )

    def scaled(self, unit: float) -> "Sensors":
        """Return the same sensors with all lengths in units of `unit` m."""
        return replace(self, ranges=self.ranges / unit)
