"""Search for a team whose rank differs between the sparse and the dense code.

    python -m tests.searches.search_large_ranks [DRAWS [FIRST]]

Teams of up to 60 vehicles, most close to degenerate, with poses alone and with every kind of error
as states. Part of `make check-all`; `make check` compares some of them, and larger formations.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from syncplan.observability import error_modes, rank
from syncplan.observability.error_modes import assess_extended, judge_errors
from syncplan.observability.rank import Assessment, assess_team
from syncplan.observability.spectrum import RANK_TOLERANCE, Observability
from syncplan.observability.unobservable_modes import name_modes
from syncplan.orbits.team import Team
from tests.tools.draws import draw_equipped_team, draw_team

ROUNDING = 1e-12
"""Share of the largest singular value by which rounding may move another."""

EVERY_KIND = 10_000


def assessed_by(team: Team, most_dense: int) -> Assessment:
    """Return a team's assessment with matrices of more than `most_dense` states sparse."""
    with patch.object(rank, "DENSE_STATES", most_dense):
        return assess_team(team, team.orbits.period)


def differences(team: Team) -> list[str]:
    """Return what the sparse code says of a team that the dense code does not, poses and errors."""
    dense, sparse = assessed_by(team, EVERY_KIND), assessed_by(team, 0)
    found = [f"poses: {one}" for one in between(dense.observability, sparse.observability)]
    if found:
        return found
    if dense.certificate != sparse.certificate:
        found.append("certificate")
    names = [f"v{k + 1}" for k in range(team.count)]
    marks = [f"L{k + 1}" for k in range(len(team.landmarks))]
    named = [
        sorted(mode.description for mode in name_modes(one, names, marks))
        for one in (dense, sparse)
    ]
    # joint motions have any basis
    firm = [[text for text in one if not text.startswith("joint")] for one in named]
    if firm[0] != firm[1] or len(named[0]) != len(named[1]):
        found.append(f"motions {named}")
    return found + _of_errors(dense, sparse, names)


def _of_errors(dense: Assessment, sparse: Assessment, names: list[str]) -> list[str]:
    with patch.object(error_modes, "DENSE_STATES", EVERY_KIND):
        one, first = assess_extended(dense), judge_errors(dense, names, EVERY_KIND)
    with patch.object(error_modes, "DENSE_STATES", 0):
        other, second = assess_extended(sparse), judge_errors(sparse, names, EVERY_KIND)
    if one is None or other is None or first is None or second is None:
        return []
    found = [f"errors: {what}" for what in between(one, other)]
    if not found and len(first.modes) != len(second.modes):
        found.append(f"errors named {[len(first.modes), len(second.modes)]}")
    return found


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
    found = []
    for place in (0, dense.rank - 1):
        off = abs(sparse.singular_values[place] - values[place])
        if off > ROUNDING * largest:
            found.append(f"singular value {place}: {values[place]}, off by {off}")
    if dense.rank < len(values) and shares[dense.rank] > 1e-11:
        off = abs(sparse.gap / dense.gap - 1.0)
        if off > ROUNDING / shares[dense.rank]:
            found.append(f"gap {dense.gap}, sparse {sparse.gap}")
    least = shares[dense.rank - 1]
    below = shares[dense.rank] if dense.rank < len(values) else 0.0
    # null vectors turn by the rounding over the distance of the values on either side
    turned = 100.0 * ROUNDING / (least - below)
    apart = abs(dense.null_space.T @ dense.null_space - sparse.null_space.T @ sparse.null_space)
    if apart.max(initial=0.0) > turned:
        found.append(f"null space: {apart.max()}, limit {turned}")
    still = dense.moved < 1e-18
    if turned < 1e-6 and still.any():
        off = abs(sparse.variances - dense.variances)[still] / dense.variances[still]
        if off.max() > turned:
            found.append(f"variances: {off.max()}, limit {turned}")
    return found


def drawn(number: int, most: int = 60) -> Team:
    """Return the team of a draw: each second one has further sensors, obstacles and errors."""
    generator = np.random.default_rng(number)
    if number % 2:
        return draw_team(generator, most)
    team = draw_equipped_team(generator, most)
    return replace(team, obstacles=())


def judged(number: int) -> tuple[list[str], bool]:
    """Return the differences of a draw, and whether it is observable."""
    team = drawn(number)
    return differences(team), assessed_by(team, 0).observability.observable


def main(draws: int = 2000, first: int = 0) -> list[int]:
    """Return the numbers of draws that differ, of `draws` random teams from number `first` on."""
    numbers = range(first, first + draws)
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(judged, numbers, chunksize=20))
    failures = [number for number, (one, _) in zip(numbers, found, strict=True) if one]
    observable = sum(one for _, one in found)
    print(f"{draws} draws, {observable} observable; {len(failures)} differ {failures[:10]}")
    for number in failures[:10]:
        print(number, found[number - first][0])
    return failures


if __name__ == "__main__":
    sys.exit(bool(main(*(int(argument) for argument in sys.argv[1:]))))
