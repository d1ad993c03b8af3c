"""Orbits against finite differences and integration."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.orbits.circles import Orbits, heading, phase, position, transition, wrap


@pytest.fixture
def orbits() -> Orbits:
    return Orbits(
        centers=np.array([[1.0, 2.0], [-3.0, 5.0]]),
        radii=np.array([2.0, 0.7]),
        senses=np.array([1.0, -1.0]),
        phases=np.array([0.3, 2.0]),
        rate=0.8,
    )


def test_the_velocity_points_along_the_heading(orbits: Orbits) -> None:
    t, h = 1.7, 1e-6
    velocity = (position(orbits, t + h) - position(orbits, t - h)) / (2.0 * h)
    expected = orbits.speeds[:, None] * np.stack(
        [np.cos(heading(orbits, t)), np.sin(heading(orbits, t))], axis=-1
    )
    np.testing.assert_allclose(velocity, expected, atol=1e-8)


def test_positions_repeat_after_a_period(orbits: Orbits) -> None:
    np.testing.assert_allclose(
        position(orbits, 0.4 + orbits.period), position(orbits, 0.4), atol=1e-12
    )


def _flown(orbits: Orbits, k: int, pose: np.ndarray, start: float, end: float) -> np.ndarray:
    """Where vehicle k ends when it starts from `pose` and keeps its speed and turn rate."""
    w, v = orbits.turn_rates[k], orbits.speeds[k]
    x, y, psi = pose
    end_psi = psi + w * (end - start)
    return np.array(
        [
            x + v / w * (np.sin(end_psi) - np.sin(psi)),
            y - v / w * (np.cos(end_psi) - np.cos(psi)),
            end_psi,
        ]
    )


def test_the_transition_is_the_derivative_of_the_flown_pose(orbits: Orbits) -> None:
    start, end, h = 0.6, 2.9, 1e-6
    closed = transition(orbits, end, start)
    for k in range(orbits.count):
        pose = np.append(position(orbits, start)[k], heading(orbits, start)[k])
        numeric = np.empty((3, 3))
        for column in range(3):
            step = np.eye(3)[column] * h
            ahead = _flown(orbits, k, pose + step, start, end)
            behind = _flown(orbits, k, pose - step, start, end)
            numeric[:, column] = (ahead - behind) / (2.0 * h)
        np.testing.assert_allclose(closed[k], numeric, atol=1e-8)


def test_transitions_compose(orbits: Orbits) -> None:
    whole = transition(orbits, 3.0, 0.5)
    parts = transition(orbits, 3.0, 1.2) @ transition(orbits, 1.2, 0.5)
    np.testing.assert_allclose(whole, parts, atol=1e-12)


@given(st.floats(-50.0, 50.0))
def test_wrapped_angles_differ_by_whole_turns(angle: float) -> None:
    wrapped = float(wrap(angle))
    assert -np.pi <= wrapped < np.pi
    assert np.isclose(np.cos(wrapped - angle), 1.0, atol=1e-12)


def test_phase_runs_with_the_sense(orbits: Orbits) -> None:
    np.testing.assert_allclose(phase(orbits, 1.0) - phase(orbits, 0.0), [0.8, -0.8])
