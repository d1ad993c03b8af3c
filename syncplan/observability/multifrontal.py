"""Multifrontal QR of a sparse matrix whose rows touch few vehicles each.

    places, links -> dissection -> fronts, from the leaves to the root -> R -> what is needed of R

Nested dissection cuts the team in two by position and eliminates the vehicles along the cut after
both halves, and so on within each half. The front of a part holds the rows that touch its columns
and what is left of the rows of earlier parts, as a dense matrix over these columns and the later
ones that they meet. Its QR gives the rows of R for its own columns; the rest goes to the front
that owns the first remaining column. Nothing is squared.

    [ T  A  B ]     T  triangle of the columns that have a pivot
    [ 0  0  C ]     A  columns of its own without one; B later columns; C goes on

A column whose pivot is lost in rounding is set aside. With its coordinate at 1 and the others set
aside at 0, back substitution gives a vector that M maps to about zero, and no such vector depends
on another: they are as many as the null vectors found. Such a vector is zero outside the parts
below its own.

Sources
-------
nested dissection : George, "Nested dissection of a regular finite element mesh", SIAM Journal on
    Numerical Analysis 10(2), 1973
multifrontal QR : Davis, "Algorithm 915, SuiteSparseQR", ACM Transactions on Mathematical Software
    38(1), 2011
selected inversion : Takahashi, Fagan, Chin, "Formation of a sparse bus impedance matrix", PICA
    1973; here by fronts, from the root to the leaves
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index

PIVOT = 1e-13
"""Share of the longest column of any block below which a pivot is lost in rounding."""

LEAF = 16
"""Number of vehicles that are not cut any further."""

Block = tuple[Index, Array]
"""Columns (c,) of a dense block of rows, and the rows (r, c)."""


def dissected(places: Array, links: Index) -> list[Index]:
    """Return the vehicles of each part of a team, in order of elimination.

    `places` is (n, 2), `links` (e, 2). No link joins two parts unless the later one is a cut above
    the earlier one.
    """
    parts: list[Index] = []
    near = np.zeros(len(places), dtype=bool)
    state = np.zeros(len(places), dtype=bool)

    def divide(own: Index, inner: Index) -> None:
        if len(own) <= LEAF:
            parts.append(own)
            return
        side = _nearer_half(places[own])
        near[own] = side
        across = inner[near[inner[:, 0]] != near[inner[:, 1]]]
        ends = np.where(near[across[:, 0]][:, None], across, across[:, ::-1])
        cut = min((np.unique(one) for one in ends.T), key=len)
        if 2 * len(cut) > len(own):
            parts.append(own)
            return
        state[cut] = True
        left = inner[~(state[inner].any(axis=1))]
        sides = [own[half & ~state[own]] for half in (side, ~side)]
        state[cut] = False
        first = near[left[:, 0]]
        for half, rest in zip(sides, (left[first], left[~first]), strict=True):
            if len(half):
                divide(half, rest)
        if len(cut):
            parts.append(cut)

    if len(places):
        divide(np.arange(len(places)), links)
    return parts


def _nearer_half(places: Array) -> Flags:
    """Whether each place lies before the middle of the longer side."""
    along = places[:, int(np.argmax(np.ptp(places, axis=0)))]
    side = np.asarray(along < np.median(along))
    if 4 * min(side.sum(), (~side).sum()) < len(side):
        side = np.zeros(len(side), dtype=bool)
        side[np.argsort(along, kind="stable")[: len(side) // 2]] = True
    return side


@dataclass(frozen=True, slots=True)
class Front:
    """Rows of R of one part. Columns are numbered in the order of elimination.

    Attributes
    ----------
    own : (k,) columns that have a pivot
    aside : (s,) columns of the part without one
    later : (s + b,) those set aside, then the later columns that its rows meet
    triangle : (k, k) upper
    beside : (k, s + b) columns of `later`
    below : number of the first front whose rows went on to this one; its own where none did
    """

    own: Index
    aside: Index
    later: Index
    triangle: Array
    beside: Array
    below: int


@dataclass(frozen=True, slots=True)
class Factor:
    """Triangle R of a matrix M = Q R by fronts. Vectors have all N columns.

    Attributes
    ----------
    fronts : in order of elimination
    order : (N,) original number of each column in order of elimination
    """

    fronts: list[Front]
    order: Index

    @property
    def aside(self) -> Index:
        """Columns set aside, in order of elimination; their number is at most the nullity."""
        return np.concatenate([front.aside for front in self.fronts])

    def solve(self, sides: Array) -> Array:
        """Return R^-1 `sides` (N, k), with the coordinates set aside at zero."""
        found = np.zeros_like(sides)
        self._back(found, sides, 0, self.fronts)
        return found

    def solve_transposed(self, sides: Array) -> Array:
        """Return R^-T `sides` (N, k), zero for columns set aside."""
        left, found = sides.copy(), np.zeros_like(sides)
        for front in self.fronts:
            if len(front.own):
                half = _triangular(front.triangle, left[front.own], transposed=True)
                found[front.own] = half
                left[front.later] -= front.beside.T @ half
        return found

    def null_vectors(self) -> Iterator[tuple[slice, Array]]:
        """Yield columns and vectors (c, s) for the columns that each front has set aside."""
        ends = np.cumsum([0, *(len(front.own) + len(front.aside) for front in self.fronts)])
        for number, front in enumerate(self.fronts):
            if len(front.aside):
                columns = slice(int(ends[front.below]), int(ends[number + 1]))
                found = np.zeros((columns.stop - columns.start, len(front.aside)))
                found[front.aside - columns.start] = np.eye(len(front.aside))
                below = self.fronts[front.below : number + 1]
                self._back(found, np.zeros_like(found), columns.start, below)
                yield columns, found

    def variances(self) -> Array:
        """Return (N,) diagonal of (R^T R)^-1, with the columns set aside taken as known."""
        found = np.zeros(len(self.order))
        known: dict[int, tuple[Index, Array]] = {}
        children: dict[int, list[int]] = {}
        owner = self._owners()
        for number, front in enumerate(self.fronts):
            outside = front.later[len(front.aside) :]
            if len(outside):
                children.setdefault(int(owner[outside[0]]), []).append(number)
        for number in range(len(self.fronts) - 1, -1, -1):
            front = self.fronts[number]
            outside = front.later[len(front.aside) :]
            above, covariance = known.pop(number, (outside[:0], np.zeros((0, 0))))
            place = np.searchsorted(above, outside)
            over = covariance[np.ix_(place, place)]
            inverse = _triangular(front.triangle, np.eye(len(front.own)))
            gain = inverse @ front.beside[:, len(front.aside) :]
            across = gain @ over
            block = np.zeros((len(front.own) + len(outside),) * 2)
            k = len(front.own)
            block[:k, :k] = inverse @ inverse.T + across @ gain.T
            block[:k, k:], block[k:, :k] = -across, -across.T
            block[k:, k:] = over
            found[front.own] = np.diagonal(block)[:k]
            if own := children.get(number):
                # a column set aside is known: its rows and columns are zero
                columns = np.concatenate([front.own, outside, front.aside])
                whole = np.zeros((len(columns),) * 2)
                whole[: len(block), : len(block)] = block
                order = np.argsort(columns)
                passed = columns[order], whole[np.ix_(order, order)]
                known.update(dict.fromkeys(own, passed))
        return found

    def _back(self, found: Array, sides: Array, offset: int, fronts: Sequence[Front]) -> None:
        for front in reversed(fronts):
            if len(front.own):
                later = front.later - offset
                inside = later < len(found)
                rest = front.beside[:, inside] @ found[later[inside]]
                own = front.own - offset
                found[own] = _triangular(front.triangle, sides[own] - rest)

    def _owners(self) -> Index:
        owner = np.zeros(len(self.order), dtype=np.int64)
        for number, front in enumerate(self.fronts):
            owner[front.own] = owner[front.aside] = number
        return owner


def factored(
    blocks: Sequence[Block], parts: Sequence[Index], size: int, aside: Sequence[int] = ()
) -> Factor:
    """Return the factor of the rows of all blocks.

    `parts` holds the columns (c,) of each part in order of elimination, each column once. All
    columns of a block lie in one part and the cuts above it. Columns in `aside` are set aside
    whatever their pivot.
    """
    order = np.concatenate(parts)
    number = np.empty(size, dtype=np.int64)
    number[order] = np.arange(size)
    ends = np.cumsum([0, *map(len, parts)])
    owner = np.repeat(np.arange(len(parts)), np.diff(ends))
    waiting: list[list[Block]] = [[] for _ in parts]
    below = list(range(len(parts)))
    longest, denied = 0.0, np.isin(order, aside)
    for columns, rows in blocks:
        own = number[columns]
        sort = np.argsort(own)
        if len(rows):
            waiting[owner[own[sort[0]]]].append((own[sort], rows[:, sort]))
            longest = max(longest, float(np.max(np.sum(rows * rows, axis=0))))
    fronts, least = [], PIVOT * np.sqrt(longest)
    for k in range(len(parts)):
        own = np.arange(ends[k], ends[k + 1])
        front, rest = _front(own, waiting[k], below[k], least, denied[own])
        waiting[k] = []
        fronts.append(front)
        # its columns meet in R even where no rows are left
        if len(rest[0]):
            above = int(owner[rest[0][0]])
            waiting[above].append(rest)
            below[above] = min(below[above], below[k])
    return Factor(fronts, order)


def _front(
    own: Index, blocks: list[Block], below: int, least: float, denied: Flags
) -> tuple[Front, Block]:
    """The front of a part from its rows, and the rows that are left.

    Pivots up to `least` do not count, nor those of columns that are `denied` one.
    """
    met = np.unique(np.concatenate([own, *(columns for columns, _ in blocks)]))
    later = met[len(own) :]
    matrix = np.zeros((sum(len(rows) for _, rows in blocks), len(met)))
    begins = 0
    for columns, rows in blocks:
        matrix[begins : begins + len(rows), np.searchsorted(met, columns)] = rows
        begins += len(rows)
    if len(matrix):
        matrix = np.asarray(np.linalg.qr(matrix, mode="r"))
    kept, aside = np.arange(len(own)), np.zeros(0, dtype=np.int64)
    while True:
        pivots = np.abs(np.diagonal(matrix[:, : len(kept)]))
        weak = np.flatnonzero((pivots <= least) | denied[kept[: len(pivots)]])
        first = int(weak[0]) if len(weak) else len(pivots)
        if first == len(kept):
            break
        # the column depends on those before it: it follows the part's other columns
        aside = np.append(aside, kept[first])
        kept = np.delete(kept, first)
        moved = np.r_[0:first, first + 1 : matrix.shape[1] - len(later), first]
        moved = np.r_[moved, matrix.shape[1] - len(later) : matrix.shape[1]]
        matrix = matrix[:, moved]
        if first < len(matrix):
            matrix[first:, first:] = _upper(matrix[first:, first:])
    k, s = len(kept), len(aside)
    # rounding is left of the columns set aside
    rest = matrix[k:, k + s :]
    rest = rest[np.any(rest != 0.0, axis=1)]
    if len(rest) > len(later):
        rest = np.asarray(np.linalg.qr(rest, mode="r"))
    front = Front(
        own=own[kept],
        aside=own[aside],
        later=np.concatenate([own[aside], later]),
        triangle=np.ascontiguousarray(matrix[:k, :k]),
        beside=np.ascontiguousarray(matrix[:k, k:]),
        below=below,
    )
    return front, (later, rest)


def _upper(matrix: Array) -> Array:
    """The matrix made upper trapezoidal by QR, with as many rows."""
    found = np.zeros_like(matrix)
    reduced = np.linalg.qr(matrix, mode="r")
    found[: len(reduced)] = reduced
    return found


def _triangular(triangle: Array, sides: Array, *, transposed: bool = False) -> Array:
    """Return T^-1 `sides` (k, s), or T^-T `sides`, for an upper triangle."""
    from scipy.linalg.blas import dtrsm

    if not sides.size:
        return sides
    # BLAS is column-major, so it takes the transposes as they lie in memory
    found = dtrsm(1.0, triangle.T, sides.T, side=1, lower=1, trans_a=transposed)
    return np.asarray(found, dtype=float).T
