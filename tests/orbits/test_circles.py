"""Orbits against finite differences and integration."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from syncplan.orbits.circles import Orbits, heading, phase, position, wrap

ORBITS = Orbits(
    np.array([[1.0, 2.0], [-3.0, 5.0]]),
    np.array([2.0, 0.7]),
    np.array([1.0, -1.0]),
    np.array([0.3, 2.0]),
    0.8,
)


def test_the_velocity_points_along_the_heading() -> None:
    t, h = 1.7, 1e-6
    velocity = (position(ORBITS, t + h) - position(ORBITS, t - h)) / (2.0 * h)
    expected = ORBITS.speeds[:, None] * np.stack(
        [np.cos(heading(ORBITS, t)), np.sin(heading(ORBITS, t))], axis=-1
    )
    np.testing.assert_allclose(velocity, expected, atol=1e-8)


def test_positions_repeat_after_a_period() -> None:
    np.testing.assert_allclose(
        position(ORBITS, 0.4 + ORBITS.period), position(ORBITS, 0.4), atol=1e-12
    )


@given(st.floats(-50.0, 50.0))
def test_wrapped_angles_differ_by_whole_turns(angle: float) -> None:
    wrapped = float(wrap(angle))
    assert -np.pi <= wrapped < np.pi
    assert np.isclose(np.cos(wrapped - angle), 1.0, atol=1e-12)


def test_phase_runs_with_the_sense() -> None:
    np.testing.assert_allclose(phase(ORBITS, 1.0) - phase(ORBITS, 0.0), [0.8, -0.8])
