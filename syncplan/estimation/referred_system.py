"""Run of a team with all errors referred to time 0, and its posterior bound.

Errors are referred to time 0 by the closed-form transition, so prediction only adds noise:

    P <- P + Phi(0, k) G Q G^T Phi(0, k)^T      block diagonal, one 3 x 3 block a vehicle
    P <- P - P H^T (H P H^T + 1)^-1 H P         H: the rows of the windowed matrix, sigma = 1

Positions are in mean radii until the end. syncplan.estimation.covariances processes the rows.
The state is the poses at time 0 and the errors that a layout names.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.errors import NoSolutionError
from syncplan.estimation.covariances import RunVariances, variances_along
from syncplan.estimation.referred_run import GaussMarkov, Run
from syncplan.estimation.start_up_index import (
    StartUpIndex,
    first_samples,
    index_of_run,
    second_order_terms,
)
from syncplan.observability.referred_rows import SightingRows, error_moves, pose_columns, state_rows
from syncplan.orbits.circles import Orbits, perpendicular, phase, unit
from syncplan.orbits.contacts import Windows
from syncplan.orbits.error_states import ERROR_STATES, StateLayout
from syncplan.orbits.sightings import Remainder, Sightings, sample_sightings
from syncplan.orbits.team import Team

_SAMPLES_AT_ONCE = 128
"""Number of samples whose covariance blocks are kept until their quadratic forms are taken."""

SAME_SCALE = 1e-12
"""Relative difference up to which two mean radii count as equal."""

INDEFINITE = (
    "no posterior bound: the sigmas span too many orders of magnitude for its covariance to stay "
    "positive definite"
)


@dataclass(frozen=True, slots=True)
class PosteriorBound:
    """Posterior bound along a run from the initial sigmas.

    Attributes
    ----------
    position_variance : (steps + 1, n) m^2, trace of each vehicle's position block at k Ts
    heading_variance : (steps + 1, n) rad^2
    start_up : nonlinearity of its sightings; None if not requested
    errors : (steps + 1, f) variance of each further state of layout_of(team), in the square of its
        unit; None if the state consists of poses alone
    accuracy : estimated relative error of the RMS position bound, the largest of any vehicle; 0
        where the recursion is exact
    longest_lump : s, limit on the length of lumps; 0 where the recursion is exact
    """

    position_variance: Array
    heading_variance: Array
    start_up: StartUpIndex | None = None
    errors: Array | None = None
    accuracy: float = 0.0
    longest_lump: float = 0.0

    def until(self, samples: float) -> "PosteriorBound":
        """Return the bound along the first `samples`, rounded down, or all if there are fewer."""
        end = int(samples + 1e-9) + 1
        return replace(
            self,
            position_variance=self.position_variance[:end],
            heading_variance=self.heading_variance[:end],
            errors=None if self.errors is None else self.errors[:end],
        )

    def rms_second_half(self) -> Array:
        """Return (n,) RMS position bound in m over the samples k with 2 k > steps."""
        steps = len(self.position_variance) - 1
        return np.asarray(np.sqrt(self.position_variance[steps // 2 + 1 :].mean(axis=0)))

    def errors_second_half(self) -> Array:
        """Return (f,) RMS bound of each further state over the same samples, in its unit."""
        if self.errors is None:
            return np.zeros(0)
        steps = len(self.errors) - 1
        return np.asarray(np.sqrt(self.errors[steps // 2 + 1 :].mean(axis=0)))


def arc_noise_gain(orbits: Orbits, sample_time: float) -> Array:
    """Return (n, 3, 2) derivatives of a step's (x, y, heading) by speed and turn rate.

    They are in the frame of the heading at the step's start. With h half the angle turned in a
    step, the chord is v Ts sinc(h) e(h), differentiated here in closed form.
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


@dataclass(frozen=True, slots=True)
class ReferredSystem:
    """Run of a team with all errors referred to time 0.

    Attributes
    ----------
    run : noise and rows with the columns of the layout, positions in `scale` m
    moved : (2, n, steps + 1) displacement since time 0, in `scale` m
    scale : m, the mean radius
    team, sightings : sightings are in the order of the rows
    layout : of the state
    """

    run: Run
    moved: Array
    scale: float
    team: Team
    sightings: Sightings
    layout: StateLayout

    @classmethod
    def along(
        cls, team: Team, windows: Windows, steps: int, layout: StateLayout
    ) -> "ReferredSystem":
        """Return the run of a team over `steps` steps."""
        orbits, sample_time = team.orbits, team.sensors.sample_time
        sightings = sample_sightings(windows, orbits.period, team.sensors, 1, steps)
        scale = float(orbits.radii.mean())
        angle = phase(orbits, np.arange(steps + 1) * sample_time).T
        arm = np.stack([np.cos(angle), np.sin(angle)])
        moved = (orbits.radii / scale)[:, None] * (arm - arm[..., :1])
        run = Run(
            noise=_referred_noise(team, arm, moved, scale),
            rows=state_rows(team, sightings, layout, scale),
            first=sightings.first_of_steps(steps),
            size=layout.size,
            changing=_changing(team, layout, scale),
        )
        return cls(run, moved, scale, team, sightings, layout)

    def left_by(self, left: Remainder, layout: StateLayout) -> "ReferredSystem":
        """Return the run of the team that remains after a loss, with the given state layout."""
        team = left.team
        sightings, kept = left.sightings(self.sightings)
        mean = float(team.orbits.radii.mean())
        if layout.names or abs(mean - self.scale) > SAME_SCALE * mean:
            # weights of near passes depend on the mean radius
            rows = state_rows(team, sightings, layout, self.scale)
        else:
            rows = SightingRows(
                self.run.rows.entries[kept][:, :6], pose_columns(sightings, team.count)
            )
        run = Run(
            noise=self.run.noise[:, left.vehicles],
            rows=rows,
            first=sightings.first_of_steps(self.run.steps),
            size=layout.size,
            changing=_changing(team, layout, self.scale),
        )
        moved = self.moved[:, left.vehicles]
        return ReferredSystem(run, moved, self.scale, team, sightings, layout)

    @property
    def start(self) -> Array:
        """Initial covariance (size, size); errors are in units of their own sigmas."""
        noise = self.team.noise
        sigma = np.array([noise.position_sigma, noise.position_sigma, noise.heading_sigma])
        sigma[:2] /= self.scale
        covariance = np.eye(self.run.size)
        poses = np.arange(3 * self.run.count)
        covariance[poses, poses] = np.tile(sigma**2, self.run.count)
        return covariance

    def from_start(self, bound: Callable[[Array], PosteriorBound]) -> PosteriorBound:
        """Return the result of `bound` from the initial covariance.

        Raises NoSolutionError if the covariance does not stay positive definite.
        """
        try:
            found = bound(self.start)
        except np.linalg.LinAlgError:
            raise NoSolutionError(INDEFINITE) from None
        if np.any(found.position_variance < 0.0):
            raise NoSolutionError(INDEFINITE)
        return found

    def bound(self, covariance: Array) -> PosteriorBound:
        """Return the bound along the run.

        A vehicle's error is that of its pose at time 0, carried by the closed-form transition, plus
        its displacement by each constant error since. Gusts act through the pose; a bearing walk
        has no effect. So its variance is a quadratic form in the covariance of these few states.
        """
        return self._bound_of(variances_along(self.run, covariance, self._columns, self._moves))

    def position_covariances(self, covariance: Array) -> Array:
        """Return (steps + 1, n, 2, 2) m^2: the covariance of each vehicle's position along the run.

        The variances of x, y and x + y give it: xy = (v(x + y) - v(x) - v(y)) / 2.
        """

        def with_sum(steps: Index) -> Array:
            moves = self._moves(steps)
            moves[:, :, 2] = moves[:, :, 0] + moves[:, :, 1]
            return moves

        found = variances_along(self.run, covariance, self._columns, with_sum).moves
        xx, yy, of_sum = np.moveaxis(found, -1, 0)
        xy = 0.5 * (of_sum - xx - yy)
        return self.scale**2 * np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)

    def with_index(self, covariance: Array) -> PosteriorBound:
        """Return the bound along the run with its start-up index."""
        seen = self.sightings.until(first_samples(self.team))
        terms, sizes = second_order_terms(self.team, seen, self.scale)
        along, across = (self._with_errors(seen, six) for six in terms)
        given = self.run, covariance, self._columns, self._moves
        found = variances_along(*given, (along, across))
        index = index_of_run(self.team, seen, sizes, found.foreseen)
        return replace(self._bound_of(found), start_up=index)

    def _bound_of(self, found: RunVariances) -> PosteriorBound:
        return PosteriorBound(
            self.scale**2 * (found.moves[..., 0] + found.moves[..., 1]),
            found.moves[..., 2],
            errors=found.states * self.layout.sigmas**2 if self.layout.names else None,
        )

    def known(self, covariance: Array) -> tuple[Array, Array]:
        """Return a covariance's block (n, c, c) of each vehicle, and the variances of errors (f,).

        A block has the vehicle's pose and the constant errors that move it. Of a symmetric matrix,
        the lower triangle suffices.
        """
        columns = self._columns
        high = np.maximum(columns[:, :, None], columns[:, None, :])
        low = np.minimum(columns[:, :, None], columns[:, None, :])
        return covariance[high, low], np.diagonal(covariance)[3 * self.layout.count :].copy()

    def carried(self, known: Iterable[tuple[Array, Array]]) -> PosteriorBound:
        """Return the bound from blocks and variances as those of `known`, of all samples."""
        steps, count = self.run.steps, self.run.count
        place, heading = np.empty((2, steps + 1, count))
        errors = np.empty((steps + 1, self.layout.size - 3 * count))
        waiting: list[Array] = []
        for k, (block, variances) in enumerate(known):
            waiting.append(block)
            errors[k] = variances
            if len(waiting) < _SAMPLES_AT_ONCE and k < steps:
                continue
            own = slice(k + 1 - len(waiting), k + 1)
            moves = self._moves(np.arange(own.start, own.stop))
            spread = np.einsum("knvw,knaw->knva", np.stack(waiting), moves)
            moved = np.einsum("knav,knva->kna", moves, spread)
            place[own], heading[own] = moved[..., 0] + moved[..., 1], moved[..., 2]
            waiting.clear()
        return PosteriorBound(
            self.scale**2 * place,
            heading,
            errors=errors * self.layout.sigmas**2 if self.layout.names else None,
        )

    def moved_on(self) -> Array:
        """Return the (size, size) matrix that moves time 0 of the state to the end of the run.

        The run must last whole periods, so that vehicles end where they began.
        """
        matrix, columns = np.eye(self.layout.size), self._columns
        moves = self._moves(np.array([self.run.steps]))[0]
        for vehicle, (own, moved) in enumerate(zip(columns[:, 3:], moves[..., 3:], strict=True)):
            for column, effect in zip(own, moved.T, strict=True):
                matrix[3 * vehicle : 3 * vehicle + 3, column] += effect
        return matrix

    def _with_errors(self, seen: Sightings, six: Array) -> SightingRows:
        """Rows of functions (s, 6) of poses, extended by the columns of the errors."""
        if self.run.poses_alone:
            return SightingRows(six, self.run.rows.columns[: len(six)])
        return error_moves(self.team, seen, self.layout, six[:, :2].T / -self.scale, six)

    @property
    def _columns(self) -> Index:
        """Columns (n, 3 + e) of each vehicle's pose and of the constant errors that move it."""
        own = 3 * np.arange(self.layout.count)[:, None] + np.arange(3)
        others = [self.layout.columns[name] for name in _constant(self.layout)]
        # where a vehicle has no such error, any column will do
        return np.concatenate([own, *(np.where(one >= 0, one, 0) for one in others)], axis=1)

    def _moves(self, steps: Index) -> Array:
        """Effect (k, n, 3, 3 + e) of columns on each vehicle's position, in `scale` m, and heading.

        Columns are those of its pose at time 0, then those of each constant error.
        """
        team, count = self.team, self.run.count
        found = np.zeros((len(steps), count, 3, self._columns.shape[1]))
        found[..., :3] = np.eye(3)
        east, north = self.moved[..., steps]
        found[:, :, 0, 2], found[:, :, 1, 2] = -north.T, east.T
        times = np.repeat(steps * team.sensors.sample_time, count)
        vehicles = np.tile(np.arange(count), len(steps))
        place = 3
        for name in _constant(self.layout):
            columns = self.layout.columns[name]
            moves = ERROR_STATES[name].moves(team.orbits, vehicles, times)
            moves[:, :2] /= self.scale
            has = columns >= 0
            sigmas = np.where(has, self.layout.sigmas[np.where(has, columns - 3 * count, 0)], 0.0)
            axes = columns.shape[1]
            by_vehicle = np.moveaxis(moves.reshape(axes, 3, len(steps), count), (0, 1), (3, 2))
            found[..., place : place + axes] = by_vehicle * sigmas[:, None]
            place += axes
        return found


def _referred_noise(team: Team, arm: Array, moved: Array, scale: float) -> Array:
    """Motion noise (6, n, steps + 1) of the step that ends at k, referred to time 0, as in Run.

    `arm` and `moved` (2, n, steps + 1) are directions from the centres, and displacements.
    """
    from syncplan.estimation.covariance_kernels import refer

    orbits, noise = team.orbits, team.noise
    gain = arc_noise_gain(orbits, team.sensors.sample_time) * np.array(
        [noise.speed_sigma, noise.turn_rate_sigma]
    )
    gain[:, :2] /= scale
    found = np.zeros((6, *arm.shape[1:]))
    refer(np.ascontiguousarray(arm), np.ascontiguousarray(moved), gain, orbits.senses, found)
    return found


def _changing(team: Team, layout: StateLayout, scale: float) -> GaussMarkov | None:
    """Propagation of the changing errors of a layout; None if there are none."""
    columns = np.arange(layout.first_changing, layout.size)
    if not len(columns):
        return None
    drifting = [layout.columns[name] for name in layout.names if ERROR_STATES[name].drifts]
    places = 3 * np.arange(team.count)[:, None] + np.arange(2)
    time, own = team.sensors.sample_time, columns - 3 * team.count
    moving = np.concatenate([np.zeros((0, 2), dtype=np.int64), *drifting])
    return GaussMarkov(
        columns=columns,
        kept=np.exp(-time / layout.times[own]),
        places=np.concatenate([places[:0], *(places for _ in drifting)]).ravel(),
        drifting=moving.ravel(),
        push=time * layout.sigmas[moving.ravel() - 3 * team.count] / scale,
    )


def _constant(layout: StateLayout) -> list[str]:
    return [name for name in layout.names if ERROR_STATES[name].constant]


def _nonzero(value: Array) -> Array:
    return np.where(value == 0.0, 1.0, value)
