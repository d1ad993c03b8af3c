"""Trigonometric polynomials of degree two and their real roots, many at once.

    p(tau) = c0 + c1 cos tau + s1 sin tau + c2 cos 2 tau + s2 sin 2 tau

Roots are found in the half-angle u = tan((tau - pi - peak) / 2), where `peak` is where |p| is
largest among eight samples. That turns p into a real quartic whose leading coefficient is p(peak)
itself, so it never vanishes unless p does: nothing needs to be deflated, and no root can be lost
at infinity. Polynomials without a second harmonic take the arccosine instead.
"""

import numpy as np
from numpy.typing import ArrayLike

from syncplan.arrays import Array

NEARLY_REAL = 1e-3
"""Imaginary part, relative to 1 + u^2, up to which a quartic's root is kept as a candidate."""

_POLISH_STEPS = 2
_LARGEST_POLISH_RAD = 1e-2


def evaluate(coefficients: Array, tau: ArrayLike) -> Array:
    """Return p(tau) for coefficients (..., 5) = (c0, c1, s1, c2, s2) broadcast against tau."""
    t = np.asarray(tau, dtype=float)
    cos, sin = np.cos(t), np.sin(t)
    c0, c1, s1, c2, s2 = np.moveaxis(coefficients, -1, 0)
    return np.asarray(c0 + cos * (c1 + 2.0 * (c2 * cos + s2 * sin)) + s1 * sin - c2)


def derivative(coefficients: Array) -> Array:
    """Return the coefficients (..., 5) of dp/dtau."""
    _, c1, s1, c2, s2 = np.moveaxis(coefficients, -1, 0)
    return np.stack([np.zeros_like(c1), s1, -c1, 2.0 * s2, -2.0 * c2], axis=-1)


def rotate(coefficients: Array, shift: Array) -> Array:
    """Return the coefficients (..., 5) of tau -> p(tau + shift)."""
    c0, c1, s1, c2, s2 = np.moveaxis(coefficients, -1, 0)
    cos, sin = np.cos(shift), np.sin(shift)
    cos2, sin2 = np.cos(2.0 * shift), np.sin(2.0 * shift)
    return np.stack(
        [
            c0,
            c1 * cos + s1 * sin,
            s1 * cos - c1 * sin,
            c2 * cos2 + s2 * sin2,
            s2 * cos2 - c2 * sin2,
        ],
        axis=-1,
    )


def real_roots(coefficients: Array) -> Array:
    """Return candidate roots (p, 4) in [0, 2 pi), NaN where there are fewer than four.

    Every real root is among them, to about machine precision times max|c| / |p'|. A pair of
    complex roots close to the real axis leaves its real part as a candidate too: callers treat
    candidates as points to split at and classify what lies between them, where a spurious one
    does no harm. A polynomial that is identically zero has none.
    """
    roots = np.full((len(coefficients), 4), np.nan)
    quartic = (coefficients[:, 3] != 0.0) | (coefficients[:, 4] != 0.0)
    if not quartic.all():
        roots[~quartic, :2] = _roots_of_first_harmonic(coefficients[~quartic])
    if quartic.any():
        chosen = coefficients[quartic]
        roots[quartic] = _polish(chosen, _roots_of_quartic(chosen))
    return np.asarray(roots % (2.0 * np.pi))


def _roots_of_first_harmonic(coefficients: Array) -> Array:
    c0, c1, s1 = coefficients[:, 0], coefficients[:, 1], coefficients[:, 2]
    amplitude = np.hypot(c1, s1)
    with np.errstate(divide="ignore", invalid="ignore"):
        half_width = np.arccos(-c0 / amplitude)
    middle = np.arctan2(s1, c1)
    return np.column_stack([middle - half_width, middle + half_width])


def _roots_of_quartic(coefficients: Array) -> Array:
    samples = np.arange(8) * (np.pi / 4.0)
    values = evaluate(coefficients[:, None, :], samples)
    shift = samples[np.argmax(np.abs(values), axis=1)] + np.pi
    c0, c1, s1, c2, s2 = np.moveaxis(rotate(coefficients, shift), -1, 0)
    quartic = np.column_stack(
        [
            c0 - c1 + c2,
            2.0 * s1 - 4.0 * s2,
            2.0 * c0 - 6.0 * c2,
            2.0 * s1 + 4.0 * s2,
            c0 + c1 + c2,
        ]
    )
    solvable = quartic[:, 0] != 0.0
    monic = quartic[solvable, 1:] / quartic[solvable, :1]
    companion = np.zeros((len(monic), 4, 4))
    companion[:, 0, :] = -monic
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    u = np.linalg.eigvals(companion)
    candidate = np.where(np.abs(u.imag) <= NEARLY_REAL * (1.0 + u.real**2), u.real, np.nan)
    roots = np.full((len(coefficients), 4), np.nan)
    roots[solvable] = 2.0 * np.arctan(candidate) + shift[solvable, None]
    return roots


def _polish(coefficients: Array, roots: Array) -> Array:
    """Newton steps on p itself, kept only while they shrink |p|."""
    p = coefficients[:, None, :]
    slope = derivative(coefficients)[:, None, :]
    value = evaluate(p, roots)
    for _ in range(_POLISH_STEPS):
        with np.errstate(divide="ignore", invalid="ignore"):
            step = value / evaluate(slope, roots)
            trial = roots - np.where(np.abs(step) <= _LARGEST_POLISH_RAD, step, 0.0)
        trial_value = evaluate(p, trial)
        better = np.abs(trial_value) < np.abs(value)
        roots = np.where(better, trial, roots)
        value = np.where(better, trial_value, value)
    return roots
