"""Fronts of designs: whether they worsen, and a simple search to compare them with."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syncplan.designs.candidates import Cell, Space
from syncplan.designs.cell_search import BestCandidate
from syncplan.scenario.brief import Brief

AT_RANDOM, CHANGES, STEPS = 200, 600, (0.1, 0.03, 0.01)
"""Numbers of formations, and the standard deviations of changes in the unit cube."""

ROUNDING = 1e-9
"""Share by which an error may differ where the formation is the same."""


def simple_search(brief: Brief, cell: Cell) -> float:
    """Return the least worst error in m of 200 random formations and 600 changes of the best.

    From UNFIT on, no formation without a fault was among them. Senses are equal and alternate in
    turn.
    """
    generator = np.random.default_rng(0)
    spaces = [Space(brief, replace(cell, alternate=alternate)) for alternate in (False, True)]
    drawn = [(spaces[k % 2], generator.uniform(size=spaces[0].size)) for k in range(AT_RANDOM)]
    values = [space.value(point) for space, point in drawn]
    value, (space, point) = min(values), drawn[int(np.argmin(values))]
    for _ in range(CHANGES):
        step = generator.choice(STEPS) * generator.standard_normal(space.size)
        near = np.clip(point + step, 0.0, 1.0)
        error = space.value(near)
        if error < value:
            value, point = error, near
    return value


def worsened(front: Sequence[BestCandidate]) -> list[str]:
    """Return the teams of a front that are worse than one with a vehicle or landmark less."""
    teams = {(team.cell.vehicles, team.cell.landmarks): team.value for team in front}
    return [
        f"{vehicles}/{landmarks}: {value:.4g} m, {fewer[0]}/{fewer[1]}: {teams[fewer]:.4g} m"
        for (vehicles, landmarks), value in teams.items()
        for fewer in ((vehicles - 1, landmarks), (vehicles, landmarks - 1))
        if value > teams.get(fewer, np.inf) * (1.0 + ROUNDING)
    ]
