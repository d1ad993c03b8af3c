"""Windowed observability: the matrix of equations (5)-(9) in closed form, its rank and its gap.

Its rows are those of syncplan.observability.referred_rows. Each link's rows are first reduced to at
most six by its own singular value decomposition. That is an orthogonal change of the rows: the
singular values of the whole matrix stay what they are, and nothing is ever squared.

Bearings and distances of a pair are rows of one link. What a vehicle measures of itself, as a
compass does, belongs to no link: its rows enter the matrix alone.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.observability.referred_rows import sighting_rows
from syncplan.observability.singular_values import (
    RANK_TOLERANCE,
    decomposed,
    matrix_rank,
    rank_gap,
)
from syncplan.orbits.sighting_kinds import of_targets
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team

NEGLIGIBLE = 1e-15
"""Rows smaller than this share of the largest singular value of any link are left out."""

LINK_TOLERANCE = 1e-6
"""A singular value of one link's matrix counts above this share of its largest."""


@dataclass(frozen=True, slots=True)
class PairRows:
    """The rows of one pair's sightings, both ways together, in order of time.

    Attributes
    ----------
    a, b : indices, a < b; b is a landmark from n on
    rows : (k, 6) columns of a, then of b
    steps : (k,) sample numbers
    one_way : whether only one of the two sees the other
    """

    a: int
    b: int
    rows: Array
    steps: Index
    one_way: bool


@dataclass(frozen=True, slots=True)
class LinkInformation:
    """What the sightings of one pair, both ways together, determine of its two poses.

    Attributes
    ----------
    a, b : indices, a < b; b is a landmark from n on
    sightings : number of rows
    one_way : whether only one of the two sees the other
    singular_values : (k,) of the scaled rows, descending
    directions : (k, 6) right singular vectors over (x_a, y_a, psi_a, x_b, y_b, psi_b), positions
        in mean radii; landmarks have zeros in the last three
    """

    a: int
    b: int
    sightings: int
    one_way: bool
    singular_values: Array
    directions: Array

    @property
    def rank(self) -> int:
        """Number of singular values above LINK_TOLERANCE times the largest."""
        return matrix_rank(self.singular_values, LINK_TOLERANCE)


@dataclass(frozen=True, slots=True)
class Observability:
    """Rank and conditioning of the windowed matrix of the whole team.

    Attributes
    ----------
    rank, state_dim : of the matrix; state_dim is three times the number of vehicles
    singular_values : (state_dim,) descending, scaled columns
    gap : ratio of the last singular value that counts to the first that does not; infinite
        where all count or the rest is exactly zero
    null_space : (state_dim - rank, state_dim) orthonormal unobservable directions, scaled columns
    variances : (state_dim,) diagonal of the information's pseudo-inverse, scaled columns: what one
        window leaves of uncertainty in each coordinate at time 0, where it is determined
    scale : m, the mean radius that positions are measured in
    """

    rank: int
    state_dim: int
    singular_values: Array
    gap: float
    null_space: Array
    variances: Array
    scale: float

    @property
    def observable(self) -> bool:
        """Whether every position and heading is determined."""
        return self.rank == self.state_dim

    @property
    def condition_number(self) -> float:
        """Largest over smallest singular value; infinite where unobservable."""
        if not self.observable:
            return float("inf")
        return float(self.singular_values[0] / self.singular_values[-1])

    @property
    def min_eigenvalue(self) -> float:
        """Smallest eigenvalue of the windowed information, scaled columns; 0 if unobservable."""
        return float(self.singular_values[-1] ** 2) if self.observable else 0.0


def pair_rows(team: Team, sightings: Sightings, scale: float | None = None) -> Iterator[PairRows]:
    """Yield the rows of each pair that is sighted at least once, ordered by (a, b)."""
    paired = of_targets(sightings.kinds)
    if not paired.all():
        sightings = sightings.only(paired)
    rows = sighting_rows(team, sightings, scale)
    swapped = (sightings.targets < team.count) & (sightings.targets < sightings.observers)
    rows = np.where(swapped[:, None], rows[:, [3, 4, 5, 0, 1, 2]], rows)
    a = np.where(swapped, sightings.targets, sightings.observers)
    b = np.where(swapped, sightings.observers, sightings.targets)
    order = np.lexsort((sightings.steps, b, a))
    a, b, rows, swapped = a[order], b[order], rows[order], swapped[order]
    steps = sightings.steps[order]
    first = np.flatnonzero((np.diff(a, prepend=-1) != 0) | (np.diff(b, prepend=-1) != 0))
    for begin, end in pairwise([*first.tolist(), len(a)]):
        ways = swapped[begin:end]
        yield PairRows(
            a=int(a[begin]),
            b=int(b[begin]),
            rows=rows[begin:end],
            steps=steps[begin:end],
            one_way=bool(ways.all() or not ways.any()),
        )


def link_information(
    team: Team, sightings: Sightings, scale: float | None = None
) -> list[LinkInformation]:
    """Return what the sightings of each pair determine, ordered by (a, b); none without sightings.

    Positions in mean radii, or in `scale` m: pass the same to `assess`.
    """
    links = []
    for pair in pair_rows(team, sightings, scale):
        _, values, directions = np.linalg.svd(pair.rows, full_matrices=False)
        links.append(
            LinkInformation(pair.a, pair.b, len(pair.rows), pair.one_way, values, directions)
        )
    return links


def lone_rows(team: Team, sightings: Sightings, scale: float | None = None) -> Array:
    """Return (r, 3 n) what each vehicle measures of itself, reduced to at most three rows each.

    Positions in mean radii, or in `scale` m.
    """
    alone = ~of_targets(sightings.kinds)
    if not alone.any():
        return np.zeros((0, 3 * team.count))
    own = sightings.only(alone)
    rows = sighting_rows(team, own, scale)[:, :3]
    blocks = []
    for vehicle in np.unique(own.observers).tolist():
        reduced = np.asarray(np.linalg.qr(rows[own.observers == vehicle], mode="r"))
        reduced = reduced[np.any(reduced != 0.0, axis=1)]
        block = np.zeros((len(reduced), 3 * team.count))
        block[:, 3 * vehicle : 3 * vehicle + 3] = reduced
        blocks.append(block)
    return np.concatenate(blocks)


def assess(
    team: Team,
    links: list[LinkInformation],
    alone: Array | None = None,
    scale: float | None = None,
) -> Observability:
    """Return rank, gap and unobservable directions of the windowed matrix.

    `alone` are the rows of `lone_rows`, None where there are none; `scale` in m is the one that
    both were computed with.
    """
    mean_radius = float(team.orbits.radii.mean())
    return judged_rank(team.count, links, mean_radius if scale is None else scale, alone)


def judged_rank(
    count: int, links: list[LinkInformation], scale: float, alone: Array | None = None
) -> Observability:
    """Return rank, gap and unobservable directions of the matrix of `count` vehicles.

    Whatever their paths are: `links` and `alone` are with positions in `scale` m.
    """
    size = 3 * count
    matrix = stacked_rows(links, count, alone)
    if len(matrix) > size:
        matrix = np.asarray(np.linalg.qr(matrix, mode="r"))
    values, null_space, variances = decomposed(matrix, size)
    rank = matrix_rank(values, RANK_TOLERANCE)
    return Observability(
        rank=rank,
        state_dim=size,
        singular_values=values,
        gap=rank_gap(values, rank),
        null_space=null_space,
        variances=variances,
        scale=scale,
    )


def stacked_rows(links: list[LinkInformation], count: int, alone: Array | None = None) -> Array:
    """Return the (r, 3 n) reduced rows of all links in the team's columns, about three a link.

    After them those of `alone`, what vehicles measure of themselves.
    """
    largest = max((float(link.singular_values[0]) for link in links), default=0.0)
    blocks = []
    for link in links:
        kept = link.singular_values > NEGLIGIBLE * largest
        rows = np.zeros((int(kept.sum()), 3 * count))
        reduced = link.singular_values[kept, None] * link.directions[kept]
        rows[:, 3 * link.a : 3 * link.a + 3] = reduced[:, :3]
        if link.b < count:
            rows[:, 3 * link.b : 3 * link.b + 3] = reduced[:, 3:]
        blocks.append(rows)
    if alone is not None and len(alone):
        blocks.append(alone)
    return np.concatenate(blocks) if blocks else np.zeros((0, 3 * count))
