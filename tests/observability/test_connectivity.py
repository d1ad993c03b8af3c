"""The connectivity period against every window looked at by itself."""

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest

from syncplan.observability.rank import (
    LINK_TOLERANCE,
    Assessment,
    assess_team,
    certify,
    link_information,
)
from syncplan.observability.sliding_windows import (
    SEARCHED_PERIODS,
    _clearly_certified,
    _Starts,
    connectivity_period,
)
from syncplan.orbits.sightings import Sightings, sample_sightings, steps_within
from syncplan.orbits.team import Team
from tests.tools.draws import draw_equipped_team, draw_team

SAMPLES = 14


def _coarse(team: Team) -> Assessment:
    """The team with few samples a period, which do not divide it, over one period."""
    rare = replace(team.sensors, sample_time=team.orbits.period / (SAMPLES - 0.3))
    return assess_team(replace(team, sensors=rare), team.orbits.period)


def _window_by_window(assessed: Assessment) -> float | None:
    """The longest of all starts' shortest windows that certify, each grown sample by sample."""
    team, windows, verdict = assessed.team, assessed.windows, assessed.observability
    orbits, sensors = team.orbits, team.sensors
    samples = steps_within(orbits.period, sensors.sample_time) + 1
    last = (1 + SEARCHED_PERIODS) * samples
    seen = sample_sightings(windows, orbits.period, sensors, 0, last)
    worst = 0
    for start in range(samples):
        for end in range(start, last + 1):
            inside = (seen.steps >= start) & (seen.steps <= end)
            part = Sightings(*(getattr(seen, field.name)[inside] for field in fields(seen)))
            links = link_information(team, part)
            if certify(team, verdict, links).holds:
                worst = max(worst, end - start + 1)
                break
        else:
            return None
    return None if worst > SEARCHED_PERIODS * samples else worst * sensors.sample_time


@pytest.mark.parametrize("draw", [draw_team, draw_equipped_team])
@pytest.mark.parametrize("seed", range(6))
def test_the_connectivity_period_is_the_longest_of_all_shortest_windows(
    seed: int, draw: Callable[[np.random.Generator], Team]
) -> None:
    generator = np.random.default_rng(seed)
    found = 0
    while found < 2:
        assessed = _coarse(draw(generator))
        ours = connectivity_period(assessed)
        assert ours == pytest.approx(_window_by_window(assessed))
        found += ours is not None


@pytest.mark.parametrize("needed", [2, 3])
def test_rank_beyond_doubt_is_rank_by_singular_values(needed: int) -> None:
    generator = np.random.default_rng(needed)
    length, windows = 5, 4000
    rows = generator.normal(size=(windows * length, 6))
    # windows from well conditioned to degenerate, and from weak to strong
    share = 10.0 ** generator.uniform(-9.0, 0.0, (windows, 1, 1))
    blocks = rows.reshape(windows, length, 6)
    blocks[:, :, needed - 1 :] *= share
    blocks *= 10.0 ** generator.uniform(-6.0, 2.0, (windows, 1, 1))
    first = length * np.arange(windows)
    starts = _Starts(rows, np.arange(windows), first, np.full(windows, length), first * 0 + needed)
    squares = np.cumsum(np.concatenate([[0.0], np.sum(rows**2, axis=1)]))
    values = np.linalg.svd(blocks, compute_uv=False)
    for largest in (1e-3, 1.0, 1e3):
        clear = _clearly_certified(starts, squares, np.full(windows, length), largest)
        counted = values[:, needed - 1] > LINK_TOLERANCE * np.maximum(values[:, 0], largest)
        assert not np.any(clear & ~counted)
        assert clear.sum() > 0.4 * counted.sum()
