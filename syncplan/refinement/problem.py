"""Refinement problem as arrays: variables and their bounds, objective, constraints.

Circles are columns (x, y, R, phi). Scaled lengths are in the mean radius of the plan that is
refined (`scale`); it stays fixed while radii change, so that figures can be compared.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import least_circle_gaps
from syncplan.orbits.sighting_kinds import BEARING
from syncplan.orbits.sightings import samples_before
from syncplan.orbits.team import Sensors, Team, WithTeam
from syncplan.planning.judged_team import DistanceLimit
from syncplan.scenario.areas import Area
from syncplan.scenario.objectives import Objective
from syncplan.scenario.purposes import PurposeMeasure

WINDOW_BOUND = "window bound of the worst vehicle"
"""Label of the constraint on this bound."""


@dataclass(frozen=True, slots=True)
class Freedom:
    """Bounds of every vehicle's circle; equal bounds fix a value.

    Attributes
    ----------
    lower, upper : (4, n) of x, y, R in m and the phase in rad
    """

    lower: Array
    upper: Array

    @property
    def free(self) -> Flags:
        """Whether each value (4, n) may change."""
        return np.asarray(self.lower < self.upper)

    def distances(self, a: Index, b: Index) -> tuple[Array, Array]:
        """Return the least and largest distance (p,) in m that the centres of a and b can have."""
        return _lengths(
            self.lower[:2, b] - self.upper[:2, a], self.upper[:2, b] - self.lower[:2, a]
        )

    def reaches(self, vehicles: Index, places: Array) -> tuple[Array, Array]:
        """Return the least and largest distance (p,) in m of centres from (p, 2) places."""
        return _lengths(self.lower[:2, vehicles] - places.T, self.upper[:2, vehicles] - places.T)


@dataclass(frozen=True, slots=True)
class RefineProblem(WithTeam):
    """Refinement of a plan as a problem for the solver.

    Attributes
    ----------
    names : of the vehicles, then of the landmarks
    team : the plan's; senses and rate of its orbits are kept
    window, duration : s
    freedom : bounds of the variables
    objective : figure of merit to improve
    kept : (k, 2) contacts to be kept: pairs of vehicles a < b, then vehicles and landmarks
    kept_samples : (k,) fewest samples in contact
    kept_margins : (k,) m by which contact stays within range
    margins_required : whether the user gave the margins; if not, they are those of the plan
    min_separation : m, as given or as the plan has it
    separation_limit, landmark_limit : least distances of vehicles from each other and landmarks
    area : polygons that limit the circles
    purpose : measure of what the circles are flown for; None for nothing
    window_limit : m, largest window bound allowed of any vehicle; infinite for no limit
    """

    names: tuple[str, ...]
    team: Team
    window: float
    duration: float
    freedom: Freedom
    objective: Objective
    kept: Index
    kept_samples: Array
    kept_margins: Array
    margins_required: bool
    min_separation: float
    separation_limit: DistanceLimit
    landmark_limit: DistanceLimit
    area: Area
    purpose: PurposeMeasure | None
    window_limit: float

    @property
    def contact_span(self) -> float:
        """Time in s over which contact is counted: the window, but at least a period."""
        return max(self.window, self.orbits.period)

    @property
    def scale(self) -> float:
        """Mean radius in m of the plan that is refined."""
        return float(self.orbits.radii.mean())

    @property
    def information_unit(self) -> float:
        """A typical entry of the windowed information: the mean of 1/sigma^2 in 1/rad^2."""
        return float(np.mean(1.0 / BEARING.sigmas(self.sensors) ** 2))

    def guarded_pairs(self) -> Index:
        """Return the (g, 2) pairs of vehicles a < b that could come nearer than the separation."""
        if self.guarded_separation <= 0.0:
            return np.zeros((0, 2), dtype=np.int64)
        a, b = np.triu_indices(self.orbits.count, 1)
        distances = self.freedom.distances(a, b)
        radii = self.freedom.lower[2], self.freedom.upper[2]
        pairs = np.column_stack([a, b])
        return pairs[least_circle_gaps(distances, radii, pairs) < self.guarded_separation]

    @property
    def guarded_separation(self) -> float:
        """Least distance in m of two vehicles, whatever radii the bounds allow."""
        return max(self.min_separation, self.separation_limit.least(self.freedom.upper[2]))

    @property
    def guarded_clearance(self) -> float:
        """Least distance in m from a landmark, whatever radii the bounds allow."""
        return self.landmark_limit.least(self.freedom.upper[2])

    def guarded_landmarks(self) -> Index:
        """Return the (g, 2) vehicles and landmarks that could come nearer than the clearance."""
        if self.guarded_clearance <= 0.0:
            return np.zeros((0, 2), dtype=np.int64)
        vehicles, landmarks = (
            axis.ravel() for axis in np.indices((self.orbits.count, len(self.landmarks)))
        )
        nearest, furthest = self.freedom.reaches(vehicles, self.landmarks[landmarks])
        gaps = np.maximum(
            nearest - self.freedom.upper[2, vehicles], self.freedom.lower[2, vehicles] - furthest
        )
        pairs = np.column_stack([vehicles, landmarks])
        return np.asarray(pairs[gaps < self.guarded_clearance])


def _lengths(low: Array, high: Array) -> tuple[Array, Array]:
    """Least and largest length (p,) of vectors within (2, p) bounds."""
    nearest = np.maximum(np.maximum(low, -high), 0.0)
    furthest = np.maximum(np.abs(low), np.abs(high))
    return np.hypot(*nearest), np.hypot(*furthest)


def circles_of(orbits: Orbits) -> Array:
    """Return circles (4, n): x, y and R in m, and the phase in rad."""
    return np.concatenate([orbits.centers.T, orbits.radii[None], orbits.phases[None]])


def orbits_of(circles: Array, like: Orbits) -> Orbits:
    """Return the orbits of (4, n) circles in m and rad, senses and rate as in `like`."""
    return Orbits(
        centers=np.ascontiguousarray(circles[:2].T),
        radii=circles[2].copy(),
        senses=like.senses,
        phases=circles[3] % (2.0 * np.pi),
        rate=like.rate,
    )


# --- samples --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class SampleTimes:
    """Samples of a window, or groups of neighbours where there are many.

    Attributes
    ----------
    angles : (k,) rad turned since time 0
    counts : (k,) samples in each group
    ready : (k, n) number of them at which each vehicle's sensor sights targets; None for all
    """

    angles: Array
    counts: Array
    ready: Array | None = None

    @property
    def spacing(self) -> float:
        """Typical angle in rad between neighbours."""
        return float(2.0 * np.pi / max(len(self.angles), 1))

    def sighted(self, observers: Index) -> Array:
        """Return the numbers (k, e) of samples per group at which observers (e,) sight targets."""
        if self.ready is None:
            return np.repeat(self.counts[:, None], len(observers), axis=1)
        return np.asarray(self.ready[:, observers])


def samples_of(window: float, sensors: Sensors, rate: float, most: int) -> SampleTimes:
    """Return the samples k Ts in [0, window) s as at most `most` angles turned at `rate` rad/s."""
    number = samples_before(window, sensors.sample_time)
    passed = np.arange(number) * (rate * sensors.sample_time)
    turned = np.asarray(passed % (2.0 * np.pi), dtype=float)
    order = np.argsort(turned)
    turned = turned[order]
    ready = None
    if np.any(sensors.every > 1):
        ready = np.where(order[:, None] % sensors.every == 0, 1.0, 0.0)
    if number <= most:
        return SampleTimes(turned, np.ones(number), ready)
    group = np.minimum((turned / (2.0 * np.pi) * most).astype(int), most - 1)
    counts = np.bincount(group, minlength=most).astype(float)
    angles = np.bincount(group, weights=turned, minlength=most)
    held = counts > 0.0
    if ready is not None:
        ready = np.stack([np.bincount(group, one, minlength=most) for one in ready.T], axis=1)
        ready = ready[held]
    return SampleTimes(angles[held] / counts[held], counts[held], ready)


# --- stages ---------------------------------------------------------------------------------------


_LEAST_WIDTH, _LARGEST_WIDTH = 0.002, 0.05
_STEP_OF_SPACING = 0.25
_FEW, _MANY = 64, 400


@dataclass(frozen=True, slots=True)
class Stage:
    """Resolution of the problem and solver settings in one stage.

    Attributes
    ----------
    samples : most samples or groups of them in a window
    width : width of the step between seen and unseen, as a share of the range
    barrier : weight of the logarithmic barrier, for objectives that have one
    iterations : largest number that IPOPT may take
    tolerance : IPOPT's, for convergence
    last : whether contacts keep a safety distance from their limits
    """

    samples: int
    width: float
    barrier: float
    iterations: int
    tolerance: float
    last: bool


def stages_of(problem: RefineProblem) -> tuple[Stage, ...]:
    """Return a soft, a sharper and a nearly hard stage; the last resolves neighbouring samples."""
    most = int(np.clip(12_000 // max(problem.orbits.count, 1), 2 * _FEW, _MANY))
    last = max(_LEAST_WIDTH, step_width(problem, samples_in(problem, problem.window, most)))
    return (
        Stage(_FEW, 0.1, 0.3, 60, 1e-3, False),
        Stage(_FEW, max(0.04, last), 0.05, 60, 1e-3, False),
        Stage(most, last, 0.01, 150, 1e-4, True),
    )


def samples_in(problem: RefineProblem, span: float, most: int) -> SampleTimes:
    """Return the samples in `span` s, in at most `most` groups."""
    return samples_of(span, problem.sensors, problem.orbits.rate, most)


def step_width(problem: RefineProblem, times: SampleTimes) -> float:
    """Return the step's width over the range: a quarter of the motion per sample, at most 5 %."""
    passed = 2.0 * problem.orbits.radii.max() * times.spacing
    return float(min(_STEP_OF_SPACING * passed / problem.sensors.ranges.max(), _LARGEST_WIDTH))
