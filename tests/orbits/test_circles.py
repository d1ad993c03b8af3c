"""Orbits and roots on circles, against finite differences and roots put in by construction."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from syncplan.orbits.circles import (
    Orbits,
    derivative,
    evaluate,
    heading,
    position,
    real_roots,
    rotate,
    wrap,
)

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


@given(st.floats(-50.0, 50.0))
def test_wrapped_angles_differ_by_whole_turns(angle: float) -> None:
    wrapped = float(wrap(angle))
    assert -np.pi <= wrapped < np.pi
    assert np.isclose(np.cos(wrapped - angle), 1.0, atol=1e-12)


# --- roots of trigonometric polynomials -----------------------------------------------------------


ANGLES = np.linspace(0.0, 2.0 * np.pi, 37, endpoint=False)
# below the least normal number a coefficient has too few digits for its roots to mean anything
coefficients = st.lists(st.floats(-10.0, 10.0, allow_subnormal=False), min_size=5, max_size=5).map(
    lambda values: np.array([values])
)


def _from_roots(roots: list[float]) -> np.ndarray:
    """Coefficients of the product of sin((tau - r) / 2) over four given roots."""
    samples = np.arange(8) * np.pi / 4.0
    values = np.prod([np.sin((samples - root) / 2.0) for root in roots], axis=0)
    waves = [part(k * samples) for k in (1, 2) for part in (np.cos, np.sin)]
    basis = np.column_stack([np.ones(8), *waves])
    return np.asarray(np.linalg.lstsq(basis, values, rcond=None)[0][None])


@given(coefficients)
def test_every_sign_change_is_among_the_roots(p: np.ndarray) -> None:
    tau = np.linspace(0.0, 2.0 * np.pi, 2001)
    values = evaluate(p, tau)
    roots = real_roots(p)[0]
    scale = np.max(np.abs(p))
    for k in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0):
        if max(abs(values[k]), abs(values[k + 1])) < 1e-12 * scale:
            continue
        near = np.abs(np.exp(1j * roots) - np.exp(0.5j * (tau[k] + tau[k + 1])))
        assert np.nanmin(near) < 2.0 * np.pi / 2000.0


@given(st.lists(st.floats(0.0, 6.28), min_size=4, max_size=4))
def test_roots_put_in_come_out(roots: list[float]) -> None:
    ordered = np.sort(roots)
    gaps = np.diff(np.append(ordered, ordered[0] + 2.0 * np.pi))
    if gaps.min() < 0.05:
        return
    found = np.sort(real_roots(_from_roots(roots))[0])
    apart = np.abs(np.exp(1j * found)[:, None] - np.exp(1j * ordered)[None])
    assert np.all(apart.min(axis=0) < 1e-10)


def test_a_root_opposite_the_origin_is_not_lost() -> None:
    # tan(tau / 2) is infinite at tau = pi; a companion matrix in it drops that root
    p = np.array([[1.0, 1.0, 0.0, 0.0, 0.3]])
    assert abs(float(evaluate(p, np.pi)[0])) < 1e-15
    assert np.nanmin(np.abs(real_roots(p)[0] - np.pi)) < 1e-12


def test_a_vanishing_second_harmonic_loses_no_roots() -> None:
    exact = real_roots(np.array([[0.3, 1.0, 0.5, 0.0, 0.0]]))[0, :2]
    for tiny in (1e-18, 1e-15, 1e-12, 1e-9):
        found = real_roots(np.array([[0.3, 1.0, 0.5, tiny, -tiny]]))[0]
        for root in exact:
            assert np.nanmin(np.abs(found - root)) < 10.0 * tiny + 1e-14


def test_a_zero_polynomial_has_no_roots() -> None:
    assert np.isnan(real_roots(np.zeros((1, 5)))).all()


@given(coefficients, st.floats(-7.0, 7.0))
def test_rotation_shifts_the_argument(p: np.ndarray, shift: float) -> None:
    turned = rotate(p, np.array([shift]))
    np.testing.assert_allclose(evaluate(turned, ANGLES), evaluate(p, ANGLES + shift), atol=1e-11)


@given(coefficients)
def test_the_derivative_matches_finite_differences(p: np.ndarray) -> None:
    h = 1e-5
    numeric = (evaluate(p, ANGLES + h) - evaluate(p, ANGLES - h)) / (2.0 * h)
    np.testing.assert_allclose(evaluate(derivative(p), ANGLES), numeric, atol=1e-6)
