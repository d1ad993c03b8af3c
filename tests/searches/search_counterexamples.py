"""Search for a certificate that holds, or poses determined whatever the errors, without full rank.

    python -m tests.searches.search_counterexamples [DRAWS [FIRST]]

Teams have all kinds of sensors, errors and obstacles. Part of `make check-all`; `make check` runs
the first draws of the same generator.
"""

import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

from syncplan.observability.error_modes import assess_extended
from syncplan.observability.rank import assess_team
from tests.tools.draws import draw_equipped_team

DRAWS_PER_TASK = 1000


@dataclass(frozen=True, slots=True)
class Found:
    """What a search found.

    Attributes
    ----------
    held : certificates that hold
    extended, determined : teams with errors as states, and those whose poses are determined
        whatever the errors are
    closest : smallest singular value over the largest of a team with a certificate
    failures : numbers of draws where either holds without full rank by the poses
    """

    held: int = 0
    extended: int = 0
    determined: int = 0
    closest: float = np.inf
    failures: tuple[int, ...] = ()

    @staticmethod
    def of(number: int) -> "Found":
        """Return what one draw shows."""
        team = draw_equipped_team(np.random.default_rng(number))
        assessed = assess_team(team, team.orbits.period)
        verdict, held = assessed.observability, assessed.certificate.holds
        extended = assess_extended(assessed)
        determined = extended is not None and extended.poses_determined
        values = verdict.singular_values
        return Found(
            held=int(held),
            extended=int(extended is not None),
            determined=int(determined),
            closest=float(values[-1] / values[0]) if held else np.inf,
            failures=(number,) if (held or determined) and not verdict.observable else (),
        )

    @staticmethod
    def together(parts: Sequence["Found"]) -> "Found":
        """Return what several searches found."""
        return Found(
            held=sum(part.held for part in parts),
            extended=sum(part.extended for part in parts),
            determined=sum(part.determined for part in parts),
            closest=min((part.closest for part in parts), default=np.inf),
            failures=tuple(number for part in parts for number in part.failures),
        )


def search(task: int) -> Found:
    """Return what one task's draws show."""
    first = task * DRAWS_PER_TASK
    return Found.together([Found.of(number) for number in range(first, first + DRAWS_PER_TASK)])


def main(draws: int = 100_000, first: int = 0) -> Found:
    """Return and print what a search over `draws` random teams from number `first` on found.

    Both count in thousands, rounded to whole ones.
    """
    begin = first // DRAWS_PER_TASK
    with ProcessPoolExecutor() as pool:
        parts = list(pool.map(search, range(begin, begin + -(-draws // DRAWS_PER_TASK))))
    found = Found.together(parts)
    print(
        f"{draws} draws, {found.held} certificates hold, {found.extended} with errors as states, "
        f"poses of {found.determined} determined whatever these are; {len(found.failures)} without "
        f"full rank {list(found.failures[:10])}; smallest singular value over the largest "
        f"{found.closest:.2e}"
    )
    return found


if __name__ == "__main__":
    sys.exit(bool(main(*(int(argument) for argument in sys.argv[1:])).failures))
