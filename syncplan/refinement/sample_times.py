"""The samples of a window as angles turned; where there are many, neighbours are grouped."""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.sensors import Sensors
from syncplan.orbits.sightings import samples_before


@dataclass(frozen=True, slots=True)
class SampleTimes:
    """The samples of a window, or groups of neighbours where there are many.

    Attributes
    ----------
    angles : (k,) rad turned since time 0
    counts : (k,) samples in each group
    ready : (k, n) those of them at which each vehicle's sensor sights targets; None where all are
    """

    angles: Array
    counts: Array
    ready: Array | None = None

    @property
    def spacing(self) -> float:
        """Typical angle in rad between neighbours."""
        return float(2.0 * np.pi / max(len(self.angles), 1))

    def sighted(self, observers: Index) -> Array:
        """Return (k, e) the samples in each group at which the observers (e,) sight targets."""
        if self.ready is None:
            return np.repeat(self.counts[:, None], len(observers), axis=1)
        return np.asarray(self.ready[:, observers])


def samples_of(window: float, sensors: Sensors, rate: float, most: int) -> SampleTimes:
    """Return the samples k Ts in [0, window) s as at most `most` angles turned at `rate` rad/s."""
    number = samples_before(window, sensors.sample_time)
    passed = np.arange(number) * (rate * sensors.sample_time)
    turned = np.asarray(passed % (2.0 * np.pi), dtype=float)
    order = np.argsort(turned)
    turned = turned[order]
    ready = None
    if np.any(sensors.every > 1):
        ready = np.where(order[:, None] % sensors.every == 0, 1.0, 0.0)
    if number <= most:
        return SampleTimes(turned, np.ones(number), ready)
    group = np.minimum((turned / (2.0 * np.pi) * most).astype(int), most - 1)
    counts = np.bincount(group, minlength=most).astype(float)
    angles = np.bincount(group, weights=turned, minlength=most)
    held = counts > 0.0
    if ready is not None:
        ready = np.stack([np.bincount(group, one, minlength=most) for one in ready.T], axis=1)
        ready = ready[held]
    return SampleTimes(angles[held] / counts[held], counts[held], ready)
