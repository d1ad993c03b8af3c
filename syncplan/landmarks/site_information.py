"""Windowed information as a function of the chosen candidate sites.

With x_s the share of candidate s, the information of the team over the window is linear in x,

    F(x) = F_fixed + sum_s x_s F_s,

and the window bound of vehicle i is sqrt(f_i), f_i = tr(E_i^T F(x)^-1 E_i), with E_i the columns
of its position. Its inverse h_i = 1 / f_i, here called precision, is concave. For every matrix U
it lies below a line in x:

    h_i(x) <= tr(U^T F(x) U) / tr(U^T E_i)^2        (Cauchy-Schwarz)

with equality where U = F(x)^-1 E_i. Such a cut is a sum of squares, so there is no cancellation.
It is valid however inaccurate U is, and finite where F(x) is singular and the precision is zero.
"""

from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.observability.rank import link_information, lone_rows, stacked_rows
from syncplan.observability.spectrum import RANK_TOLERANCE
from syncplan.orbits.contacts import find_windows, reachable_pairs
from syncplan.orbits.sightings import sightings_over
from syncplan.planning.plans import Plan

MOST_CUTS = 8
"""Default number of vehicles, those of least precision, for which cuts are made."""

SAFE_CONDITION = 0.1 / RANK_TOLERANCE
"""Condition number below which the rank is certainly full, so that no SVD is needed."""

_LOST = 1e-9


@dataclass(frozen=True, slots=True)
class Cuts:
    """Lines above the least precision: heights (c,) and slopes (c, S), in mean radii^-2."""

    heights: Array
    slopes: Array

    def joined(self, others: "Cuts") -> "Cuts":
        """Return these cuts followed by the others."""
        return Cuts(
            np.concatenate([self.heights, others.heights]),
            np.concatenate([self.slopes, others.slopes]),
        )

    def ceilings(self, subsets: Index) -> Array:
        """Return the least value (b,) of the lines at each of the (b, k) subsets of sites."""
        least = np.full(len(subsets), np.inf)
        for height, slope in zip(self.heights, self.slopes, strict=True):
            np.minimum(least, height + slope[subsets].sum(axis=1), out=least)
        return least


@dataclass(frozen=True, slots=True)
class SiteInformation:
    """Rows of the windowed matrix: the given ones, and those that each candidate would add.

    Attributes
    ----------
    fixed : (r, 3 n) rows of vehicles and given landmarks, divided by sigma, positions in mean radii
    blocks : (p, 3, 3) rows of each pair of a vehicle and a candidate it sees, reduced to three
    vehicles, sites : (p,) members of each pair
    count, site_count : n, S
    scale : m, the mean radius
    """

    fixed: Array
    blocks: Array
    vehicles: Index
    sites: Index
    count: int
    site_count: int
    scale: float

    @property
    def seen_by(self) -> Index:
        """Number (S,) of vehicles that see each candidate."""
        return np.bincount(self.sites, minlength=self.site_count).astype(np.int64)

    def rows(self, shares: Array) -> Array:
        """Return the rows A (m, 3 n) at shares (S,) in [0, 1], with F(x) = A^T A."""
        kept = np.flatnonzero(shares[self.sites] > 0.0)
        added = np.zeros((len(kept), 3, self.count, 3))
        weight = np.sqrt(shares[self.sites[kept]])
        added[np.arange(len(kept)), :, self.vehicles[kept]] = (
            weight[:, None, None] * self.blocks[kept]
        )
        return np.concatenate([self.fixed, added.reshape(-1, 3 * self.count)])

    def cut(self, directions: Array, vehicle: int) -> tuple[float, Array]:
        """Return the height and slopes (S,) of one vehicle's cut, from any U (3 n, 2)."""
        overlap = float(np.trace(directions[3 * vehicle : 3 * vehicle + 2]))
        pose = (directions / overlap).reshape(self.count, 3, 2)
        gained = np.sum((self.blocks @ pose[self.vehicles]) ** 2, axis=(1, 2))
        slopes = np.zeros(self.site_count)
        np.add.at(slopes, self.sites, gained)
        return float(np.sum((self.fixed @ pose.reshape(-1, 2)) ** 2)), slopes


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Exact precision at one choice or mix of sites.

    Attributes
    ----------
    precision : (n,) 1 / f_i in mean radii^-2; 0 for a vehicle that is not determined
    rank : of the windowed matrix
    cuts : for the vehicles of least precision, tangent at these shares
    """

    precision: Array
    rank: int
    cuts: Cuts

    @property
    def least(self) -> float:
        """Precision of the worst vehicle."""
        return float(self.precision.min())


def candidate_information(plan: Plan, candidates: Array) -> SiteInformation:
    """Return the information that candidates (S, 2) m would add to the sightings of a plan."""
    team, window = plan.team, plan.scenario.window
    sightings = sightings_over(team, plan.windows, window)
    links, alone = link_information(team, sightings), lone_rows(team, sightings)
    fixed = stacked_rows(links, team.count, alone)
    if len(fixed) > 3 * team.count:
        fixed = np.asarray(np.linalg.qr(fixed, mode="r"))
    beside = replace(team, landmarks=candidates)
    a, b = reachable_pairs(team.orbits, team.sensors.ranges, candidates)
    windows = find_windows(beside, (a[b >= team.count], b[b >= team.count]))
    added = link_information(beside, sightings_over(beside, windows, window))
    blocks = np.zeros((len(added), 3, 3))
    for k, link in enumerate(added):
        rows = link.singular_values[:3, None] * link.directions[:3, :3]
        blocks[k, : len(rows)] = rows
    return SiteInformation(
        fixed=fixed,
        blocks=blocks,
        vehicles=np.array([link.a for link in added], dtype=np.int64),
        sites=np.array([link.b - team.count for link in added], dtype=np.int64),
        count=team.count,
        site_count=len(candidates),
        scale=plan.observability.scale,
    )


def evaluate(information: SiteInformation, shares: Array, most_cuts: int = MOST_CUTS) -> Evaluation:
    """Return the exact precision of all vehicles at shares (S,) in [0, 1], with cuts for some."""
    matrix = information.rows(shares)
    size = 3 * information.count
    root = _inverse_root(matrix, size)
    null = np.zeros((0, size))
    rank = size
    if root is None:
        _, found, right = np.linalg.svd(matrix, full_matrices=True)
        rank = int(np.sum(found > RANK_TOLERANCE * found.max(initial=0.0)))
        root, null = right[:rank].T / found[:rank], right[rank:]
    variance = np.sum(root**2, axis=1).reshape(-1, 3)[:, :2].sum(axis=1)
    lost = np.sum(null**2, axis=0).reshape(-1, 3)[:, :2].sum(axis=1) > _LOST
    precision = np.zeros(information.count)
    precision[~lost] = 1.0 / variance[~lost]
    cuts = []
    for vehicle in np.argsort(precision, kind="stable")[:most_cuts].tolist():
        position = slice(3 * vehicle, 3 * vehicle + 2)
        directions = null.T @ null[:, position] if lost[vehicle] else root @ root[position].T
        cuts.append(information.cut(directions, vehicle))
    heights = np.array([height for height, _ in cuts])
    return Evaluation(precision, rank, Cuts(heights, np.array([slopes for _, slopes in cuts])))


def _inverse_root(matrix: Array, size: int) -> Array | None:
    """Matrix B for which B B^T is the inverse information; None unless safely of full rank."""
    if len(matrix) < size:
        return None
    triangle = np.linalg.qr(matrix, mode="r")
    try:
        inverse = np.linalg.inv(triangle)
    except np.linalg.LinAlgError:
        return None
    condition = float(np.linalg.norm(triangle) * np.linalg.norm(inverse))
    return np.asarray(inverse) if condition < SAFE_CONDITION else None
