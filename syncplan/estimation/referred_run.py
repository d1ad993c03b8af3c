"""A run with all errors referred to time 0: noise that is added, and rows of sightings."""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index

GROUP_ROWS = 64
"""Rows of a group, where rows are processed by groups."""

SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
"""Where the elements of a symmetric block are among its (xx, xy, x psi, yy, y psi, psi psi)."""

UPPER = np.triu_indices(3)
"""The rows and columns of these six in the block."""


@dataclass(frozen=True, slots=True)
class Run:
    """Noise and sightings along a run of n vehicles, referred to time 0.

    Attributes
    ----------
    noise : (6, n, steps + 1) of the step that ends at k, nothing at 0: the upper triangle of each
        vehicle's block, (xx, xy, x psi, yy, y psi, psi psi)
    rows : (s, 6) whitened rows in order of time, observer's three, target's three
    observers, targets : (s,) vehicles; any for a landmark, whose three are zero
    first : (steps + 2,) rows of sample k are first[k] to first[k + 1]
    """

    noise: Array
    rows: Array
    observers: Index
    targets: Index
    first: Index

    @property
    def count(self) -> int:
        """Number of vehicles."""
        return int(self.noise.shape[1])

    @property
    def columns(self) -> Index:
        """(s, 6) columns of the rows' elements in the team's state."""
        vehicles = np.column_stack([self.observers, self.targets])
        return (3 * vehicles[:, :, None] + np.arange(3)).reshape(-1, 6)

    @property
    def noise_blocks(self) -> Array:
        """(steps + 1, n, 3, 3) the noise as blocks."""
        by_step = np.ascontiguousarray(np.moveaxis(self.noise, (2, 1), (0, 1)))
        return np.asarray(by_step.take(SYMMETRIC, axis=2))


def grouped(run: Run, which: Index, six: Array, noise: Array, sample: Index) -> tuple[Array, Array]:
    """Return rows in groups, and the noise up to each times it: both (g, 3 n, m), rows as columns.

    `which` are the (r,) rows, `six` their (r, 6) elements or those of functions of the same states.
    `sample` is the place of each in `noise`, (6, n, k). Zeros fill up the last group.
    """
    number = -(-len(sample) // GROUP_ROWS)
    rows, noisy = np.zeros((2, number, 3 * run.count, GROUP_ROWS))
    group, within = np.divmod(np.arange(len(sample)), GROUP_ROWS)
    place = group * (3 * run.count * GROUP_ROWS) + within
    axes = GROUP_ROWS * np.arange(3)[:, None]
    # targets first: in place of a landmark is a vehicle, which may be the observer itself
    for vehicles, columns in ((run.targets, slice(3, 6)), (run.observers, slice(0, 3))):
        who, own = vehicles[which], six[:, columns].T
        at = place + 3 * GROUP_ROWS * who + axes
        grown = noise.reshape(6, -1).take(who * noise.shape[-1] + sample, axis=1)
        rows.reshape(-1)[at] = own
        noisy.reshape(-1)[at] = _times(grown, own)
    return rows, noisy


def _times(blocks: Array, vectors: Array) -> Array:
    """(3, s) symmetric blocks (6, s) times vectors (3, s)."""
    xx, xy, xp, yy, yp, pp = blocks
    x, y, p = vectors
    return np.stack([xx * x + xy * y + xp * p, xy * x + yy * y + yp * p, xp * x + yp * y + pp * p])
