"""The whole team's windowed information as a smooth function of its circles: sparse, by pairs.

Only pairs whose circles can come near each other's range, however far they are allowed to move,
enter. Each pair's ten sums land in fixed places of the sparse information matrix, whose LDL
factorisation CasADi carries out symbolically once; its derivative is the selected inverse.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from syncplan.blocks import Blocks, pair_blocks, single_blocks, stacked_blocks
from syncplan.refine_problem import RefineProblem
from syncplan.smooth_sightings import (
    ANCHOR_SUMS,
    PAIR_SUMS,
    SampleTimes,
    anchor_function,
    pair_function,
)

__all__ = ["Sighted", "SmoothTeam", "sighted_pairs"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_ALL_ROUND = 1e3
"""Half a view in rad that no bearing comes near the edge of."""

_FAR = 0.25
"""Share of the range by which pairs may stay out of range and still enter."""


@dataclass(frozen=True, slots=True)
class Sighted:
    """Pairs that may come into contact while circles move.

    Attributes
    ----------
    pairs : (e, 2) vehicles a < b; those to be kept first
    anchors : (k, 2) vehicle, landmark (from n on); those to be kept first
    """

    pairs: Index
    anchors: Index


@dataclass(frozen=True, slots=True)
class SmoothTeam:
    """The functions of all pairs that may meet, for the circles X (4, n) of a team, scaled.

    Attributes
    ----------
    sparsity : of the (3 n, 3 n) information matrix, all of it
    place : (nnz, sums) where each pair's sums go
    pair, anchor : functions of one pair, see syncplan.smooth_sightings
    """

    problem: RefineProblem
    sighted: Sighted
    sparsity: ca.Sparsity
    place: ca.DM
    pair: ca.Function
    anchor: ca.Function
    pair_parameters: Array
    anchor_parameters: Array

    @classmethod
    def of(cls, problem: RefineProblem, times: SampleTimes, *, each: bool = False) -> "SmoothTeam":
        """Return the team of a problem, seen at `times`; with `each`, sample by sample."""
        sighted = sighted_pairs(problem)
        sensors = problem.sensors
        views = bool(np.any(sensors.fields_of_view < 2.0 * np.pi))
        sparsity, place = _places(sighted, problem.orbits.count)
        return cls(
            problem,
            sighted,
            sparsity,
            place,
            pair_function(times, views, each),
            anchor_function(times, views, each),
            _pair_parameters(problem, sighted.pairs, views),
            _anchor_parameters(problem, sighted.anchors[:, 0], views),
        )

    def information(self, circles: ca.MX, width: float) -> ca.MX:
        """Return the non-zeros of the information, (nnz, 1), or (nnz, k) sample by sample."""
        widths = ca.DM([width, width, 0.0])
        pairs, anchors = self.sighted.pairs, self.sighted.anchors
        parts = []
        if len(pairs):
            function = self.pair.slice("pair_information", [0, 1, 2, 3], [0]).map(len(pairs))
            parts.append(
                function(
                    circles[:, pairs[:, 0].tolist()],
                    circles[:, pairs[:, 1].tolist()],
                    self.pair_parameters,
                    ca.repmat(widths, 1, len(pairs)),
                )
            )
        if len(anchors):
            function = self.anchor.slice("anchor_information", [0, 1, 2, 3], [0]).map(len(anchors))
            parts.append(
                function(
                    circles[:, anchors[:, 0].tolist()],
                    self._places_of(anchors[:, 1]),
                    self.anchor_parameters,
                    ca.repmat(widths, 1, len(anchors)),
                )
            )
        samples = self.pair.size2_out(0)
        # each pair's columns stand side by side: bring them below each other, one column a sample
        stacked = [
            ca.vertcat(*ca.horzsplit(part, samples)) if samples > 1 else ca.vec(part)
            for part in parts
        ]
        if not stacked:
            return ca.MX.zeros(self.sparsity.nnz(), samples)
        return self.place @ ca.vertcat(*stacked)

    def contacts(self, circles: ca.MX, width: float, safety: float) -> Blocks:
        """Return the logarithm of the samples in contact of what is to be kept.

        `safety` in m is added to the margins.
        """
        problem = self.problem
        kept, held = problem.pairs, problem.anchors
        blocks = []
        if len(kept):
            parameters = ca.DM(self.pair_parameters[:, : len(kept)])
            widths = self._widths(width, problem.pair_margins + safety)
            function = self.pair.slice("pair_contact", [0, 1, 2, 3], [1])
            lower, labels = np.log(problem.pair_samples), self._labels(kept, problem.pair_margins)
            blocks.append(pair_blocks(function, circles, kept, [parameters, widths], lower, labels))
        if len(held):
            parameters = ca.DM(self.anchor_parameters[:, : len(held)])
            widths = self._widths(width, problem.anchor_margins + safety)
            function = self.anchor.slice("anchor_contact", [0, 1, 2, 3], [1])
            lower = np.log(problem.anchor_samples)
            labels = self._labels(held, problem.anchor_margins)
            inputs = [self._places_of(held[:, 1]), parameters, widths]
            blocks.append(single_blocks(function, circles, held[:, 0], inputs, lower, labels))
        return stacked_blocks(blocks, problem.orbits.count)

    def _widths(self, width: float, margins: Array) -> ca.DM:
        steps = np.full((2, len(margins)), width)
        return ca.DM(np.concatenate([steps, margins[None] / self.problem.scale]))

    def _labels(self, pairs: Index, margins: Array) -> list[str]:
        names = self.problem.names
        return [
            f"contact of {names[a]}-{names[b]} (margin {margin:.3g} m)"
            for (a, b), margin in zip(pairs.tolist(), margins, strict=True)
        ]

    def _places_of(self, landmarks: Index) -> ca.DM:
        chosen = self.problem.landmarks[landmarks - self.problem.orbits.count]
        return ca.DM(chosen.T / self.problem.scale)


def sighted_pairs(problem: RefineProblem) -> Sighted:
    """Return the pairs and landmarks that may come near enough to be seen."""
    orbits, freedom = problem.orbits, problem.freedom
    n = orbits.count
    lower, upper = (
        np.nan_to_num(freedom.lower, neginf=-1e7),
        np.nan_to_num(freedom.upper, posinf=1e7),
    )
    slack = np.hypot(*(0.5 * (upper[:2] - lower[:2])))
    middle = 0.5 * (upper[:2] + lower[:2]).T
    reach = problem.sensors.ranges * (1.0 + _FAR)
    a, b = np.triu_indices(n, 1)
    away = np.hypot(*(middle[a] - middle[b]).T) - slack[a] - slack[b]
    near = away - upper[2, a] - upper[2, b] <= np.maximum(reach[a], reach[b])
    kept = {(int(i), int(j)) for i, j in problem.pairs}
    others = [(int(i), int(j)) for i, j in zip(a[near], b[near], strict=True)]
    pairs = [*map(tuple, problem.pairs.tolist()), *(one for one in others if one not in kept)]
    vehicle, place = (index.ravel() for index in np.indices((n, len(problem.landmarks))))
    away = np.hypot(*(middle[vehicle] - problem.landmarks[place]).T) - slack[vehicle]
    near = away - upper[2, vehicle] <= reach[vehicle]
    held = {(int(i), int(j)) for i, j in problem.anchors}
    seen = [(int(i), int(j) + n) for i, j in zip(vehicle[near], place[near], strict=True)]
    anchors = [*map(tuple, problem.anchors.tolist()), *(one for one in seen if one not in held)]
    return Sighted(_as_pairs(pairs), _as_pairs(anchors))


def _as_pairs(pairs: list[tuple[int, ...]]) -> Index:
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _pair_parameters(problem: RefineProblem, pairs: Index, views: bool) -> Array:
    """(8 or 12, e) as `pair_function` wants them."""
    sensors, senses = problem.sensors, problem.orbits.senses
    a, b = pairs[:, 0], pairs[:, 1]
    ranges = sensors.ranges / problem.scale
    inverse = 1.0 / sensors.bearing_sigmas**2
    share = _shares(problem, pairs)
    rows = [senses[a], senses[b], ranges[a], ranges[b], inverse[a], inverse[b], *share]
    if views:
        half, boresights = 0.5 * sensors.fields_of_view, sensors.boresights
        half = np.where(half >= np.pi, _ALL_ROUND, half)
        rows += [half[a], half[b], boresights[a], boresights[b]]
    return np.array(rows, dtype=float).reshape(len(rows), len(pairs))


def _shares(problem: RefineProblem, pairs: Index) -> tuple[Array, Array]:
    """What either way of seeing counts for contact: half each, all of it where ranges differ."""
    ranges = problem.sensors.ranges
    a, b = ranges[pairs[:, 0]], ranges[pairs[:, 1]]
    alike = np.isclose(a, b)
    return np.where(alike, 0.5, a > b).astype(float), np.where(alike, 0.5, b > a).astype(float)


def _anchor_parameters(problem: RefineProblem, vehicles: Index, views: bool) -> Array:
    """(3 or 5, k) as `anchor_function` wants them."""
    sensors = problem.sensors
    rows = [
        problem.orbits.senses[vehicles],
        sensors.ranges[vehicles] / problem.scale,
        1.0 / sensors.bearing_sigmas[vehicles] ** 2,
    ]
    if views:
        half = 0.5 * sensors.fields_of_view[vehicles]
        rows += [np.where(half >= np.pi, _ALL_ROUND, half), sensors.boresights[vehicles]]
    return np.array(rows, dtype=float).reshape(len(rows), len(vehicles))


def _places(sighted: Sighted, count: int) -> tuple[ca.Sparsity, ca.DM]:
    """Sparsity of the information, and the matrix that adds each pair's sums into its non-zeros."""
    entries: list[tuple[int, int, int, float]] = []
    for k, (a, b) in enumerate((3 * sighted.pairs).tolist()):
        entries += [
            (row, column, PAIR_SUMS * k + source, sign)
            for row, column, source, sign in _pair_entries(a, b)
        ]
    offset = PAIR_SUMS * len(sighted.pairs)
    for k, a in enumerate((3 * sighted.anchors[:, 0]).tolist()):
        for source, (i, j) in enumerate(((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))):
            entries.append((a + i, a + j, offset + ANCHOR_SUMS * k + source, 1.0))
    entries += [
        (column, row, source, sign) for row, column, source, sign in entries if row != column
    ]
    size = 3 * count
    rows, columns = [one[0] for one in entries], [one[1] for one in entries]
    sparsity = ca.Sparsity.triplet(size, size, rows, columns) + ca.Sparsity.diag(size)
    position = {place: k for k, place in enumerate(zip(*sparsity.get_triplet(), strict=True))}
    place = ca.DM.triplet(
        [position[row, column] for row, column in zip(rows, columns, strict=True)],
        [one[2] for one in entries],
        ca.DM([one[3] for one in entries]),
        sparsity.nnz(),
        offset + ANCHOR_SUMS * len(sighted.anchors),
    )
    return sparsity, place


def _pair_entries(a: int, b: int) -> list[tuple[int, int, int, float]]:
    """(row, column, sum, sign) of a pair's entries, one of each symmetric two."""
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
