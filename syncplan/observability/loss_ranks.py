"""Which losses end the observability of a team, without judging each remainder from the start.

With M = Q T the rows of the whole team, M' those that a loss leaves and R those it takes, every
direction x of the state has |M' x|^2 = |M x|^2 - |R x|^2. So with u = T x and largest singular
value s of R T^-1 over the directions that do not move what is lost,

    smallest singular value of M'  >=  sqrt(1 - s^2) * that of M

which settles most losses; and where s is 1, its singular vector is a motion x that M' does not
see: |M' x| / |x|, computed from the rows left, bounds the smallest singular value from above. What
neither bound settles is assessed as any team is. Rows' units are mean radii; the mean radius may
change with a vehicle's loss, which both bounds allow for.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.observability.rank import (
    RANK_TOLERANCE,
    assess,
    link_information,
    sighting_rows,
    stacked_rows,
)
from syncplan.observability.window_assessment import Assessment
from syncplan.orbits.losses import Loss, Remainder, remainder_of

__all__ = ["decisive_losses"]

CLEAR = 1e-4
"""1 - s^2 above which it is no rounding error."""

SAFETY = 10.0
"""Factor by which a bound has to clear the tolerance of the rank."""


@dataclass(frozen=True, slots=True)
class _Rows:
    """The rows of each directed pair, reduced to at most six, in mean radii.

    Attributes
    ----------
    blocks : (r, 6) columns of the observer, then of the target; zeros for a landmark
    observers, targets : (r,)
    """

    blocks: Array
    observers: Index
    targets: Index

    def only(self, chosen: Flags) -> "_Rows":
        """Return the chosen rows."""
        return _Rows(self.blocks[chosen], self.observers[chosen], self.targets[chosen])

    def times(self, matrix: Array) -> Array:
        """Return (r, k): the rows, as wide as the state, times a matrix (3 n, k)."""
        parts = matrix.reshape(-1, 3, matrix.shape[1])
        target = np.where(self.targets < len(parts), self.targets, 0)
        return np.asarray(
            np.matmul(self.blocks[:, None, :3], parts[self.observers])[:, 0]
            + np.matmul(self.blocks[:, None, 3:], parts[target])[:, 0]
        )


def decisive_losses(assessed: Assessment, losses: Sequence[Loss]) -> list[Loss]:
    """Return those of the losses after which an observable team is not; none if it never was."""
    if not assessed.observability.observable:
        return []
    rows = _directed_rows(assessed)
    triangle = np.linalg.qr(stacked_rows(assessed.information, assessed.team.count), mode="r")
    inverse = np.linalg.inv(triangle)
    return [loss for loss in losses if _is_decisive(assessed, rows, inverse, loss)]


def _directed_rows(assessed: Assessment) -> _Rows:
    sightings = assessed.sightings
    rows = sighting_rows(assessed.team, sightings)
    order = np.lexsort((sightings.targets, sightings.observers))
    observers, targets = sightings.observers[order], sightings.targets[order]
    rows = rows[order]
    new = (np.diff(observers, prepend=-1) != 0) | (np.diff(targets, prepend=-1) != 0)
    first = np.flatnonzero(new)
    reduced = [
        rows[begin:end] if end - begin <= 6 else np.linalg.qr(rows[begin:end], mode="r")
        for begin, end in pairwise([*first.tolist(), len(rows)])
    ]
    number = [len(block) for block in reduced]
    return _Rows(
        np.concatenate(reduced),
        np.repeat(observers[first], number),
        np.repeat(targets[first], number),
    )


def _is_decisive(assessed: Assessment, rows: _Rows, inverse: Array, loss: Loss) -> bool:
    left = remainder_of(assessed.team, loss)
    kept = left.still_seen(rows.observers, rows.targets)
    if kept.all() and not loss.vehicles:
        return False
    values = assessed.observability.singular_values
    spread = _spread(assessed, left)
    taken, vectors = _taken(rows.only(~kept), inverse, loss)
    least = np.sqrt(max(1.0 - taken**2, 0.0)) * values[-1]
    if 1.0 - taken**2 > CLEAR and least > SAFETY * spread * RANK_TOLERANCE * values[0]:
        return False
    remaining = rows.only(kept)
    if taken > 0.0 and _is_unseen(remaining, inverse @ vectors, loss, spread):
        return True
    sightings, _ = left.sightings(assessed.sightings)
    return not assess(left.team, link_information(left.team, sightings)).observable


def _taken(lost: _Rows, inverse: Array, loss: Loss) -> tuple[float, Array]:
    """Largest singular value of the rows lost, in the team's own measure, and its vector."""
    seen = lost.times(inverse)
    gone = [3 * k + axis for k in loss.vehicles for axis in range(3)]
    if gone:
        # directions that leave the lost vehicles where they are
        fixed = np.linalg.qr(inverse[gone].T)[0]
        seen -= (seen @ fixed) @ fixed.T
    if not len(seen):
        return 0.0, np.zeros(len(inverse))
    squares, vectors = np.linalg.eigh(seen @ seen.T)
    return float(np.sqrt(max(squares[-1], 0.0))), np.asarray(vectors[:, -1] @ seen)


def _is_unseen(remaining: _Rows, motion: Array, loss: Loss, spread: float) -> bool:
    """Whether the rows left don't see a motion of the state, beside the longest of them."""
    for k in loss.vehicles:
        motion[3 * k : 3 * k + 3] = 0.0
    if not len(remaining.blocks):
        return True
    seen = np.linalg.norm(remaining.times(motion[:, None])) / np.linalg.norm(motion)
    longest = np.sqrt(np.max(np.einsum("rc,rc->r", remaining.blocks, remaining.blocks)))
    return bool(SAFETY * spread * seen < RANK_TOLERANCE * longest)


def _spread(assessed: Assessment, left: Remainder) -> float:
    """How far the change of the mean radius may move apart two singular values, as a factor."""
    ratio = float(left.team.orbits.radii.mean()) / assessed.observability.scale
    return max(ratio, 1.0 / ratio) ** 4
