"""A team's run with all errors referred to time 0, and the posterior bound that it gives.

Errors are referred to time 0 by the closed-form transition, so that prediction only adds noise:

    P <- P + Phi(0, k) G Q G^T Phi(0, k)^T      block diagonal, one 3 x 3 block a vehicle
    P <- P - P H^T (H P H^T + 1)^-1 H P         H: the rows of the windowed matrix, sigma = 1

Positions are in mean radii until the end. syncplan.estimation.covariances brings the rows in.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import NoSolutionError
from syncplan.estimation.covariances import foreseen_along, variances_along
from syncplan.estimation.referred_run import Run
from syncplan.estimation.start_up_index import (
    StartUpIndex,
    first_samples,
    index_of_run,
    second_order_terms,
)
from syncplan.observability.referred_rows import sighting_rows
from syncplan.orbits.circles import Orbits, perpendicular, phase, unit
from syncplan.orbits.contacts import Windows
from syncplan.orbits.sightings import Sightings, sample_sightings
from syncplan.orbits.team import Team

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
    start_up : how far from linear its sightings are; None where not asked for
    errors : (steps + 1, f) variance of each further state of layout_of(team), in the square of its
        unit; None where poses are all
    """

    position_variance: Array
    heading_variance: Array
    start_up: StartUpIndex | None = None
    errors: Array | None = None

    def until(self, samples: float) -> "PosteriorBound":
        """Return the bound along the first whole `samples`, or all there are."""
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

    In the frame of the heading at the step's start. With h half the angle turned in a step, the
    chord is v Ts sinc(h) e(h), here differentiated in closed form.
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
    """A run with all errors referred to time 0: noise added per step, whitened rows.

    Attributes
    ----------
    run : noise and rows, positions in `scale` m
    moved : (2, n, steps + 1) displacement since time 0, in `scale` m
    scale : m, the mean radius
    team, sightings : in the order of the rows
    """

    run: Run
    moved: Array
    scale: float
    team: Team
    sightings: Sightings

    @classmethod
    def along(
        cls,
        team: Team,
        windows: Windows,
        steps: int,
    ) -> "ReferredSystem":
        """Return the run of a team over so many steps."""
        orbits, sample_time = team.orbits, team.sensors.sample_time
        sightings = sample_sightings(windows, orbits.period, team.sensors, 1, steps)
        targets = sightings.targets
        scale = float(orbits.radii.mean())
        angle = phase(orbits, np.arange(steps + 1) * sample_time).T
        arm = np.stack([np.cos(angle), np.sin(angle)])
        moved = (orbits.radii / scale)[:, None] * (arm - arm[..., :1])
        run = Run(
            noise=_referred_noise(team, arm, moved, scale),
            rows=sighting_rows(team, sightings),
            observers=sightings.observers,
            targets=np.where(targets < orbits.count, targets, 0),
            first=sightings.first_of_steps(steps),
        )
        return cls(run, moved, scale, team, sightings)

    @property
    def start(self) -> Array:
        """(3 n, 3 n) covariance of the initial sigmas."""
        noise = self.team.noise
        sigma = np.array([noise.position_sigma, noise.position_sigma, noise.heading_sigma])
        sigma[:2] /= self.scale
        return np.diag(np.tile(sigma**2, self.run.count))

    def from_start(self, bound: Callable[[Array], PosteriorBound]) -> PosteriorBound:
        """Return what `bound` makes of the covariance of the start.

        Raises NoSolutionError where the covariance does not stay positive definite.
        """
        try:
            found = bound(self.start)
        except np.linalg.LinAlgError:
            raise NoSolutionError(_INDEFINITE) from None
        if np.any(found.position_variance < 0.0):
            raise NoSolutionError(_INDEFINITE)
        return found

    def bound(self, covariance: Array) -> PosteriorBound:
        """Return the bound along the run."""
        return self.carried(variances_along(self.run, covariance))

    def with_index(self, covariance: Array) -> PosteriorBound:
        """Return the bound along the run with its start-up index."""
        seen = self.sightings.until(first_samples(self.team))
        terms = second_order_terms(self.team, seen, self.scale)
        variances, foreseen = foreseen_along(self.run, covariance, terms.functions, terms.weights)
        index = index_of_run(self.team, seen, foreseen)
        return replace(self.carried(variances), start_up=index)

    def carried(self, variances: Array) -> PosteriorBound:
        """Return the bound that variances of errors referred to time 0, (4, n, steps + 1), mean."""
        position_, x_turn, y_turn, turn = variances
        east, north = self.moved
        spread = position_ + 2.0 * (east * y_turn - north * x_turn) + (east**2 + north**2) * turn
        return PosteriorBound(self.scale**2 * spread.T, turn.T)


def _referred_noise(team: Team, arm: Array, moved: Array, scale: float) -> Array:
    """(6, n, steps + 1) motion noise of the step that ends at k, referred to time 0, as in Run.

    `arm` and `moved`, (2, n, steps + 1), are directions from the centres and displacements.
    """
    orbits, noise = team.orbits, team.noise
    gain = arc_noise_gain(orbits, team.sensors.sample_time) * np.array(
        [noise.speed_sigma, noise.turn_rate_sigma]
    )
    gain[:, :2] /= scale
    # the heading where a step starts, a quarter turn from the arm
    sense = orbits.senses[:, None]
    ahead = -sense * np.roll(arm[1], 1, axis=-1)
    left = sense * np.roll(arm[0], 1, axis=-1)
    total = np.zeros((6, *ahead.shape))
    for along, across, turn in np.moveaxis(gain, (2, 1), (0, 1))[..., None]:
        # the turn moves the place at time 0 backwards about the vehicle
        x = ahead * along - left * across + moved[1] * turn
        y = left * along + ahead * across - moved[0] * turn
        for place, product in enumerate((x * x, x * y, x * turn, y * y, y * turn, turn * turn)):
            total[place] += product
    total[..., 0] = 0.0
    return total


def _nonzero(value: Array) -> Array:
    return np.where(value == 0.0, 1.0, value)
