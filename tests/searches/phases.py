"""Draw small teams and compare their phases with the best of all by brute force.

A case is three teams: the margin of 3 or 4 vehicles that keep a separation; contact on a tree with
limited fields of view; contact of 3 or 4 vehicles linked throughout. Fails where a margin is more
than 1 % short, a link of a tree is lost or has less than 90 % of its attainable contact, or a
smallest share is less than 90 % of the best.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tests.searches import Search
from tests.tools.phase_teams import (
    draw_apart,
    draw_seeing,
    largest_margin_apart,
    largest_shares,
    shares_of,
)

MARGIN_SHORT = 0.01
SHARE_KEPT = 0.9
WORTH_COMPARING_M, WORTH_COMPARING = 0.5, 0.02
"""A margin or a share below which brute force says next to nothing."""


def margin_shortfall(generator: np.random.Generator) -> float | None:
    """Return by what part of it the margin falls short of brute force; None if there is none.

    Phases by rules, in closed form, are no search: they are left out.
    """
    team = draw_apart(generator)
    found = team.synchronised()
    best = largest_margin_apart(team) if len(team.pairs) else -np.inf
    if found.method == "closed form" or not best > WORTH_COMPARING_M:
        return None
    margin = -np.inf if found.dropped or found.margin is None else found.margin
    return float((best - margin) / best)


def tree_share(generator: np.random.Generator) -> float:
    """Return the smallest share of attainable contact over the links of a tree."""
    team = draw_seeing(generator, tree=True)
    shares, _ = shares_of(team, team.synchronised().phases, lasting=True)
    return float(np.min(shares, initial=1.0))


def graph_share(generator: np.random.Generator) -> float | None:
    """Return the smallest share over the best smallest share; None if none is worth comparing.

    Where no phases serve all links it is the number served over the most that can be.
    """
    team = draw_seeing(generator, tree=False)
    shares, seen = shares_of(team, team.synchronised().phases)
    if not seen.any():
        return None
    best, most = largest_shares(team)
    if best > WORTH_COMPARING:
        return float(shares[seen].min() / best)
    return float(np.sum(shares[seen] > 0.0) / most) if best <= 0.0 else None


class Compared(NamedTuple):
    """Three teams beside brute force; None where it says next to nothing."""

    margin_shortfall: float | None
    tree_share: float | None
    graph_share: float | None


def draw(number: int) -> tuple[list[str], Compared]:
    """Return what is worse than it may be, and how much the three teams of a number attain."""
    compared = Compared(
        *(
            attained(np.random.default_rng([0, number]))
            for attained in (margin_shortfall, tree_share, graph_share)
        )
    )
    faults = []
    for name, value in compared._asdict().items():
        short = name == "margin_shortfall"
        if value is not None and (value > MARGIN_SHORT if short else value < SHARE_KEPT):
            faults.append(f"{name} {value:.4f}")
    return faults, compared


def judge(cases: Mapping[int, Compared], chance: float) -> list[str]:
    """Print the worst of each."""
    for name in Compared._fields:
        values = [v for case in cases.values() if (v := getattr(case, name)) is not None]
        worst = max(values, default=0.0) if name == "margin_shortfall" else min(values, default=1.0)
        print(f"{name}: worst {worst:.4f}, median {np.median(values):.4f}, {len(values)} compared")
    return []


SEARCH = Search(draw, judge, draws=50)
