"""Kinds of sighting against finite differences: those there are, and a distance beside them."""

from dataclasses import replace

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.observability.rank import sighting_rows
from syncplan.orbits.circles import heading, position
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS, SightingKind
from syncplan.orbits.team import Team
from tests.tools.draws import draw_team, sightings_of


def _distance_slopes(q: Array, weights: Array) -> Array:
    return np.asarray(q * (weights / np.hypot(*q)))


DISTANCE = SightingKind(
    sigmas=lambda sensors: np.full(len(sensors.ranges), 0.5),
    measured=lambda q, _: np.hypot(q[0], q[1]),
    slopes=_distance_slopes,
    by_heading=0.0,
)
KINDS = SIGHTING_KINDS | {"distance": DISTANCE}


@pytest.mark.parametrize("name", KINDS)
def test_slopes_are_the_derivative_of_what_is_measured(name: str) -> None:
    kind, h = KINDS[name], 1e-6
    q, psi = np.random.default_rng(1).normal(size=(2, 50)), np.full(50, 0.3)
    weights = np.linspace(0.5, 2.0, 50)
    slopes = kind.slopes(q, weights)
    for axis, step in enumerate(h * np.eye(2)[:, :, None]):
        change = kind.measured(q + step, psi) - kind.measured(q - step, psi)
        np.testing.assert_allclose(slopes[axis], weights * change / (2.0 * h), rtol=1e-4)
    turned = kind.measured(q, psi + h) - kind.measured(q, psi - h)
    np.testing.assert_allclose(turned / (2.0 * h), kind.by_heading, atol=1e-8)


def _measured_after(team: Team, kind: SightingKind, a: int, change: Array, time: float) -> float:
    """What a sees of b = 0 at `time` if a starts off by `change` (x, y, heading)."""
    orbits = team.orbits
    turn = np.array(
        [[np.cos(change[2]), -np.sin(change[2])], [np.sin(change[2]), np.cos(change[2])]]
    )
    begin, now = position(orbits, 0.0)[a], position(orbits, time)[a]
    own = begin + change[:2] + turn @ (now - begin)
    ahead = heading(orbits, time)[a] + change[2]
    return float(kind.measured(position(orbits, time)[0] - own, ahead))


@pytest.mark.parametrize("name", KINDS)
def test_rows_of_any_kind_are_the_derivative_by_the_observers_pose(name: str) -> None:
    kind, checked = KINDS[name], 0
    for seed in range(40):
        team = draw_team(np.random.default_rng(seed))
        team = replace(team, landmarks=team.landmarks[:0])
        seen = sightings_of(team, 30)
        rows = sighting_rows(team, seen, 1.0, kind)
        for s in np.flatnonzero(seen.targets == 0)[:: max(len(rows) // 5, 1)]:
            a, time = int(seen.observers[s]), float(seen.steps[s]) * team.sensors.sample_time
            away = position(team.orbits, time)[a] - position(team.orbits, time)[0]
            if np.hypot(*away) < 0.05 * team.orbits.radii.mean():
                continue
            steps = np.diag([1e-6 * team.orbits.radii.mean()] * 2 + [1e-6])
            numeric = [
                (
                    _measured_after(team, kind, a, +one, time)
                    - _measured_after(team, kind, a, -one, time)
                )
                for one in steps
            ]
            if max(abs(value) for value in numeric) > 1.0:
                continue  # the branch cut of the arc tangent
            expected = np.array(numeric) / (2.0 * np.diag(steps)) / kind.sigmas(team.sensors)[a]
            scale = np.abs(rows[s]).max()
            np.testing.assert_allclose(rows[s, :3], expected, atol=1e-4 * scale + 1e-6)
            checked += 1
    assert checked > 20
