"""The connectivity period against every window looked at by itself."""

from dataclasses import replace

import numpy as np
import pytest

from syncplan.observability.certificate import certify
from syncplan.observability.connectivity import SEARCHED_PERIODS, connectivity_period
from syncplan.observability.rank import Observability, assess, link_information
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import Windows, find_windows
from syncplan.orbits.sensors import Sensors
from syncplan.orbits.sightings import Sightings, sample_sightings, samples_before, steps_within
from tests.tools.draws import Team, draw_team

SAMPLES = 14


def _coarse(team: Team) -> tuple[Orbits, np.ndarray, Sensors, Windows, Observability]:
    """The team with few samples a period, which do not divide it, and its verdict."""
    orbits, landmarks = team.orbits, team.landmarks
    sensors = replace(team.sensors, sample_time=orbits.period / (SAMPLES - 0.3))
    windows = find_windows(orbits, landmarks, sensors)
    last = samples_before(orbits.period, sensors.sample_time) - 1
    seen = sample_sightings(windows, orbits.period, sensors.sample_time, 0, last)
    verdict = assess(orbits, link_information(orbits, landmarks, sensors, seen))
    return orbits, landmarks, sensors, windows, verdict


def _window_by_window(
    orbits: Orbits,
    landmarks: np.ndarray,
    sensors: Sensors,
    windows: Windows,
    verdict: Observability,
) -> float | None:
    """The longest of all starts' shortest windows that certify, each grown sample by sample."""
    samples = steps_within(orbits.period, sensors.sample_time) + 1
    last = (1 + SEARCHED_PERIODS) * samples
    seen = sample_sightings(windows, orbits.period, sensors.sample_time, 0, last)
    worst = 0
    for start in range(samples):
        for end in range(start, last + 1):
            inside = (seen.steps >= start) & (seen.steps <= end)
            part = Sightings(seen.steps[inside], seen.observers[inside], seen.targets[inside])
            links = link_information(orbits, landmarks, sensors, part)
            if certify(orbits.count, landmarks, verdict, links).holds:
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
        team = draw_team(generator)
        parts = _coarse(team)
        ours = connectivity_period(*parts[:4], float(parts[4].singular_values[0]))
        assert ours == pytest.approx(_window_by_window(*parts))
        found += ours is not None
