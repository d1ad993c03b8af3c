"""Search for a team whose rank differs between the sparse and the dense code.

Teams are of up to 60 vehicles, most close to degenerate, with poses alone and with every kind of
error as states. Fails where rank, gap, null space, certificate, variances or motions differ.
"""

from collections.abc import Mapping
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from syncplan.observability import error_modes, rank
from syncplan.observability.error_modes import assess_extended, judge_errors
from syncplan.observability.rank import Assessment, assess_team
from syncplan.observability.spectrum import RANK_TOLERANCE, Observability
from syncplan.observability.unobservable_modes import name_modes
from syncplan.orbits.team import Team
from tests.searches import Search
from tests.tools.draws import draw_equipped_team, draw_team

ROUNDING = 1e-12
"""Share of the largest singular value by which rounding may move another."""

EVERY_KIND = 10_000


def assessed_by(team: Team, most_dense: int) -> Assessment:
    """Return a team's assessment with matrices of more than `most_dense` states sparse."""
    with patch.object(rank, "DENSE_STATES", most_dense):
        return assess_team(team, team.orbits.period)


def differences(team: Team) -> list[str]:
    """Return in what the sparse code differs from the dense code, of poses and errors."""
    dense, sparse = assessed_by(team, EVERY_KIND), assessed_by(team, 0)
    if unlike := between(dense.observability, sparse.observability):
        return [f"poses: {difference}" for difference in unlike]
    if dense.certificate != sparse.certificate:
        unlike.append("certificate")
    names = [f"v{k + 1}" for k in range(team.count)]
    marks = [f"L{k + 1}" for k in range(len(team.landmarks))]
    motions = [
        sorted(mode.description for mode in name_modes(assessed, names, marks))
        for assessed in (dense, sparse)
    ]
    # joint motions have any basis
    firm = [[text for text in texts if not text.startswith("joint")] for texts in motions]
    if firm[0] != firm[1] or len(motions[0]) != len(motions[1]):
        unlike.append(f"motions {motions}")
    return unlike + _of_errors(dense, sparse, names)


def _of_errors(dense: Assessment, sparse: Assessment, names: list[str]) -> list[str]:
    with patch.object(error_modes, "DENSE_STATES", EVERY_KIND):
        extended, errors = assess_extended(dense), judge_errors(dense, names, EVERY_KIND)
    with patch.object(error_modes, "DENSE_STATES", 0):
        other, others = assess_extended(sparse), judge_errors(sparse, names, EVERY_KIND)
    if extended is None or other is None or errors is None or others is None:
        return []
    unlike = [f"errors: {difference}" for difference in between(extended, other)]
    if not unlike and len(errors.modes) != len(others.modes):
        unlike.append(f"errors named {[len(errors.modes), len(others.modes)]}")
    return unlike


def between(dense: Observability, sparse: Observability) -> list[str]:
    """Return the differences of two forms of the same matrix, but for rounding."""
    values = dense.singular_values
    largest = values[0]
    if largest == 0.0:
        return [] if sparse.rank == 0 else ["rank of no rows"]
    shares = values / largest
    if np.any(abs(shares / RANK_TOLERANCE - 1.0) < 1e-3):
        return []
    if dense.rank != sparse.rank:
        return [f"rank {dense.rank}, sparse {sparse.rank}"]
    unlike = []
    for place in (0, dense.rank - 1):
        off = abs(sparse.singular_values[place] - values[place])
        if off > ROUNDING * largest:
            unlike.append(f"singular value {place}: {values[place]}, off by {off}")
    if dense.rank < len(values) and shares[dense.rank] > 1e-11:
        off = abs(sparse.gap / dense.gap - 1.0)
        if off > ROUNDING / shares[dense.rank]:
            unlike.append(f"gap {dense.gap}, sparse {sparse.gap}")
    least = shares[dense.rank - 1]
    below = shares[dense.rank] if dense.rank < len(values) else 0.0
    # null vectors turn by the rounding over the distance of the values on either side
    turned = 100.0 * ROUNDING / (least - below)
    apart = abs(dense.null_space.T @ dense.null_space - sparse.null_space.T @ sparse.null_space)
    if apart.max(initial=0.0) > turned:
        unlike.append(f"null space: {apart.max()}, limit {turned}")
    still = dense.moved < 1e-18
    if turned < 1e-6 and still.any():
        off = abs(sparse.variances - dense.variances)[still] / dense.variances[still]
        if off.max() > turned:
            unlike.append(f"variances: {off.max()}, limit {turned}")
    return unlike


def draw_large(number: int, most: int = 60) -> Team:
    """Return the team of a number: each second one has further sensors and errors."""
    generator = np.random.default_rng(number)
    if number % 2:
        return draw_team(generator, most)
    team = draw_equipped_team(generator, most)
    return replace(team, obstacles=())


def draw(number: int) -> tuple[list[str], bool]:
    """Return the differences of a team, and whether it is observable."""
    team = draw_large(number)
    return differences(team), assessed_by(team, 0).observability.observable


def judge(cases: Mapping[int, bool], chance: float) -> list[str]:
    """Print how many teams are observable."""
    print(f"{sum(cases.values())} observable")
    return []


SEARCH = Search(draw, judge, draws=50)
