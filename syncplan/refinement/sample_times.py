"""The samples of a window as angles turned; where there are many, neighbours are grouped."""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.sightings import samples_before

__all__ = ["SampleTimes", "samples_of"]


@dataclass(frozen=True, slots=True)
class SampleTimes:
    """The samples of a window, or groups of neighbours where there are many.

    Attributes
    ----------
    angles : (k,) rad turned since time 0
    counts : (k,) samples in each group
    """

    angles: Array
    counts: Array

    @property
    def spacing(self) -> float:
        """Typical angle in rad between neighbours."""
        return float(2.0 * np.pi / max(len(self.angles), 1))


def samples_of(window: float, sample_time: float, rate: float, most: int) -> SampleTimes:
    """Return the samples k Ts in [0, window) s as at most `most` angles turned at `rate` rad/s."""
    number = samples_before(window, sample_time)
    turned = np.sort(np.arange(number) * (rate * sample_time) % (2.0 * np.pi))
    if number <= most:
        return SampleTimes(turned, np.ones(number))
    group = np.minimum((turned / (2.0 * np.pi) * most).astype(int), most - 1)
    counts = np.bincount(group, minlength=most).astype(float)
    angles = np.bincount(group, weights=turned, minlength=most)
    held = counts > 0.0
    return SampleTimes(angles[held] / counts[held], counts[held])
