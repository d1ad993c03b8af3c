"""The convex relaxation of the choice of sites, with a bound that rests on no solver.

Shares x in [0, 1] that add up to k take the place of a choice. The least precision over the
vehicles (see syncplan.landmarks.site_information) is concave in x, so it is maximised by cutting
planes: a linear program over the cuts found so far proposes shares, an exact evaluation between
them and the best shares known adds new cuts (in-out separation, Ben-Ameur and Neto, 2007, which
keeps proposals from swinging between corners).

Any weights on the cuts that add up to one give a line above the least precision; the largest
value of a line over all choices is its height and its k largest slopes. Whatever accuracy the
program's multipliers have, the bound computed from them here is true. (The same relaxation as one
semidefinite program scales badly: on a team of six Clarabel's value is 15 % off unless the
information is whitened first.)
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.landmarks.site_information import Cuts, SiteInformation, evaluate
from syncplan.runtime.convex_solver import has_solution, load_cvxpy


@dataclass(frozen=True, slots=True)
class SiteRelaxation:
    """The best shares, what they reach, and a line above what any choice can reach.

    Attributes
    ----------
    shares : (S,) in [0, 1], adding up to k
    precision : least precision at the shares, mean radii^-2
    ceiling : no choice of k sites has a least precision above it
    height, slopes : line above the least precision; its largest value is the ceiling
    cuts : all found
    rounds : linear programs solved
    """

    shares: Array
    precision: float
    ceiling: float
    height: float
    slopes: Array
    cuts: Cuts
    rounds: int

    def ceilings_with(self, choose: int) -> Array:
        """Return (S,): no choice of `choose` sites that holds s has a precision above entry s."""
        order = np.sort(self.slopes)[::-1]
        others = order[: choose - 1].sum() if choose > 1 else 0.0
        inside = self.slopes > order[choose - 1]
        whole = order[:choose].sum()
        return self.height + np.where(inside, whole, others + self.slopes)


ROUNDS = 200
"""Most linear programs; the bound is true after any of them."""

ACCURACY = 1e-4
"""Relative difference of the bound's precision from the best shares' at which it is settled."""

_STEP = 0.5


def relax(information: SiteInformation, choose: int) -> SiteRelaxation:
    """Return the relaxation for `choose` sites of S."""
    count = information.site_count
    shares = np.full(count, choose / count)
    at = evaluate(information, shares)
    cuts, best, rounds = at.cuts, at.least, 0
    line = _lowest_line(cuts, np.eye(len(cuts.heights)), choose)
    while rounds < ROUNDS and line[0] > best * (1.0 + ACCURACY):
        rounds += 1
        proposal = _propose(cuts, choose, line[0])
        if proposal is None:
            break
        outer, weights = proposal
        line = min(line, _lowest_line(cuts, weights[None], choose), key=lambda item: item[0])
        between = shares + _STEP * (outer - shares)
        at = evaluate(information, between)
        cuts = cuts.joined(at.cuts)
        if at.least > best:
            shares, best = between, at.least
    return SiteRelaxation(shares, best, *line, cuts, rounds)


def _lowest_line(cuts: Cuts, weights: Array, choose: int) -> tuple[float, float, Array]:
    """(ceiling, height, slopes) of that row of weights (w, c) whose line stays lowest."""
    heights, slopes = weights @ cuts.heights, weights @ cuts.slopes
    ceilings = heights + np.sort(slopes, axis=1)[:, -choose:].sum(axis=1)
    lowest = int(np.argmin(ceilings))
    return float(ceilings[lowest]), float(heights[lowest]), slopes[lowest]


_STEEPEST = 1e5


def _propose(cuts: Cuts, choose: int, ceiling: float) -> tuple[Array, Array] | None:
    """Shares (S,) that maximise the least of the cuts, and the cuts' multipliers (c,), sum 1."""
    cp = load_cvxpy()
    # Variables, in units of the ceiling; steep slopes are held back, for the proposal only
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
