"""Draw small teams and compare their phases with the best of all by brute force.

    python -m tests.searches.search_phases [DRAWS [SEED]]

Of DRAWS teams each: margins of 3 or 4 vehicles that keep a separation; contact on trees with
limited fields of view; contact of 3 or 4 vehicles linked throughout. Prints the worst of each; ends
with status 1 if a margin is more than 1 % short, a link of a tree is lost or has less than 90 % of
its attainable contact, or a smallest share is less than 90 % of the best. Part of `make check-all`;
the suite does the same for a few draws.
"""

import sys

import numpy as np

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


def main(draws: int = 200, seed: int = 0) -> list[str]:
    """Return and print what is worse than it may be."""
    failures = []
    for name, one, allowed in (
        ("margin short of brute force by", margin_shortfall, MARGIN_SHORT),
        ("tree: share of attainable contact", tree_share, SHARE_KEPT),
        ("graph: smallest share over brute force's", graph_share, SHARE_KEPT),
    ):
        found = [one(np.random.default_rng([seed, k])) for k in range(draws)]
        compared = [(value, k) for k, value in enumerate(found) if value is not None]
        values = np.array([value for value, _ in compared])
        short = name.startswith("margin")
        worst = values.max() if short else values.min()
        print(
            f"{name}: worst {worst:.4f}, median {np.median(values):.4f}, {len(values)} compared",
            flush=True,
        )
        failures += [
            f"{name} {value:.4f} (draw {k})"
            for value, k in compared
            if (value > allowed if short else value < allowed)
        ]
    print(f"{3 * draws} draws, {len(failures)} failures {failures}")
    return failures


if __name__ == "__main__":
    sys.exit(bool(main(*(int(argument) for argument in sys.argv[1:]))))
