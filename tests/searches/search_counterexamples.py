"""Search for a certificate that holds without full rank.

    python -m tests.searches.search_counterexamples [DRAWS [FIRST]]

Part of `make check-all`; `make check` runs the first draws of the same generator.
"""

import sys
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from tests.tools.draws import draw_equipped_team, judge_team

DRAWS_PER_TASK = 1000


def search(task: int) -> tuple[int, float, list[int]]:
    """Return (certificates held, smallest share of the tolerance, counterexamples' numbers)."""
    held, closest, failures = 0, np.inf, []
    for number in range(task * DRAWS_PER_TASK, (task + 1) * DRAWS_PER_TASK):
        team = draw_equipped_team(np.random.default_rng(number))
        certificate, verdict = judge_team(team)
        if certificate.holds:
            held += 1
            values = verdict.singular_values
            closest = min(closest, float(values[-1] / values[0]))
            if not verdict.observable:
                failures.append(number)
    return held, closest, failures


def main(draws: int = 100_000, first: int = 0) -> tuple[int, float, list[int]]:
    """Return and print what a search over `draws` random teams from number `first` on found.

    Both count in thousands, rounded to whole ones.
    """
    begin = first // DRAWS_PER_TASK
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(search, range(begin, begin + -(-draws // DRAWS_PER_TASK))))
    held = sum(part[0] for part in found)
    closest = min(part[1] for part in found)
    failures = [number for part in found for number in part[2]]
    print(
        f"{draws} draws, {held} certificates hold, {len(failures)} without full rank "
        f"{failures[:10]}; smallest singular value over the largest {closest:.2e}"
    )
    return held, closest, failures


if __name__ == "__main__":
    sys.exit(bool(main(*(int(argument) for argument in sys.argv[1:]))[2]))
