"""Whether the errors of a recording's sightings last: sums of their innovations over blocks.

Innovations of a filter whose sightings have errors of their own are white. Where an observer's
errors of a target last, k of them in a block add up to more than root k: with normalised
innovations e of a block,

    ratio = sum over blocks of (sum of e)^2 / sum of e^2

is 1 for white ones, give or take root of 2 / blocks. NIS times the ratio is the NIS of sums: a
filter whose NIS is small while that of sums is not has errors that last, and smaller sigmas would
make it surer than it is.

Source: Bar-Shalom, Li, Kirubarajan (2001), 5.4.2 (whiteness of innovations); Newey, West (1987),
Econometrica 55 (the variance of sums).
"""

from dataclasses import dataclass

import numpy as np

from syncplan.estimation.recorded_run import FilteredRun, RecordedRun

BLOCK_S = 10.0
SURE = 3.0
"""Standard errors beyond which innovations count as alike."""


@dataclass(frozen=True, slots=True)
class Lasting:
    """How much more sums of one kind's innovations scatter than those of white ones.

    Attributes
    ----------
    ratio : of the sums' mean square, 1 for white innovations
    blocks : number of sums
    """

    ratio: float
    blocks: int

    @property
    def lasts(self) -> bool:
        """Whether errors last, beyond chance."""
        return bool(self.ratio > 1.0 + SURE * np.sqrt(2.0 / max(self.blocks, 1)))

    @property
    def growth(self) -> float:
        """By what a sigma is larger for errors that last; 1 where they do not."""
        return float(np.sqrt(self.ratio)) if self.lasts else 1.0


def lasting_of(run: RecordedRun, made: FilteredRun, kind: int) -> Lasting:
    """Return how the innovations of a kind of sighting add up, by observer and target."""
    seen, used = run.sightings, (made.weights > 0.0) & (run.sightings.kinds == kind)
    if not used.any():
        return Lasting(1.0, 0)
    scaled = (made.innovations * np.sqrt(made.weights))[used]
    block = (seen.times[used] // BLOCK_S).astype(np.int64)
    blocks = np.column_stack([seen.observers[used], seen.targets[used], block])
    _, number = np.unique(blocks, axis=0, return_inverse=True)
    sums = np.bincount(number.ravel(), scaled)
    return Lasting(float(np.sum(sums**2) / np.sum(scaled**2)), len(sums))
