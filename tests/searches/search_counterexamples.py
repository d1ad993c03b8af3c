"""Search for a certificate that holds, or poses determined whatever the errors, without full rank.

    python -m tests.searches.search_counterexamples [DRAWS [FIRST]]

Teams have all kinds of sensors, errors and obstacles. Part of `make check-all`; `make check` runs
the first draws of the same generator.
"""

import sys
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from syncplan.observability.error_modes import assess_extended
from syncplan.observability.rank import assess_team
from tests.tools.draws import draw_equipped_team


def judged(number: int) -> tuple[bool, bool, bool, float, bool]:
    """Return what a draw shows.

    Whether a certificate holds; whether there are errors as states, and the poses determined
    whatever these are; the smallest singular value over the largest of a certified team; and
    whether either holds without full rank by the poses.
    """
    team = draw_equipped_team(np.random.default_rng(number))
    assessed = assess_team(team, team.orbits.period)
    verdict, held = assessed.observability, assessed.certificate.holds
    extended = assess_extended(assessed)
    determined = extended is not None and extended.poses_determined
    values = verdict.singular_values
    closest = float(values[-1] / values[0]) if held else np.inf
    failed = (held or determined) and not verdict.observable
    return held, extended is not None, determined, closest, failed


def main(draws: int = 100_000, first: int = 0) -> list[int]:
    """Return the numbers of draws that fail, of `draws` random teams from number `first` on."""
    numbers = range(first, first + draws)
    with ProcessPoolExecutor() as pool:
        found = np.array(list(pool.map(judged, numbers, chunksize=500)))
    held, extended, determined, _, _ = found.sum(axis=0)
    failures = [number for number, failed in zip(numbers, found[:, 4], strict=True) if failed]
    print(
        f"{draws} draws, {held:.0f} certificates hold, {extended:.0f} with errors as states, "
        f"poses of {determined:.0f} determined whatever these are; {len(failures)} without "
        f"full rank {failures[:10]}; smallest singular value over the largest "
        f"{found[:, 3].min():.2e}"
    )
    return failures


if __name__ == "__main__":
    sys.exit(bool(main(*(int(argument) for argument in sys.argv[1:]))))
