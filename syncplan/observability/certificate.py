"""The corrected Theorem 3.3: a certificate that a team is observable, and its witness tree.

Drop the landmarks and keep the vehicle links of rank 3. The team is observable if every connected
component of vehicles has links of rank 2 to two distinct landmarks (as printed in the paper, the
theorem also accepts components joined only through a landmark, which can turn about it unseen).
Sufficient, not necessary: the rank of the windowed matrix decides, the certificate explains.

A link counts if the singular value its rank rests on exceeds LINK_TOLERANCE times the largest of
its own, and times the largest of the whole team's matrix as well. Its own alone is not enough:
beside a close pass elsewhere, a link that is barely of rank 3 and seen from afar is lost in
rounding, and the team's rank, judged at RANK_TOLERANCE of the largest of all, falls short of what
was certified.

    L1        L2            two landmarks hold each component ...
      \\      /
       v3 - v4              ... whose vehicles a tree of rank-3 links makes rigid
       |     |
       v2    v5
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from syncplan.arrays import Array
from syncplan.observability.rank import LINK_TOLERANCE, LinkInformation, Observability
from syncplan.orbits.graphs import components, spanning_forest

DISTINCT_LANDMARKS = 0.1
"""Two landmarks count as distinct when further apart than this share of the mean radius."""


@dataclass(frozen=True, slots=True)
class WitnessTree:
    """Why one component is observable: two landmark links and a spanning tree of vehicle links.

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
    """Whether the corrected Theorem 3.3 holds, why or why not, and its witness.

    Attributes
    ----------
    lacking : vehicles of the first component that fails, empty where the certificate holds
    anchors : landmarks that component has links of rank 2 to
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
    """What sees and is seen: a team, or the robots and landmarks of a recording."""

    @property
    def count(self) -> int:
        """Number of vehicles."""

    @property
    def landmarks(self) -> Array:
        """(m, 2) m."""


def certify(team: Bodies, verdict: Observability, links: list[LinkInformation]) -> Certificate:
    """Return the certificate of a team, from the links of one window and its verdict.

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
