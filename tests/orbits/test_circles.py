"""Orbits against finite differences and integration."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.orbits.circles import Orbits, heading, phase, position, wrap


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


@given(st.floats(-50.0, 50.0))
def test_wrapped_angles_differ_by_whole_turns(angle: float) -> None:
    wrapped = float(wrap(angle))
    assert -np.pi <= wrapped < np.pi
    assert np.isclose(np.cos(wrapped - angle), 1.0, atol=1e-12)


def test_phase_runs_with_the_sense(orbits: Orbits) -> None:
    np.testing.assert_allclose(phase(orbits, 1.0) - phase(orbits, 0.0), [0.8, -0.8])
