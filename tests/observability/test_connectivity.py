"""The connectivity period against every window looked at by itself."""

from dataclasses import replace

import numpy as np
import pytest

from syncplan.observability.certificate import certify
from syncplan.observability.connectivity import SEARCHED_PERIODS, connectivity_period
from syncplan.observability.rank import Observability, assess, link_information
from syncplan.orbits.contacts import Windows, find_windows
from syncplan.orbits.sightings import Sightings, sample_sightings, sightings_over, steps_within
from syncplan.orbits.team import Team
from tests.tools.draws import draw_team

SAMPLES = 14


def _coarse(team: Team) -> tuple[Team, Windows, Observability]:
    """The team with few samples a period, which do not divide it, and its verdict."""
    rare = replace(team.sensors, sample_time=team.orbits.period / (SAMPLES - 0.3))
    coarse = replace(team, sensors=rare)
    windows = find_windows(coarse)
    seen = sightings_over(coarse, windows, team.orbits.period)
    return coarse, windows, assess(coarse, link_information(coarse, seen))


def _window_by_window(team: Team, windows: Windows, verdict: Observability) -> float | None:
    """The longest of all starts' shortest windows that certify, each grown sample by sample."""
    orbits, sensors = team.orbits, team.sensors
    samples = steps_within(orbits.period, sensors.sample_time) + 1
    last = (1 + SEARCHED_PERIODS) * samples
    seen = sample_sightings(windows, orbits.period, sensors.sample_time, 0, last)
    worst = 0
    for start in range(samples):
        for end in range(start, last + 1):
            inside = (seen.steps >= start) & (seen.steps <= end)
            part = Sightings(seen.steps[inside], seen.observers[inside], seen.targets[inside])
            links = link_information(team, part)
            if certify(team, verdict, links).holds:
                worst = max(worst, end - start + 1)
                break
        else:
            return None
    return None if worst > SEARCHED_PERIODS * samples else worst * sensors.sample_time


@pytest.mark.parametrize("seed", range(12))
def test_the_connectivity_period_is_the_longest_of_all_shortest_windows(seed: int) -> None:
    generator = np.random.default_rng(seed)
    found = 0
    while found < 2:
        team, windows, verdict = _coarse(draw_team(generator))
        ours = connectivity_period(team, windows, float(verdict.singular_values[0]))
        assert ours == pytest.approx(_window_by_window(team, windows, verdict))
        found += ours is not None
