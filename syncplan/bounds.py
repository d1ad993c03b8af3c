"""Cramer-Rao bounds: the least error any unbiased filter can have along the nominal circles.

The posterior bound with motion noise is the covariance recursion along the nominal path. Errors
are referred to time 0 by the closed-form transition, so that prediction only adds noise:

    P <- P + Phi(0, k) G Q G^T Phi(0, k)^T      block diagonal, one 3 x 3 block a vehicle
    P <- P - P H^T (H P H^T + 1)^-1 H P         H: the rows of the windowed matrix, sigma = 1

Positions are in mean radii until the end.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from syncplan.contacts import Sensors, Windows
from syncplan.errors import NoSolutionError
from syncplan.noise import Noise
from syncplan.observability import Observability, bearing_rows
from syncplan.orbits import Orbits, perpendicular, position, unit
from syncplan.sightings import sample_sightings, steps_within

__all__ = [
    "PosteriorBound",
    "arc_noise_gain",
    "posterior_bound",
    "steady_bound",
    "window_bound",
]

Array = NDArray[np.float64]

_DOUBLINGS = 60
_SETTLED, _SETTLED_BY_ROUNDING = 1e-12, 1e-8
_INDEFINITE = (
    "no posterior bound: the sigmas span too many orders of magnitude for its covariance to stay "
    "positive definite"
)


@dataclass(frozen=True, slots=True)
class PosteriorBound:
    """The bound along a run from the initial sigmas.

    Attributes
    ----------
    position_variance : (steps + 1, n) m^2, trace of each vehicle's position block at k Ts
    heading_variance : (steps + 1, n) rad^2
    """

    position_variance: Array
    heading_variance: Array

    def rms_second_half(self) -> Array:
        """Return (n,) RMS position bound in m over the samples k with 2 k > steps."""
        steps = len(self.position_variance) - 1
        return np.asarray(np.sqrt(self.position_variance[steps // 2 + 1 :].mean(axis=0)))


def arc_noise_gain(orbits: Orbits, sample_time: float) -> Array:
    """Return (n, 3, 2) derivatives of a step's (x, y, heading) by speed and turn rate.

    In the frame of the heading at the step's start. With h half the angle turned in a step, the
    chord is v Ts sinc(h) e(h).
    """
    half = 0.5 * orbits.turn_rates * sample_time
    sinc = np.sinc(half / np.pi)
    slope = np.where(np.abs(half) < 1e-4, -half / 3.0, (np.cos(half) - sinc) / _nonzero(half))
    along = unit(half)
    across = perpendicular(along)
    gain = np.zeros((orbits.count, 3, 2))
    gain[:, :2, 0] = sample_time * sinc[:, None] * along
    swing = 0.5 * sample_time**2 * orbits.speeds
    gain[:, :2, 1] = swing[:, None] * (slope[:, None] * along + sinc[:, None] * across)
    gain[:, 2, 1] = sample_time
    return gain


def window_bound(result: Observability) -> Array:
    """Return (n,) m: the bound on each initial position from one window, without motion noise.

    NaN for a vehicle whose position is not determined.
    """
    variance = result.variances.reshape(-1, 3)[:, :2].sum(axis=1)
    lost = np.sum(result.null_space**2, axis=0).reshape(-1, 3)[:, :2].sum(axis=1)
    return np.where(lost > 1e-9, np.nan, result.scale * np.sqrt(variance))


def posterior_bound(
    orbits: Orbits,
    landmarks: Array,
    sensors: Sensors,
    windows: Windows,
    noise: Noise,
    duration: float,
) -> PosteriorBound:
    """Return the posterior bound over `duration` s, sightings at k Ts with k >= 1.

    Raises NoSolutionError where the covariance stops being positive definite in floating point:
    sigmas that span too many orders of magnitude.
    """
    steps = steps_within(duration, sensors.sample_time)
    system = _ReferredSystem.along(orbits, landmarks, sensors, windows, noise, steps)
    sigma = np.array([noise.position_sigma, noise.position_sigma, noise.heading_sigma])
    sigma[:2] /= system.scale
    covariance = np.diag(np.tile(sigma**2, orbits.count))
    try:
        bound = system.run(covariance)[1]
    except np.linalg.LinAlgError:
        raise NoSolutionError(_INDEFINITE) from None
    if np.any(bound.position_variance < 0.0):
        raise NoSolutionError(_INDEFINITE)
    return bound


def steady_bound(
    orbits: Orbits,
    landmarks: Array,
    sensors: Sensors,
    windows: Windows,
    noise: Noise,
) -> Array:
    """Return (n,) m: RMS position bound over a period once it has become periodic.

    The fixed point of one period's Riccati map, found by doubling it. The period is taken as a
    whole number of samples, at least one, and the sample time changed to fit. Infinite where the
    bound never settles: unobservable teams.
    """
    samples = max(round(orbits.period / sensors.sample_time), 1)
    even = Sensors(
        sensors.ranges,
        sensors.fields_of_view,
        sensors.boresights,
        sensors.bearing_sigmas,
        orbits.period / samples,
    )
    system = _ReferredSystem.along(orbits, landmarks, even, windows, noise, samples)
    try:
        covariance = _periodic_covariance(system)
        if covariance is None:
            return np.full(orbits.count, np.inf)
        bound = system.run(covariance)[1]
    except np.linalg.LinAlgError:
        return np.full(orbits.count, np.inf)
    variance = bound.position_variance[1:].mean(axis=0)
    with np.errstate(invalid="ignore"):
        return np.where(variance >= 0.0, np.sqrt(variance), np.inf)


@dataclass(frozen=True, slots=True)
class _ReferredSystem:
    """A run with all errors referred to time 0: noise added per step, whitened bearing rows."""

    noise_blocks: Array  # (steps + 1, n, 3, 3), of the step that ends at k
    rows: Array  # (s, 6)
    columns: NDArray[np.int64]  # (s, 6)
    first: NDArray[np.int64]  # (steps + 2,)
    moved: Array  # (steps + 1, n, 2) way gone, in mean radii
    scale: float

    @classmethod
    def along(
        cls,
        orbits: Orbits,
        landmarks: Array,
        sensors: Sensors,
        windows: Windows,
        noise: Noise,
        steps: int,
    ) -> "_ReferredSystem":
        sample_time = sensors.sample_time
        sightings = sample_sightings(windows, orbits.period, sample_time, 1, steps)
        columns = np.concatenate(
            [
                3 * sightings.observers[:, None] + np.arange(3),
                3 * np.where(sightings.targets < orbits.count, sightings.targets, 0)[:, None]
                + np.arange(3),
            ],
            axis=1,
        )
        scale = float(orbits.radii.mean())
        path = position(orbits, np.arange(steps + 1) * sample_time)
        moved = (path - path[0]) / scale
        return cls(
            noise_blocks=_referred_noise(orbits, noise, sample_time, moved, scale),
            rows=bearing_rows(orbits, landmarks, sensors, sightings),
            columns=columns,
            first=sightings.first_of_steps(steps),
            moved=moved,
            scale=scale,
        )

    def run(self, covariance: Array) -> tuple[Array, PosteriorBound]:
        """Return the last covariance and the bound along the run."""
        steps, count = len(self.moved) - 1, self.moved.shape[1]
        covariance = covariance.copy()
        blocks = np.empty((steps + 1, count, 3, 3))
        vehicles = np.arange(count)
        view = _diagonal_blocks(covariance)
        blocks[0] = view[vehicles, :, vehicles, :]
        for k in range(1, steps + 1):
            view[vehicles, :, vehicles, :] += self.noise_blocks[k]
            begin, end = self.first[k], self.first[k + 1]
            if begin < end:
                _update(covariance, self.rows[begin:end], self.columns[begin:end])
            blocks[k] = view[vehicles, :, vehicles, :]
        return covariance, self._at_each_time(blocks)

    def _at_each_time(self, blocks: Array) -> PosteriorBound:
        """Carry each vehicle's block from time 0 to its own time."""
        turn = perpendicular(self.moved)
        spread = (
            np.trace(blocks[..., :2, :2], axis1=-2, axis2=-1)
            + 2.0 * np.sum(turn * blocks[..., :2, 2], axis=-1)
            + np.sum(turn**2, axis=-1) * blocks[..., 2, 2]
        )
        return PosteriorBound(self.scale**2 * spread, blocks[..., 2, 2])


def _referred_noise(
    orbits: Orbits, noise: Noise, sample_time: float, moved: Array, scale: float
) -> Array:
    """(steps + 1, n, 3, 3) motion noise of the step that ends at k, referred to time 0."""
    gain = arc_noise_gain(orbits, sample_time) * np.array(
        [noise.speed_sigma, noise.turn_rate_sigma]
    )
    gain[:, :2] /= scale
    steps = len(moved) - 1
    start = orbits.phases + orbits.senses * np.pi / 2.0
    angle = start + orbits.turn_rates * sample_time * np.arange(-1, steps)[:, None]
    ahead = unit(angle)
    axes = np.stack([ahead, perpendicular(ahead)], axis=-1)
    turned = np.empty((steps + 1, orbits.count, 3, 2))
    turned[..., :2, :] = axes @ gain[:, :2, :]
    turned[..., 2, :] = gain[:, 2, :]
    turned[..., :2, :] -= perpendicular(moved)[..., None] * turned[..., 2:, :]
    return np.asarray(turned @ np.swapaxes(turned, -1, -2))


def _diagonal_blocks(covariance: Array) -> Array:
    """View of the covariance as (n, 3, n, 3)."""
    count = len(covariance) // 3
    return covariance.reshape(count, 3, count, 3)


def _update(covariance: Array, rows: Array, columns: NDArray[np.int64]) -> None:
    """Bring m whitened bearings into the covariance, in place."""
    gathered = np.einsum("nmc,mc->nm", covariance[:, columns], rows)
    innovation = np.einsum("mc,mcl->ml", rows, gathered[columns])
    innovation[np.diag_indices_from(innovation)] += 1.0
    factor = np.linalg.cholesky(innovation)
    half = np.linalg.solve(factor, gathered.T)
    covariance -= half.T @ half


def _periodic_covariance(system: _ReferredSystem) -> Array | None:
    """Fixed point of one period's map P -> A P (I + C P)^-1 A^T + B, by structured doubling."""
    size = 3 * system.moved.shape[1]
    a, b, c = _period_map(system, size)
    last = np.inf
    for _ in range(_DOUBLINGS):
        grown = _composed((a, b, c), (a, b, c))
        change = np.max(np.abs(grown[1] - b))
        a, b, c = grown
        if not np.isfinite(change) or np.max(np.abs(b)) > 1e12:
            return None
        settled = change / max(float(np.max(np.abs(b))), 1e-300)
        if settled <= _SETTLED or (settled <= _SETTLED_BY_ROUNDING and change >= last):
            return 0.5 * (b + b.T)
        last = change
    return None


def _period_map(system: _ReferredSystem, size: int) -> tuple[Array, Array, Array]:
    count = size // 3
    vehicles = np.arange(count)
    identity, zero = np.eye(size), np.zeros((size, size))
    total = (identity, zero, zero)
    for k in range(1, len(system.moved)):
        added = np.zeros((size, size))
        _diagonal_blocks(added)[vehicles, :, vehicles, :] = system.noise_blocks[k]
        total = _composed(total, (identity, added, zero))
        begin, end = system.first[k], system.first[k + 1]
        if begin < end:
            dense = np.zeros((end - begin, size))
            np.add.at(
                dense,
                (np.arange(end - begin)[:, None], system.columns[begin:end]),
                system.rows[begin:end],
            )
            total = _composed(total, (identity, zero, dense.T @ dense))
    return total


def _composed(
    first: tuple[Array, Array, Array], then: tuple[Array, Array, Array]
) -> tuple[Array, Array, Array]:
    """The map that does `first`, then `then`; each is P -> A P (I + C P)^-1 A^T + B."""
    a1, b1, c1 = first
    a2, b2, c2 = then
    inner = np.linalg.inv(np.eye(len(a1)) + b1 @ c2)
    middle = a2 @ inner
    return middle @ a1, b2 + middle @ b1 @ a2.T, c1 + a1.T @ c2 @ inner @ a1


def _nonzero(value: Array) -> Array:
    return np.where(value == 0.0, 1.0, value)
