"""Losses that end a team's observability, found without assessing every remainder.

Let M = Q T be the rows of the whole team, M' those that remain after a loss and R those lost. Every
direction x of the state has |M' x|^2 = |M x|^2 - |R x|^2. With u = T x and the largest singular
value s of R T^-1 over the directions that do not move lost vehicles,

    smallest singular value of M'  >=  sqrt(1 - s^2) * that of M

This bound settles most losses. Where s is 1, its singular vector is a motion x that M' does not
see: |M' x| / |x|, computed from the remaining rows, bounds the smallest singular value from above.
A loss that neither bound settles is assessed like any team. Rows are in mean radii; both bounds
allow for the change of the mean radius when a vehicle is lost.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.observability import rank
from syncplan.observability.referred_rows import sighting_rows
from syncplan.observability.spectrum import RANK_TOLERANCE
from syncplan.orbits.sightings import Loss, remainder_of

CLEAR = 1e-4
"""Value of 1 - s^2 above which it exceeds rounding errors."""

SAFETY = 10.0
"""Factor by which a bound has to clear the tolerance of the rank."""


@dataclass(frozen=True, slots=True)
class _Rows:
    """Rows of each directed pair and kind of sighting, reduced to at most six, in mean radii.

    Attributes
    ----------
    blocks : (r, 6) columns of the observer, then of the target; zeros for a landmark
    observers, targets, kinds : (r,)
    """

    blocks: Array
    observers: Index
    targets: Index
    kinds: Index

    def only(self, chosen: Flags) -> "_Rows":
        """Return the chosen rows."""
        return _Rows(
            self.blocks[chosen], self.observers[chosen], self.targets[chosen], self.kinds[chosen]
        )

    def lost(self, loss: Loss, count: int) -> Flags:
        """Return (r,) whether each row is lost, in a team of `count` vehicles.

        A vehicle that loses its sensor keeps its measurements of itself.
        """
        gone = [*loss.vehicles, *(count + k for k in loss.landmarks)]
        lost = np.zeros(len(self.blocks), dtype=bool)
        for own, bodies in ((self.observers, loss.vehicles), (self.targets, gone)):
            for body in bodies:
                lost |= own == body
        for body in loss.sensors:
            lost |= (self.observers == body) & (self.targets != body)
        for place, body in loss.kinds:
            lost |= (self.observers == body) & (self.kinds == place)
        return lost | loss.parts(self.observers, self.targets)

    def times(self, matrix: Array) -> Array:
        """Return the product (r, k) of the rows, as wide as the state, and a matrix (3 n, k)."""
        parts = matrix.reshape(-1, 3, matrix.shape[1])
        target = np.where(self.targets < len(parts), self.targets, 0)
        return np.asarray(
            np.matmul(self.blocks[:, None, :3], parts[self.observers])[:, 0]
            + np.matmul(self.blocks[:, None, 3:], parts[target])[:, 0]
        )


def decisive_losses(assessed: rank.Assessment, losses: Sequence[Loss]) -> list[Loss]:
    """Return the losses that end a team's observability; none if it is not observable."""
    if not assessed.observability.observable:
        return []
    rows = _directed_rows(assessed)
    alone = rank.lone_rows(assessed.team, assessed.sightings)
    matrix = rank.stacked_rows(assessed.information, assessed.team.count, alone)
    triangle = np.linalg.qr(matrix, mode="r")
    inverse = np.linalg.inv(triangle)
    measured = _Measured(assessed, rows, inverse, rows.times(inverse))
    return [loss for loss in losses if measured.lacks(loss)]


def _directed_rows(assessed: rank.Assessment) -> _Rows:
    sightings = assessed.sightings
    order = np.lexsort((sightings.kinds, sightings.targets, sightings.observers))
    keys = [of[order] for of in (sightings.observers, sightings.targets, sightings.kinds)]
    # the last row fills up those of a pair, so that many are reduced at once
    rows = np.concatenate([sighting_rows(assessed.team, sightings)[order], np.zeros((1, 6))])
    begin, end = np.array(rank.equal_runs(*keys)).T
    size = 16 * -(-(end - begin) // 16)
    blocks = np.zeros((len(begin), 6, 6))
    for one in np.flatnonzero(np.bincount(size)).tolist():
        same = size == one
        row = begin[same, None] + np.arange(one)
        filled = rows[np.where(row < end[same, None], row, len(rows) - 1)]
        blocks[same] = np.linalg.qr(filled, mode="r")
    reduced = blocks.reshape(-1, 6)
    used = reduced.any(axis=1)
    return _Rows(reduced[used], *(np.repeat(of[begin], 6)[used] for of in keys))


@dataclass(frozen=True, slots=True)
class _Measured:
    """Rows of a team, by the state x and by its coordinates u = T x.

    Attributes
    ----------
    inverse : (3 n, 3 n) T^-1
    seen : (r, 3 n) rows times T^-1
    """

    assessed: rank.Assessment
    rows: _Rows
    inverse: Array
    seen: Array

    def lacks(self, loss: Loss) -> bool:
        """Return whether the team is not observable after a loss."""
        team = self.assessed.team
        lost = self.rows.lost(loss, team.count)
        if not lost.any() and not loss.vehicles:
            return False
        values = self.assessed.observability.singular_values
        spread = self._spread(loss)
        seen = self._seen(lost, loss)
        squares = seen @ seen.T
        # eigenvalues alone: vectors would take twice as long
        taken = np.linalg.eigvalsh(squares)[-1] if len(seen) else 0.0
        least = np.sqrt(max(1.0 - taken, 0.0)) * values[-1]
        if 1.0 - taken > CLEAR and least > SAFETY * spread * RANK_TOLERANCE * values[0]:
            return False
        if taken > 0.0:
            motion = self.inverse @ (np.linalg.eigh(squares)[1][:, -1] @ seen)
            if _is_unseen(self.rows.only(~lost), motion, loss, spread):
                return True
        left = remainder_of(team, loss)
        sightings, _ = left.sightings(self.assessed.sightings)
        links = rank.link_information(left.team, sightings)
        alone = rank.lone_rows(left.team, sightings)
        return not rank.assess(left.team, links, alone).observable

    def _seen(self, lost: Flags, loss: Loss) -> Array:
        """Lost rows times T^-1, over the directions that do not move lost vehicles."""
        seen = self.seen[lost]
        gone = [3 * k + axis for k in loss.vehicles for axis in range(3)]
        if gone:
            # remove the directions that move lost vehicles
            fixed = np.linalg.qr(self.inverse[gone].T)[0]
            seen -= (seen @ fixed) @ fixed.T
        return seen

    def _spread(self, loss: Loss) -> float:
        """Factor by which the change of the mean radius may move two singular values apart."""
        if not loss.vehicles:
            return 1.0
        radii = np.delete(self.assessed.team.orbits.radii, list(loss.vehicles))
        ratio = float(radii.mean()) / self.assessed.observability.scale
        return max(ratio, 1.0 / ratio) ** 4


def _is_unseen(remaining: _Rows, motion: Array, loss: Loss, spread: float) -> bool:
    """Whether the remaining rows do not see a motion, compared with the longest row."""
    for k in loss.vehicles:
        motion[3 * k : 3 * k + 3] = 0.0
    if not len(remaining.blocks):
        return True
    seen = np.linalg.norm(remaining.times(motion[:, None])) / np.linalg.norm(motion)
    longest = np.sqrt(np.max(np.einsum("rc,rc->r", remaining.blocks, remaining.blocks)))
    return bool(SAFETY * spread * seen < RANK_TOLERANCE * longest)
