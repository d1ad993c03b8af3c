"""Circular orbits: positions and headings of vehicles, and their paths as polynomials in time.

A body is at center + cosine cos(tau) + sine sin(tau), with tau = omega t; a landmark stands still.
A direction fixed to a vehicle is along ray cos(tau) + turned sin(tau): on a circle the heading
turns at the rate itself. An ellipse has both forms too, the second along its velocity. Contacts
need nothing else of a path.

Quantities of two bodies, such as their squared distance, are then trigonometric polynomials of
degree two,

    p(tau) = c0 + c1 cos tau + s1 sin tau + c2 cos 2 tau + s2 sin 2 tau

whose real roots are found, many at once, in the half-angle u = tan((tau - pi - peak) / 2), where
`peak` is where |p| is largest among eight samples. That turns p into a real quartic whose leading
coefficient is p(peak) itself, so it never vanishes unless p does: nothing needs to be deflated, and
no root can be lost at infinity. Polynomials without a second harmonic take the arccosine instead.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from syncplan.arrays import Array, Flags, Index, short_repr


@dataclass(frozen=True, slots=True, repr=False)
class Orbits:
    """Synchronised circular orbits of n vehicles.

    Attributes
    ----------
    centers : (n, 2) m
    radii : (n,) m
    senses : (n,) +1 counter-clockwise, -1 clockwise
    phases : (n,) rad, angle from +x about the centre at time 0
    rate : rad/s, common to all
    """

    centers: Array
    radii: Array
    senses: Array
    phases: Array
    rate: float

    __repr__ = short_repr

    @property
    def count(self) -> int:
        """Number of vehicles."""
        return len(self.radii)

    @property
    def period(self) -> float:
        """Time of one turn in seconds, 2 pi / rate."""
        return 2.0 * np.pi / self.rate

    @property
    def speeds(self) -> Array:
        """(n,) speed of each vehicle in m/s, rate times radius."""
        return self.rate * self.radii

    @property
    def turn_rates(self) -> Array:
        """(n,) signed turn rate of each vehicle in rad/s."""
        return self.rate * self.senses

    def only(self, vehicles: Index) -> "Orbits":
        """Return the orbits of the vehicles (k,), in that order; a vehicle may occur twice."""
        names = ("centers", "radii", "senses", "phases")
        return replace(self, **{name: getattr(self, name)[vehicles] for name in names})


def unit(angle: ArrayLike) -> Array:
    """Return the unit vectors e(angle), shape (..., 2)."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


EXTENT_POINTS = 32
"""Points of a circle that stand for it in an extent: to half a per cent of the radius."""


def extent(orbits: Orbits, landmarks: Array) -> Array:
    """Return points (k, 2) m around all circles, and the landmarks (l, 2) m."""
    around = unit(2.0 * np.pi / EXTENT_POINTS * np.arange(EXTENT_POINTS))
    circles = orbits.centers[:, None] + orbits.radii[:, None, None] * around
    return np.concatenate([circles.reshape(-1, 2), landmarks.reshape(-1, 2)])


def perpendicular(vector: Array) -> Array:
    """Return the vectors turned a quarter turn counter-clockwise, shape (..., 2)."""
    return np.stack([-vector[..., 1], vector[..., 0]], axis=-1)


def dot(a: Array, b: Array) -> Array:
    """Return the scalar products (...) of vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1])


def cross(a: Array, b: Array) -> Array:
    """Return the cross products (...) of vectors (..., 2).

    They are |a| |b| times the sine of the angle from a to b, counter-clockwise.
    """
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def turned(vectors: Array, angle: float) -> Array:
    """Return the vectors (..., 2) turned counter-clockwise by `angle` rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(vectors @ np.array([[c, s], [-s, c]]))


def wrap(angle: ArrayLike) -> Array:
    """Return the angles wrapped to [-pi, pi), in rad."""
    return np.asarray((np.asarray(angle, dtype=float) + np.pi) % (2.0 * np.pi) - np.pi)


def phase(orbits: Orbits, time: ArrayLike) -> Array:
    """Return the (..., n) phase angles in rad at `time` s, phi_i + d_i omega t."""
    t = np.asarray(time, dtype=float)[..., None]
    return np.asarray(orbits.phases + orbits.senses * orbits.rate * t)


def position(orbits: Orbits, time: ArrayLike) -> Array:
    """Return the (..., n, 2) positions in m at `time` s."""
    return np.asarray(orbits.centers + orbits.radii[:, None] * unit(phase(orbits, time)))


def heading(orbits: Orbits, time: ArrayLike) -> Array:
    """Return the (..., n) headings in rad at `time` s: phase plus a quarter turn in the sense."""
    return np.asarray(phase(orbits, time) + orbits.senses * np.pi / 2.0)


# --- paths in time ------------------------------------------------------------------------------


NO_LANDMARKS: Array = np.zeros((0, 2))
"""Landmarks of a team that has none, or is considered without them."""


@dataclass(frozen=True, slots=True)
class RelativeMotion:
    """Position of targets relative to observers, offset + cosine cos(tau) + sine sin(tau), in m.

    Attributes
    ----------
    offset, cosine, sine : (p, 2) m
    circular : (p,) whether cosine and sine are equal in length and perpendicular, exactly: vehicles
        of one sense, and landmarks
    """

    offset: Array
    cosine: Array
    sine: Array
    circular: Flags

    def only(self, pairs: Index) -> "RelativeMotion":
        """Return the motion of the pairs (k,), in that order."""
        return RelativeMotion(
            self.offset[pairs], self.cosine[pairs], self.sine[pairs], self.circular[pairs]
        )

    def at(self, tau: Array) -> Array:
        """Return the relative positions (p, k, 2) at tau (p, k) or (k,) rad."""
        cos, sin = np.cos(tau)[..., None], np.sin(tau)[..., None]
        return np.asarray(
            self.offset[:, None] + self.cosine[:, None] * cos + self.sine[:, None] * sin
        )


def body_paths(orbits: Orbits, landmarks: Array = NO_LANDMARKS) -> tuple[Array, Array, Array]:
    """Return (center, cosine, sine), each (n + m, 2) in m: vehicles, then landmarks.

    A body's position is center + cosine cos(tau) + sine sin(tau), with tau = omega t.
    """
    still = np.zeros((len(landmarks), 2))
    arm = orbits.radii[:, None] * unit(orbits.phases)
    return (
        np.concatenate([orbits.centers, landmarks.reshape(-1, 2)]),
        np.concatenate([arm, still]),
        np.concatenate([orbits.senses[:, None] * perpendicular(arm), still]),
    )


def relative_motion(
    orbits: Orbits, a: Index, b: Index, landmarks: Array = NO_LANDMARKS
) -> RelativeMotion:
    """Return the motion of bodies `b` relative to vehicles `a`; bodies from n on are landmarks."""
    center, cosine, sine = body_paths(orbits, landmarks)
    senses = np.concatenate([orbits.senses, np.zeros(len(landmarks))])
    return RelativeMotion(
        offset=center[b] - center[a],
        cosine=cosine[b] - cosine[a],
        sine=sine[b] - sine[a],
        circular=(b >= orbits.count) | (senses[a] == senses[b]),
    )


def rays(orbits: Orbits, vehicles: Index, boresights: Array, offsets: Array) -> tuple[Array, Array]:
    """Return (ray, turned), each (p, 2): the direction `offsets` rad off the boresight of a sensor.

    At tau it is along ray cos(tau) + turned sin(tau); `boresights` are (p,) rad from the heading.
    """
    ray = unit(_axes(orbits, vehicles, boresights) + offsets)
    return ray, orbits.senses[vehicles][:, None] * perpendicular(ray)


def directions_at(orbits: Orbits, vehicles: Index, boresights: Array, tau: Array) -> Array:
    """Return the unit vectors (p, k, 2) along the boresights (p,) rad at tau (p, k) rad."""
    axes, senses = _axes(orbits, vehicles, boresights), orbits.senses[vehicles]
    return unit(axes[:, None] + senses[:, None] * tau)


def _axes(orbits: Orbits, vehicles: Index, boresights: Array) -> Array:
    """(p,) rad: directions of the boresights at time 0."""
    return np.asarray(heading(orbits, 0.0)[vehicles] + boresights)


# --- trigonometric polynomials ------------------------------------------------------------------


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
