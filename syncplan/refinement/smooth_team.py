"""Windowed information of the whole team as a smooth, sparse function of its circles.

Only pairs enter that can come near each other's range, wherever their circles may move. Each
pair's ten sums go to fixed places of the sparse information matrix. CasADi finds the pattern of its
LDL factorisation once; the derivative is the inverse on that pattern.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from syncplan.arrays import Index, as_pairs
from syncplan.orbits.sighting_kinds import COMPASS
from syncplan.refinement.problem import RefineProblem, SampleTimes
from syncplan.refinement.smooth_sightings import (
    ANCHOR_SUMS,
    PAIR_SUMS,
    Paths,
    anchor_information,
    compass_information,
    pair_information,
)

_FAR = 0.25
"""Share of the range by which pairs may be out of range and still enter."""


@dataclass(frozen=True, slots=True)
class SmoothTeam:
    """Information of a team as a function of its scaled circles X (4, n).

    Attributes
    ----------
    sighted : (s, 2) bodies that may come into contact, as `sighted_bodies` returns them
    times : samples that information is summed over
    sparsity : of the whole information matrix (3 n, 3 n)
    place : (nnz, sums) matrix that adds the sums into the non-zeros
    """

    problem: RefineProblem
    sighted: Index
    times: SampleTimes
    sparsity: ca.Sparsity
    place: ca.DM

    @classmethod
    def of(cls, problem: RefineProblem, times: SampleTimes) -> "SmoothTeam":
        """Return the team of a problem, seen at `times`."""
        sighted = sighted_bodies(problem)
        sparsity, place = _places(sighted, problem.orbits.count, _compasses(problem))
        return cls(problem, sighted, times, sparsity, place)

    def information(self, circles: ca.MX, width: float) -> ca.MX:
        """Return the non-zeros (nnz, 1) of the information on the poses at time 0."""
        paths = Paths.of(circles, self.problem.team, self.times, self.problem.scale)
        compasses = _compasses(self.problem).tolist()
        known = ca.MX(compass_information(paths)[compasses, :])
        parts = ca.vertcat(*self._of_targets(paths, width, each=False), known)
        return ca.densify(self.place @ parts)

    def information_now(self, circles: ca.MX, width: float) -> ca.MX:
        """Return the non-zeros (nnz, k) of the information on the poses at each sample.

        It is that of the sample's own sightings, without compasses.
        """
        problem = self.problem
        paths = Paths.of(circles, problem.team, self.times, problem.scale).begun_at_each()
        parts = ca.vertcat(
            ca.MX(0, len(self.times.angles)), *self._of_targets(paths, width, each=True)
        )
        return ca.densify(self.place[:, : parts.size1()] @ parts)

    def _of_targets(self, paths: Paths, width: float, each: bool) -> list[ca.MX]:
        """Terms of pairs, then of landmarks, where there are any."""
        problem, count = self.problem, self.problem.orbits.count
        pairs, anchors = _pairs_and_anchors(self.sighted, count)
        parts = []
        if len(pairs):
            parts.append(pair_information(paths, pairs, width, each))
        if len(anchors):
            places = problem.landmarks[anchors[:, 1] - count] / problem.scale
            parts.append(anchor_information(paths, anchors[:, 0], places, width, each))
        return parts


def sighted_bodies(problem: RefineProblem) -> Index:
    """Return the bodies (s, 2) that may come within range of each other while circles move.

    Pairs of vehicles a < b, then vehicles and landmarks, which number from n on; of either, first
    the contacts to be kept.
    """
    freedom, count = problem.freedom, problem.orbits.count
    lower, upper = (
        np.nan_to_num(freedom.lower, neginf=-1e7),
        np.nan_to_num(freedom.upper, posinf=1e7),
    )
    moves = np.hypot(*(0.5 * (upper[:2] - lower[:2])))
    middle = 0.5 * (upper[:2] + lower[:2]).T
    reach = problem.sensors.ranges * (1.0 + _FAR)
    a, b = np.triu_indices(count, 1)
    away = np.hypot(*(middle[a] - middle[b]).T) - moves[a] - moves[b]
    near = away - upper[2, a] - upper[2, b] <= np.maximum(reach[a], reach[b])
    vehicle, place = (index.ravel() for index in np.indices((count, len(problem.landmarks))))
    away = np.hypot(*(middle[vehicle] - problem.landmarks[place]).T) - moves[vehicle]
    seen = away - upper[2, vehicle] <= reach[vehicle]
    found: list[tuple[int, int]] = []
    for kept, others in zip(
        _pairs_and_anchors(problem.kept, count),
        ((a[near], b[near]), (vehicle[seen], count + place[seen])),
        strict=True,
    ):
        every = np.concatenate([kept, np.column_stack(others)])
        # a dictionary keeps the order of its keys
        found += dict.fromkeys((i, j) for i, j in every.tolist())
    return as_pairs(found)


def _pairs_and_anchors(bodies: Index, count: int) -> tuple[Index, Index]:
    """Bodies (k, 2) split into pairs of vehicles and vehicles with landmarks."""
    to_landmark = bodies[:, 1] >= count
    return bodies[~to_landmark], bodies[to_landmark]


def _compasses(problem: RefineProblem) -> Index:
    """Vehicles with a compass."""
    return np.flatnonzero(COMPASS.sigmas(problem.sensors) < np.inf)


def _places(sighted: Index, count: int, compasses: Index) -> tuple[ca.Sparsity, ca.DM]:
    """Sparsity of the information, and the matrix that adds all sums into its non-zeros.

    The sums are those of pairs, then of landmarks, then one of each compass.
    """
    pairs, anchors = _pairs_and_anchors(sighted, count)
    entries: list[tuple[int, int, int, float]] = []
    for k, (a, b) in enumerate((3 * pairs).tolist()):
        entries += [
            (row, column, len(pairs) * one + k, sign)
            for row, column, one, sign in _pair_entries(a, b)
        ]
    offset = PAIR_SUMS * len(pairs)
    for k, a in enumerate((3 * anchors[:, 0]).tolist()):
        for one, (i, j) in enumerate(((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))):
            entries.append((a + i, a + j, offset + len(anchors) * one + k, 1.0))
    offset += ANCHOR_SUMS * len(anchors)
    entries += [(3 * v + 2, 3 * v + 2, offset + k, 1.0) for k, v in enumerate(compasses.tolist())]
    mirrored = [(column, row, one, sign) for row, column, one, sign in entries if row != column]
    entries += mirrored
    size = 3 * count
    rows, columns = [one[0] for one in entries], [one[1] for one in entries]
    sparsity = ca.Sparsity.triplet(size, size, rows, columns) + ca.Sparsity.diag(size)
    position = {place: k for k, place in enumerate(zip(*sparsity.get_triplet(), strict=True))}
    place = ca.DM.triplet(
        [position[row, column] for row, column in zip(rows, columns, strict=True)],
        [one[2] for one in entries],
        ca.DM([one[3] for one in entries]),
        sparsity.nnz(),
        offset + len(compasses),
    )
    return sparsity, place


def _pair_entries(a: int, b: int) -> list[tuple[int, int, int, float]]:
    """Entries (row, column, sum, sign) of a pair, one of each two symmetric ones."""
    entries = []
    for start in (a, b):
        entries += [
            (start, start, 0, 1.0),
            (start, start + 1, 1, 1.0),
            (start + 1, start + 1, 2, 1.0),
        ]
    entries += [(a, b, 0, -1.0), (a, b + 1, 1, -1.0), (a + 1, b, 1, -1.0), (a + 1, b + 1, 2, -1.0)]
    for heading, first in ((a + 2, 3), (b + 2, 5)):
        for axis in (0, 1):
            entries += [
                (a + axis, heading, first + axis, 1.0),
                (b + axis, heading, first + axis, -1.0),
            ]
    return [*entries, (a + 2, a + 2, 7, 1.0), (b + 2, b + 2, 8, 1.0), (a + 2, b + 2, 9, 1.0)]


# --- determinants and window bounds ---------------------------------------------------------------
#
# A sparse LDL factorisation yields log det W. Its derivative by W is the inverse on W's own
# sparsity, which holds each vehicle's position block; the trace of that block is the vehicle's
# window bound, squared.


RELATIVE_SHIFT = 1e-9
"""Shift of W's diagonal, in information units, so that log det W exists for unobservable teams."""

_WORST_POWER = 20.0
"""Exponent of the norm over vehicles' variances that stands for the largest."""


def log_determinant(sparsity: ca.Sparsity) -> ca.Function:
    """Return the function (non-zeros of W, shift) -> log det (W + shift I)."""
    entries, shift = ca.SX.sym("W", sparsity.nnz()), ca.SX.sym("shift")
    matrix = ca.SX(sparsity, entries)
    pivots, _, _ = ca.ldl(matrix + shift * ca.SX.eye(sparsity.size1()), True)
    return ca.Function("log_determinant", [entries, shift], [ca.sum1(ca.log(pivots))])


def window_variances(sparsity: ca.Sparsity, problem: RefineProblem) -> ca.Function:
    """Return the function (non-zeros of W) -> (n,) squares of the window bounds, scaled."""
    shift = RELATIVE_SHIFT * problem.information_unit
    entries = ca.SX.sym("W", sparsity.nnz())
    matrix = ca.SX(sparsity, entries)
    pivots, _, _ = ca.ldl(matrix + shift * ca.SX.eye(sparsity.size1()), True)
    slope = ca.gradient(ca.sum1(ca.log(pivots)), entries)
    place = {one: k for k, one in enumerate(zip(*sparsity.get_triplet(), strict=True))}
    variances = [
        slope[place[3 * k, 3 * k]] + slope[place[3 * k + 1, 3 * k + 1]]
        for k in range(sparsity.size1() // 3)
    ]
    return ca.Function("window_variances", [entries], [ca.vertcat(*variances)])


def window_excess(sparsity: ca.Sparsity, information: ca.MX, problem: RefineProblem) -> ca.MX:
    """Return the logarithm of the worst vehicle's window bound over its limit; met at 0 or less.

    A norm over the vehicles stands for the worst, so it is never less than the true worst.
    """
    entries = ca.SX.sym("W", sparsity.nnz())
    limit = (problem.window_limit / problem.scale) ** 2
    ratio = ca.log(window_variances(sparsity, problem)(entries) / limit)
    excess = ca.logsumexp(_WORST_POWER * ratio) / (2.0 * _WORST_POWER)
    return ca.Function("window_excess", [entries], [excess])(information)
