"""Search for contact windows among obstacles that differ from sampling and bisection.

Teams have 2 or 3 vehicles, of either sense and mostly unequal radii, all-round or limited views,
and 1 to 4 obstacles, convex, concave or thin, some orbited, passed through or touched by a path;
one landmark is on a wall. Fails where a sample, a window or an edge disagrees.
"""

from collections.abc import Mapping

import numpy as np

from tests.searches import Search
from tests.tools.obstructed import EDGE_S, Comparison, compare, draw_obstructed


def draw(number: int) -> tuple[tuple[str, ...], Comparison]:
    """Return what disagrees first in the windows of a team, and how many edges were compared."""
    comparison = compare(draw_obstructed(np.random.default_rng([0, number])))
    return comparison.mismatches[:1], comparison


def judge(cases: Mapping[int, Comparison], chance: float) -> list[str]:
    """Print the largest error of an edge."""
    print(
        f"{sum(case.edges for case in cases.values())} edges bisected, "
        f"{sum(case.at_obstacles for case in cases.values())} of them at obstacles; largest error "
        f"{max(case.largest for case in cases.values()):.2g} s, allowed {EDGE_S:g} s"
    )
    return []


SEARCH = Search(draw, judge, draws=75)
