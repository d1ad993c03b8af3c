"""Windowed observability: the matrix of equations (5)-(9) in closed form, rank, certificate.

    windows -> sampled sightings -> what each pair determines -> rank -> certificate

This chain judges plans and every candidate of a refinement.

Rows are those of syncplan.observability.referred_rows. Each link's rows are first reduced to at
most six by its own singular value decomposition. This orthogonal change of the rows keeps the
singular values of the whole matrix, and nothing is ever squared.

Bearings and distances of a pair are rows of one link. A vehicle's measurements of itself, such as
those of a compass, belong to no link: their rows enter the matrix separately.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from syncplan.arrays import Array, Index, as_pairs
from syncplan.observability.multifrontal import Block, dissected
from syncplan.observability.referred_rows import sighting_rows
from syncplan.observability.spectrum import (
    DENSE_STATES,
    Observability,
    dense_matrix,
    matrix_rank,
    observability_of,
)
from syncplan.orbits.contacts import Windows, find_windows
from syncplan.orbits.graphs import components, spanning_forest
from syncplan.orbits.sighting_kinds import of_targets
from syncplan.orbits.sightings import Remainder, Sightings, sightings_over
from syncplan.orbits.team import Team

# --- links and the team ---------------------------------------------------------------------------


NEGLIGIBLE = 1e-15
"""Share of the largest singular value of any link below which rows are left out."""

LINK_TOLERANCE = 1e-6
"""Share of a link's largest singular value above which a singular value of the link counts."""


@dataclass(frozen=True, slots=True)
class PairRows:
    """Rows of one pair's sightings, in both directions, in order of time.

    Attributes
    ----------
    a, b : indices, a < b; b is a landmark if b >= n
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
    """Information on the poses of one pair from its sightings in both directions.

    Attributes
    ----------
    a, b : indices, a < b; b is a landmark if b >= n
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


def equal_runs(*keys: Index) -> list[tuple[int, int]]:
    """Return begin and end of each run over which all keys, (k,) and 0 or more, stay equal."""
    new = np.zeros(len(keys[0]), dtype=bool)
    for key in keys:
        new |= np.diff(key, prepend=-1) != 0
    return list(pairwise([*np.flatnonzero(new).tolist(), len(new)]))


def rows_by_pair(
    rows: Array, observers: Index, targets: Index, steps: Index, count: int
) -> Iterator[PairRows]:
    """Yield the rows of each pair, ordered by (a, b) and, within a pair, by step.

    `rows` (s, 6) has the observer's three columns, then the target's; targets from `count` on are
    landmarks.
    """
    swapped = (targets < count) & (targets < observers)
    rows = np.where(swapped[:, None], rows[:, [3, 4, 5, 0, 1, 2]], rows)
    a, b = np.where(swapped, targets, observers), np.where(swapped, observers, targets)
    order = np.lexsort((steps, b, a))
    a, b, rows, swapped, steps = a[order], b[order], rows[order], swapped[order], steps[order]
    for begin, end in equal_runs(a, b):
        ways = swapped[begin:end]
        yield PairRows(
            a=int(a[begin]),
            b=int(b[begin]),
            rows=rows[begin:end],
            steps=steps[begin:end],
            one_way=bool(ways.all() or not ways.any()),
        )


def pair_rows(team: Team, sightings: Sightings, scale: float | None = None) -> Iterator[PairRows]:
    """Yield the rows of each pair that is sighted at least once, ordered by (a, b)."""
    paired = of_targets(sightings.kinds)
    if not paired.all():
        sightings = sightings.only(paired)
    rows = sighting_rows(team, sightings, scale)
    return rows_by_pair(rows, sightings.observers, sightings.targets, sightings.steps, team.count)


def link_of(pair: PairRows) -> LinkInformation:
    """Return the information of a pair's rows."""
    _, values, directions = np.linalg.svd(pair.rows, full_matrices=False)
    return LinkInformation(pair.a, pair.b, len(pair.rows), pair.one_way, values, directions)


def link_information(
    team: Team, sightings: Sightings, scale: float | None = None
) -> list[LinkInformation]:
    """Return the information of each pair that has sightings, ordered by (a, b).

    Positions are in mean radii, or in `scale` m; pass the same `scale` to `assess`.
    """
    return [link_of(pair) for pair in pair_rows(team, sightings, scale)]


def lone_rows(team: Team, sightings: Sightings, scale: float | None = None) -> list[Block]:
    """Return the rows (r, 3) of vehicles' measurements of themselves, at most three each.

    Positions are in mean radii, or in `scale` m.
    """
    alone = ~of_targets(sightings.kinds)
    if not alone.any():
        return []
    own = sightings.only(alone)
    rows = sighting_rows(team, own, scale)[:, :3]
    order = np.argsort(own.observers, kind="stable")
    blocks = []
    for begin, end in equal_runs(own.observers[order]):
        reduced = np.asarray(np.linalg.qr(rows[order[begin:end]], mode="r"))
        vehicle = own.observers[order[begin]]
        blocks.append((3 * vehicle + np.arange(3), reduced[np.any(reduced != 0.0, axis=1)]))
    return blocks


def assess(
    team: Team,
    links: list[LinkInformation],
    alone: Sequence[Block] = (),
    scale: float | None = None,
) -> Observability:
    """Return rank, gap and unobservable directions of the windowed matrix.

    `alone` holds the rows of `lone_rows`, if any. `scale` in m is the one that `links` and `alone`
    were computed with; with it, all singular values are computed.
    """
    mean_radius = float(team.orbits.radii.mean())
    places = team.orbits.centers if scale is None else None
    return judged_rank(team.count, links, mean_radius if scale is None else scale, alone, places)


def judged_rank(
    count: int,
    links: list[LinkInformation],
    scale: float,
    alone: Sequence[Block] = (),
    places: Array | None = None,
) -> Observability:
    """Return rank, gap and unobservable directions of the matrix of `count` vehicles.

    Their paths may be of any shape. `links` and `alone` have positions in `scale` m. By their
    `places` (count, 2) large teams are dissected; without them, their matrix is dense.
    """
    size, parts = 3 * count, None
    if places is not None and size > DENSE_STATES:
        pairs = as_pairs([(link.a, link.b) for link in links if link.b < count])
        poses = np.arange(size).reshape(-1, 3)
        parts = [poses[part].ravel() for part in dissected(places, pairs)]
    return observability_of(reduced_blocks(links, count, alone), size, scale, parts)


def reduced_blocks(
    links: list[LinkInformation], count: int, alone: Sequence[Block] = ()
) -> list[Block]:
    """Return the reduced rows of all links in the team's columns, about three per link.

    Those of `alone`, vehicles' measurements of themselves, follow.
    """
    largest = max((float(link.singular_values[0]) for link in links), default=0.0)
    blocks = []
    for link in links:
        kept = link.singular_values > NEGLIGIBLE * largest
        rows = link.singular_values[kept, None] * link.directions[kept]
        ends = np.array([link.a, link.b][: 2 if link.b < count else 1])
        columns = (3 * ends[:, None] + np.arange(3)).ravel()
        blocks.append((columns, rows[:, : len(columns)]))
    return [*blocks, *alone]


def stacked_rows(links: list[LinkInformation], count: int, alone: Sequence[Block] = ()) -> Array:
    """Return these rows as a dense matrix (r, 3 n)."""
    return dense_matrix(reduced_blocks(links, count, alone), 3 * count)


# --- the certificate ------------------------------------------------------------------------------
#
# Drop the landmarks and keep the vehicle links of rank 3. The team is observable if every connected
# component of vehicles has links of rank 2 to two distinct landmarks (as printed in the paper, the
# theorem also accepts components joined only through a landmark, which can turn about it unseen).
# Sufficient, not necessary: the rank of the windowed matrix decides, the certificate explains.
#
# A link counts if the singular value that its rank rests on exceeds LINK_TOLERANCE times its own
# largest, and also times the largest of the whole team's matrix. Its own largest is not enough:
# next to a close pass elsewhere, a distant link that barely has rank 3 is lost in rounding, and the
# team's rank, judged at RANK_TOLERANCE of the overall largest, falls short of the certificate.
#
#     L1        L2            two landmarks hold each component ...
#       \      /
#        v3 - v4              ... whose vehicles a tree of rank-3 links makes rigid
#        |     |
#        v2    v5


DISTINCT_LANDMARKS = 0.1
"""Share of the mean radius beyond which two landmarks count as distinct."""


@dataclass(frozen=True, slots=True)
class WitnessTree:
    """Two landmark links and a spanning tree of vehicle links that make a component observable.

    Attributes
    ----------
    vehicles : indices in the component
    landmark_links : ((vehicle, landmark), (vehicle, landmark)), to distinct landmarks
    vehicle_links : (a, b) pairs of a spanning tree, all of rank 3
    """

    vehicles: tuple[int, ...]
    landmark_links: tuple[tuple[int, int], ...]
    vehicle_links: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Certificate:
    """Certificate of the corrected Theorem 3.3, with its witness or the component that fails.

    Attributes
    ----------
    lacking : vehicles of the first component that fails; empty if the certificate holds
    anchors : landmarks to which that component has links of rank 2
    """

    holds: bool
    witness: tuple[WitnessTree, ...]
    lacking: tuple[int, ...] = ()
    anchors: tuple[int, ...] = ()


def counts(link: LinkInformation, needed: int, largest: float) -> bool:
    """Return whether a link has rank `needed` for the certificate.

    `largest` is the largest singular value of the whole team's matrix.
    """
    values = link.singular_values
    if len(values) < needed:
        return False
    return bool(values[needed - 1] > LINK_TOLERANCE * max(float(values[0]), largest))


class Bodies(Protocol):
    """Bodies that see and are seen: a team, or the robots and landmarks of a recording."""

    @property
    def count(self) -> int:
        """Number of vehicles."""

    @property
    def landmarks(self) -> Array:
        """Positions (m, 2) of the landmarks in m."""


def certify(team: Bodies, verdict: Observability, links: list[LinkInformation]) -> Certificate:
    """Return a team's certificate from the links and the verdict of one window.

    Landmarks in the result are numbered from zero.
    """
    count = team.count
    largest = float(verdict.singular_values[0])
    rigid = [link for link in links if link.b < count and counts(link, 3, largest)]
    held = [link for link in links if link.b >= count and counts(link, 2, largest)]
    edges = [(link.a, link.b) for link in rigid]
    weights = [float(link.singular_values[0] / link.singular_values[2]) for link in rigid]
    tree = [edges[k] for k in spanning_forest(count, edges, weights)]
    witness = []
    for part in components(count, edges):
        inside = set(part)
        anchors = [(link.a, link.b - count) for link in held if link.a in inside]
        pair = _distinct_pair(anchors, team.landmarks, DISTINCT_LANDMARKS * verdict.scale)
        if pair is None:
            found = tuple(sorted({landmark for _, landmark in anchors}))
            return Certificate(False, (), tuple(part), found)
        witness.append(WitnessTree(tuple(part), pair, tuple(e for e in tree if e[0] in inside)))
    return Certificate(True, tuple(witness))


def _distinct_pair(
    anchors: list[tuple[int, int]], landmarks: Array, distance: float
) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """The two anchors whose landmarks are furthest apart, if further than `distance` m."""
    if len(anchors) < 2:
        return None
    places = landmarks[[landmark for _, landmark in anchors]]
    apart = np.hypot(*(places[:, None] - places[None]).T)
    first, second = np.unravel_index(int(np.argmax(apart)), apart.shape)
    if apart[first, second] <= distance:
        return None
    return anchors[min(first, second)], anchors[max(first, second)]


# --- one window -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Assessment:
    """Exact observability of a team over one window.

    Attributes
    ----------
    window : s, its length
    windows : contact windows over one period
    sightings : those at the samples k Ts in the window, k >= 0
    information : information of each pair's sightings, ordered by (a, b)
    observability, certificate : verdict and certificate of all sightings together
    """

    team: Team
    window: float
    windows: Windows
    sightings: Sightings
    information: list[LinkInformation]
    observability: Observability
    certificate: Certificate

    @property
    def largest(self) -> float:
        """Largest singular value of the team's matrix, against which links are measured."""
        return float(self.observability.singular_values[0])

    def measured_in(self, scale: float) -> Observability:
        """Return rank and singular values with positions in `scale` m instead of mean radii."""
        if scale == self.observability.scale:
            return self.observability
        links = link_information(self.team, self.sightings, scale)
        return assess(self.team, links, lone_rows(self.team, self.sightings, scale), scale)


def assess_team(team: Team, window: float) -> Assessment:
    """Return the observability of a team over `window` s."""
    windows = find_windows(team)
    return _assessed(team, window, windows, sightings_over(team, windows, window))


def assess_remainder(before: Assessment, left: Remainder) -> Assessment:
    """Return the observability after a loss, over the same window."""
    windows, sightings = left.windows(before.windows), left.sightings(before.sightings)[0]
    return _assessed(left.team, before.window, windows, sightings)


def _assessed(team: Team, window: float, windows: Windows, sightings: Sightings) -> Assessment:
    information = link_information(team, sightings)
    verdict = assess(team, information, lone_rows(team, sightings))
    certificate = certify(team, verdict, information)
    return Assessment(team, window, windows, sightings, information, verdict, certificate)
