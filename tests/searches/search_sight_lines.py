"""Draw teams among obstacles and compare their contact windows with sampling and bisection.

    python -m tests.searches.search_sight_lines [DRAWS [SEED]]

Each of DRAWS teams has 2 or 3 vehicles, of either sense and mostly unequal radii, all-round or
limited views, and 1 to 4 obstacles, convex, concave or thin, some orbited, passed through or
touched by a path; one landmark is on a wall. Prints the largest error of an edge; ends with status
1 if a sample, a window or an edge disagrees. Part of `make check-all`; the suite does the same for
a few draws.
"""

import sys

import numpy as np

from tests.tools.obstructed import EDGE_S, compare, draw_obstructed


def main(draws: int = 5000, seed: int = 0) -> list[str]:
    """Return and print what disagrees."""
    edges, at_obstacles, largest, failures = 0, 0, 0.0, []
    for k in range(draws):
        found = compare(draw_obstructed(np.random.default_rng([seed, k])))
        edges, at_obstacles = edges + found.edges, at_obstacles + found.at_obstacles
        largest = max(largest, found.largest)
        failures += [f"draw {k}: {text}" for text in found.mismatches[:1]]
    print(
        f"{draws} draws, {edges} edges bisected, {at_obstacles} of them at obstacles; largest "
        f"error {largest:.2g} s, allowed {EDGE_S:g} s; {len(failures)} disagree {failures}"
    )
    return failures


if __name__ == "__main__":
    sys.exit(bool(main(*(int(argument) for argument in sys.argv[1:]))))
