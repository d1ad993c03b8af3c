"""Search for the best choice of sites: relaxation, rounding, swaps and proof.

    relax     replace the choice by shares x in [0, 1] that add up to k
    round     the largest shares, seeded draws, and dropping sites one by one
    swap      one site, then two, for others, while any swap helps
    prove     try all choices that are not ruled out, where they are few enough

The least precision over the vehicles (see syncplan.landmarks.site_information) is concave in x, so
it is maximised by cutting planes. A linear program over the cuts found so far proposes shares; an
exact evaluation between them and the best known shares adds new cuts (in-out separation, Ben-Ameur
and Neto, 2007, which keeps proposals from swinging between corners).

Any weights on the cuts that add up to one give a line above the least precision. The largest
value of a line over all choices is its height plus its k largest slopes. So the bound computed from
the program's multipliers is valid whatever their accuracy. (The same relaxation as one semidefinite
program scales badly: on a team of six Clarabel's value is 15 % off unless the information is
whitened first.)

A choice whose cuts lie below the best known precision can't be better, so skipping it loses
nothing.
"""

from dataclasses import dataclass
from itertools import combinations
from math import comb
from typing import Any

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.landmarks.site_information import Cuts, SiteInformation, evaluate
from syncplan.runtime.machine import has_solution, load_cvxpy


@dataclass(frozen=True, slots=True)
class SiteRelaxation:
    """Best shares found, and a line above the least precision of every choice.

    Attributes
    ----------
    shares : (S,) in [0, 1], adding up to k
    ceiling : upper bound on the least precision of any k sites
    height, slopes : line above the least precision; its largest value is the ceiling
    cuts : all cuts found
    """

    shares: Array
    ceiling: float
    height: float
    slopes: Array
    cuts: Cuts

    def ceilings_with(self, choose: int) -> Array:
        """Return upper bounds (S,) on the precision of any `choose` sites that include site s."""
        order = np.sort(self.slopes)[::-1]
        others = order[: choose - 1].sum() if choose > 1 else 0.0
        inside = self.slopes > order[choose - 1]
        whole = order[:choose].sum()
        return self.height + np.where(inside, whole, others + self.slopes)


ROUNDS = 200
"""Largest number of linear programs; the bound is valid after each of them."""

ACCURACY = 1e-4
"""Relative gap between the ceiling and the best shares' precision at which it is settled."""

_STEP = 0.5


def relax(information: SiteInformation, choose: int) -> SiteRelaxation:
    """Return the relaxation for `choose` sites of S."""
    count = information.site_count
    shares = np.full(count, choose / count)
    at = evaluate(information, shares)
    cuts, best = at.cuts, at.least
    line = _lowest_line(cuts, np.eye(len(cuts.heights)), choose)
    for _ in range(ROUNDS):
        settled = line[0] <= best * (1.0 + ACCURACY)
        proposal = None if settled else _propose(cuts, choose, line[0])
        if proposal is None:
            break
        outer, weights = proposal
        line = min(line, _lowest_line(cuts, weights[None], choose), key=lambda item: item[0])
        between = shares + _STEP * (outer - shares)
        at = evaluate(information, between)
        cuts = cuts.joined(at.cuts)
        if at.least > best:
            shares, best = between, at.least
    return SiteRelaxation(shares, *line, cuts)


def _lowest_line(cuts: Cuts, weights: Array, choose: int) -> tuple[float, float, Array]:
    """Ceiling, height and slopes of the line of lowest ceiling, from rows of weights (w, c)."""
    heights, slopes = weights @ cuts.heights, weights @ cuts.slopes
    ceilings = heights + np.sort(slopes, axis=1)[:, -choose:].sum(axis=1)
    lowest = int(np.argmin(ceilings))
    return float(ceilings[lowest]), float(heights[lowest]), slopes[lowest]


_STEEPEST = 1e5


def _propose(cuts: Cuts, choose: int, ceiling: float) -> tuple[Array, Array] | None:
    """Shares (S,) that maximise the lowest cut, and the cuts' multipliers (c,), of sum 1."""
    cp = load_cvxpy()
    # Variables, in units of the ceiling; steep cuts are clipped, for the proposal only
    shares: Any = cp.Variable(cuts.slopes.shape[1])
    least: Any = cp.Variable()
    slopes = np.minimum(cuts.slopes / ceiling, _STEEPEST)
    heights = np.minimum(cuts.heights / ceiling, _STEEPEST)
    # Objective and constraints
    above = heights + slopes @ shares >= least
    constraints = [above, cp.sum(shares) == choose, shares >= 0.0, shares <= 1.0]
    problem = cp.Problem(cp.Maximize(least), constraints)
    # Solve
    if not has_solution(problem, solver=cp.CLARABEL):
        return None
    weights = np.maximum(np.asarray(above.dual_value, dtype=float), 0.0)
    if not weights.sum() > 0.0:
        return None
    return np.clip(shares.value, 0.0, 1.0), weights / weights.sum()


# --- search -------------------------------------------------------------------------------------


MOST_LISTED = 50_000
"""Largest number of choices that are listed, each to be tried or ruled out."""

CUT_VEHICLES = 2
"""Number of vehicles, the worst, for which each evaluation of a choice adds cuts."""

MOST_EVALUATIONS = 1500
"""Exact evaluations after which a proof or a round of swaps is given up."""

DRAWS = 20
"""Number of seeded choices drawn in proportion to the shares."""

CLIMBS = 6
"""Number of best starts from which swaps begin."""

_SPARE = 12
_BETTER = 1.0 + 1e-9


def best_sites(
    information: SiteInformation,
    relaxation: SiteRelaxation,
    choose: int,
    generator: np.random.Generator,
    *,
    exhaustive: bool = True,
) -> tuple[Index, bool]:
    """Return the best choice found, (choose,) ascending, and whether it is proven best.

    `exhaustive` allows the proof, which may also improve the choice.
    """
    search = _Search(information, choose, relaxation.cuts)
    _improve(search, relaxation, generator)
    proven = exhaustive and _prove(search, relaxation)
    return search.best, proven


class _Search:
    """Best known choice, and the cuts that rule out others.

    Choices that leave a vehicle undetermined all have precision 0; their rank distinguishes them.
    """

    def __init__(self, information: SiteInformation, choose: int, cuts: Cuts) -> None:
        self.information = information
        self.choose = choose
        self.cuts = cuts
        self.best: Index = np.arange(choose)
        self.key = (-1.0, 0)

    def offer(self, subsets: Index, most: int = MOST_EVALUATIONS) -> bool:
        """Try (b, k) choices, most promising first; return whether all were tried or ruled out."""
        ceilings = self.cuts.ceilings(subsets)
        for _ in range(most):
            first = int(np.argmax(ceilings)) if len(ceilings) else -1
            if first < 0 or ceilings[first] <= self.key[0] * _BETTER:
                return True
            at = self.reached(subsets[first])
            ceilings[first] = -np.inf
            np.minimum(ceilings, at.ceilings(subsets), out=ceilings)
        return bool(np.all(ceilings <= self.key[0] * _BETTER))

    def reached(self, subset: Index) -> Cuts:
        """Evaluate one choice, keep it if it is the best, and return its cuts."""
        shares = np.zeros(self.information.site_count)
        shares[subset] = 1.0
        at = evaluate(self.information, shares, CUT_VEHICLES)
        self.cuts = self.cuts.joined(at.cuts)
        self.keep(np.sort(subset), (at.least, at.rank))
        return at.cuts

    def keep(self, subset: Index, key: tuple[float, int]) -> None:
        """Replace the best choice if this one is better."""
        level = key[0] == self.key[0] and key[1] > self.key[1]
        if key[0] > self.key[0] * _BETTER or level:
            self.best, self.key = subset, key

    def swap(self, relaxation: SiteRelaxation, count: int, passed: set[tuple[int, ...]]) -> bool:
        """Exchange `count` of the best choice's sites while that helps; return whether it did.

        Ends at a choice already `passed`: its swaps have been tried.
        """
        begun, known = self.key, None
        while self.key != known and tuple(self.best.tolist()) not in passed:
            passed.add(tuple(self.best.tolist()))
            known = self.key
            self.offer(_swaps(self.best, self.useful(relaxation), count))
        return self.key != begun

    def useful(self, relaxation: SiteRelaxation) -> Index:
        """Return the sites that a choice better than the best known may include."""
        ceilings = relaxation.ceilings_with(self.choose)
        return np.flatnonzero(ceilings > self.key[0] * _BETTER).astype(np.int64)


def _improve(search: _Search, relaxation: SiteRelaxation, generator: np.random.Generator) -> None:
    """Swap single sites from the best starts, then pairs of the best, while any swap helps."""
    rounded = _rounded(relaxation.shares, search.choose, generator)
    dropped = _dropped_one_by_one(search.information, relaxation.shares, search.choose)
    climbs = []
    for start in np.unique(np.concatenate([dropped[None], rounded]), axis=0):
        climbs.append(_Search(search.information, search.choose, relaxation.cuts))
        climbs[-1].reached(start)
    climbs.sort(key=lambda climb: climb.key, reverse=True)
    passed: set[tuple[int, ...]] = set()
    for climb in climbs[:CLIMBS]:
        climb.swap(relaxation, 1, passed)
        search.keep(climb.best, climb.key)
    while search.swap(relaxation, 2, set()):
        search.swap(relaxation, 1, set())


def _prove(search: _Search, relaxation: SiteRelaxation) -> bool:
    """Try all choices of useful sites; return whether the best known is proven best."""
    useful = search.useful(relaxation)
    if comb(len(useful), search.choose) > MOST_LISTED:
        return False
    return search.offer(_listed(useful, search.choose))


def _rounded(shares: Array, choose: int, generator: np.random.Generator) -> Index:
    """Choices (1 + DRAWS, k): the largest shares, then draws in proportion to the shares."""
    with np.errstate(divide="ignore"):
        weight = np.log(np.maximum(shares, 1e-12))
    noise = generator.gumbel(size=(DRAWS, len(shares)))
    scores = np.concatenate([weight[None], weight + noise])
    return np.sort(np.argsort(-scores, axis=1, kind="stable")[:, :choose], axis=1)


def _dropped_one_by_one(information: SiteInformation, shares: Array, choose: int) -> Index:
    """Choice from the largest shares, dropping one by one the site whose loss costs least."""
    left = np.argsort(-shares, kind="stable")[: choose + _SPARE]
    left = np.sort(left)
    while len(left) > choose:
        keys = []
        for k in range(len(left)):
            trial = np.zeros(len(shares))
            trial[np.delete(left, k)] = 1.0
            at = evaluate(information, trial)
            keys.append((at.least, at.rank))
        left = np.delete(left, max(range(len(left)), key=keys.__getitem__))
    return left


def _swaps(chosen: Index, useful: Index, count: int) -> Index:
    """Choices (b, k) that exchange `count` of the chosen for useful ones; none if too many."""
    others = np.setdiff1d(useful, chosen)
    if not 0 < comb(len(chosen), count) * comb(len(others), count) <= MOST_LISTED:
        return np.zeros((0, len(chosen)), dtype=np.int64)
    kept, into = _listed(chosen, len(chosen) - count), _listed(others, count)
    return np.hstack([np.repeat(kept, len(into), axis=0), np.tile(into, (len(kept), 1))])


def _listed(sites: Index, choose: int) -> Index:
    """All choices (b, choose) of `choose` of the sites."""
    listed = np.array(list(combinations(sites.tolist(), choose)), dtype=np.int64)
    return listed.reshape(comb(len(sites), choose), choose)
