"""Search for a certificate that holds, or poses determined whatever the errors, without full rank.

Teams are close to degenerate, with all kinds of sensors, errors and obstacles. Fails where either
holds and the rank by the poses is not full.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from syncplan.observability.error_modes import assess_extended
from syncplan.observability.rank import assess_team
from tests.searches import Search
from tests.tools.draws import draw_equipped_team


class Shown(NamedTuple):
    """What a team shows.

    Whether its certificate holds; whether it has errors as states, and its poses determined
    whatever these are; where certified, the smallest singular value over the largest.
    """

    certified: bool
    extended: bool
    determined: bool
    closest: float


def draw(number: int) -> tuple[list[str], Shown]:
    """Return what a team shows, a fault where it is not observable after all."""
    team = draw_equipped_team(np.random.default_rng(number))
    assessed = assess_team(team, team.orbits.period)
    verdict, certified = assessed.observability, assessed.certificate.holds
    extended = assess_extended(assessed)
    determined = extended is not None and extended.poses_determined
    values = verdict.singular_values
    closest = float(values[-1] / values[0]) if certified else np.inf
    failed = (certified or determined) and not verdict.observable
    faults = [f"rank {verdict.rank} of {verdict.state_dim}"] if failed else []
    return faults, Shown(certified, extended is not None, determined, closest)


def judge(cases: Mapping[int, Shown], chance: float) -> list[str]:
    """Print how many hold, and how near a certified team is to a loss of rank."""
    certified, extended, determined, closest = zip(*cases.values(), strict=True)
    print(
        f"{sum(certified)} certificates hold; {sum(extended)} with errors as states, poses of "
        f"{sum(determined)} determined whatever these are; smallest singular value over the "
        f"largest {min(closest):.2e}"
    )
    return []


SEARCH = Search(draw, judge, draws=2000)
