"""Search for a loss whose judgement differs from the reduced scenario planned from scratch.

Every single loss of a drawn team is judged, and losses of two of a team of up to 3 vehicles. Fails
where rank, unobservable motions, predicted errors or findings differ.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from syncplan.planning.loss_study import what_if
from tests.searches import Search
from tests.tools.lost import differences, drawn_plan, from_scratch


class Judged(NamedTuple):
    """Losses of a team: number, and of those that are critical; whether it is observable whole."""

    losses: int
    critical: int
    observable: bool


def draw(number: int) -> tuple[list[str], Judged]:
    """Return what differs in the losses of a team."""
    plan = drawn_plan(np.random.default_rng([0, number]))
    study = what_if(plan, losses=2 if plan.team.count <= 3 else 1, threads=1)
    faults = [
        f"{loss.lost}: {difference}"
        for loss in study.losses
        for difference in differences(loss, from_scratch(plan, loss.lost))
    ]
    return faults, Judged(len(study.losses), len(study.critical), plan.observable)


def judge(cases: Mapping[int, Judged], chance: float) -> list[str]:
    """Print how many losses were judged."""
    losses, critical, observable = (sum(values) for values in zip(*cases.values(), strict=True))
    print(f"{observable} teams observable; {losses} losses, {critical} critical")
    return []


SEARCH = Search(draw, judge, draws=20)
