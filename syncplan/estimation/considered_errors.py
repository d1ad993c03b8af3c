"""Expected errors of a filter whose model differs from the world, along the circles.

The model may leave out errors that exist, or assume other noise, errors and sensors than the true
ones. The filter's gain K comes from its own recursion, which ignores the difference. The covariance
C of the true errors, with rows H for the whole true state, follows from any gain (Joseph):

    C <- (1 - K H) C (1 - K H)^T + K K^T

This is Schmidt's consider analysis with the filter's gains. Where rows are noisier than the filter
assumes, K K^T becomes K R K^T with their variances R. An error that changes otherwise than the
filter assumes, such as gusts of another strength or memory, is in the state twice: with its true
value and with the value that the filter estimates.

Both recursions are linear: they hold while errors stay small beside the distances to the bodies
sighted. Where a filter's errors reach a large part of these, its tangents are taken elsewhere and
its gate rejects sightings; the true error can then be larger or smaller, and only trials show it.

A share p of false bearings, anywhere within the half view b, contributes the mean square of the
false bearing, b^2 / 3, and that of the true one, as much: 2 p b^2 / 3; all round, where angles are
wrapped, p pi^2 / 3.

Sources
-------
errors that are considered : Schmidt, "Application of state-space methods to navigation problems",
    Advances in Control Systems 3, 1966; Bierman, "Factorization Methods for Discrete Sequential
    Estimation", 1977, VIII.2 and IX (errors of a filter with the wrong model)
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.referred_run import GaussMarkov, Run
from syncplan.estimation.referred_system import PosteriorBound, ReferredSystem
from syncplan.orbits.contacts import Windows
from syncplan.orbits.error_states import ERROR_STATES, StateLayout, layout_of
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS, sigmas_by_kind
from syncplan.orbits.sightings import Sightings, steps_within
from syncplan.orbits.team import Team

_SEEN = ("ranges", "fields_of_view", "boresights", "every", "compass_every", "detection")
"""Attributes of sensors that decide what is sighted; the filter's are those of the world."""


@dataclass(frozen=True, slots=True)
class TrueRun:
    """The truth along a filter's run.

    Attributes
    ----------
    run : true noise, rows and errors; rows are divided by the sigmas that the filter assumes
    variances : (s,) variance of each row's noise
    held : (size of the filter's state,) place of each of its states in the true covariance
    followed : states of the filter whose estimates are appended to the states of `run`
    estimates : prediction of these estimates; None where there are none
    """

    run: Run
    variances: Array
    held: Index
    followed: Index
    estimates: GaussMarkov | None

    @property
    def size(self) -> int:
        """Size of the true covariance."""
        return self.run.size + len(self.followed)

    def predict(self, covariance: Array, noise: Array) -> None:
        """Carry the true covariance to the next sample with its noise, in place."""
        self.run.predict(covariance, noise)
        if self.estimates is not None:
            self.estimates.predict(covariance)

    def rows(self, true: Array, own: Array) -> Array:
        """Return rows (m, size) of the true errors, from the true run's and the filter's."""
        return np.hstack([true, -own[:, self.followed]]) if len(self.followed) else true

    def gains(self, own: Array) -> Array:
        """Return gains (m, size) for the true errors from the filter's own (m, its size).

        Appended estimates grow by their gains, so these have the opposite sign.
        """
        gains = np.zeros((len(own), self.size))
        gains[:, self.held] = own
        gains[:, self.run.size :] *= -1.0
        return gains


def neglected_errors(team: Team) -> tuple[str, ...]:
    """Return the names of the errors that a team has and its filter does not estimate."""
    named, estimated = layout_of(team, tuple(ERROR_STATES)).names, layout_of(team).names
    return tuple(name for name in named if name not in estimated)


def expected_errors(
    team: Team, windows: Windows, duration: float, *, true: Team | None = None
) -> PosteriorBound:
    """Return the mean square errors over `duration` s of a team's filter in the true world.

    `true` is the team of that world, the same if None, and `windows` are its contacts. The result
    is not a bound, but the error expected of that filter; where the filter neglects nothing and its
    model is true, both are the same. The further states of the result follow
    layout_of(true, ERROR_STATES). Raises NoSolutionError as posterior_bound does.
    """
    world = team if true is None else true
    seen = {name: getattr(world.sensors, name) for name in _SEEN}
    filtered = replace(team, sensors=replace(team.sensors, **seen))
    steps = steps_within(duration, team.sensors.sample_time)
    own = ReferredSystem.along(filtered, windows, steps, layout_of(filtered))
    there = replace(filtered, noise=world.noise, errors=world.errors)
    layout = layout_of(world, tuple(ERROR_STATES), filtered=filtered)
    whole = ReferredSystem.along(there, windows, steps, layout)
    truth = _true_run(own, whole, _variances(own.sightings, filtered, world))
    start = np.zeros((truth.size, truth.size))
    size = layout.size
    start[:size, :size] = whole.start
    place = np.arange(3 * team.count, size)
    start[place, place] = _shares(world, layout) ** 2

    def carried(covariance: Array) -> PosteriorBound:
        along = _considered_along(own.run, truth, (covariance, start))
        return whole.carried(whole.known(one[:size, :size]) for one in along)

    return own.from_start(carried)


def _true_run(own: ReferredSystem, whole: ReferredSystem, variances: Array) -> TrueRun:
    """Return the true run; it follows the filter's changing errors if any is modelled wrongly."""
    changing, layout = own.run.changing, own.layout
    alike = all(_changes_alike(layout, whole.layout, name) for name in layout.names)
    held, followed = np.arange(layout.size), np.arange(layout.first_changing, layout.size)
    for name in layout.names:
        if alike or ERROR_STATES[name].constant:
            has = layout.columns[name] >= 0
            held[layout.columns[name][has]] = whole.layout.columns[name][has]
    if alike or changing is None:
        return TrueRun(whole.run, variances, held, followed[:0], None)
    held[followed] = whole.layout.size + np.arange(len(followed))
    estimates = replace(
        changing,
        columns=held[changing.columns],
        drifting=held[changing.drifting],
        push=-changing.push,
        driven=False,
    )
    return TrueRun(whole.run, variances, held, followed, estimates)


def _changes_alike(own: StateLayout, whole: StateLayout, name: str) -> bool:
    """Return whether an error of the filter is constant, or changes in truth as it assumes."""
    if ERROR_STATES[name].constant:
        return True
    return name in whole.names and np.array_equal(_course(own, name), _course(whole, name))


def _course(layout: StateLayout, name: str) -> Array:
    """(2, n, axes) sigma and correlation time of an error; 0 where a vehicle has none."""
    place = layout.columns[name] - 3 * layout.count
    return np.where(place >= 0, np.stack([layout.sigmas, layout.times])[:, place], 0.0)


def _variances(sightings: Sightings, filtered: Team, world: Team) -> Array:
    """(s,) noise variance of each sighting, over the variance that the filter assumes."""
    kinds, observers = sightings.kinds, sightings.observers
    taken = sigmas_by_kind(filtered.sensors, kinds, observers)
    variances = (sigmas_by_kind(world.sensors, kinds, observers) / taken) ** 2
    shares = world.sensors.false_bearings[observers]
    shares[kinds != list(SIGHTING_KINDS).index("bearing")] = 0.0
    half = np.minimum(0.5 * world.sensors.fields_of_view[observers], np.pi)
    thrown = np.where(half < np.pi, 2.0, 1.0) * half**2 / 3.0
    return np.asarray(variances + shares * (thrown / taken**2 - variances))


def _shares(world: Team, layout: StateLayout) -> Array:
    """(f,) true sigma of each further state, over the layout's."""
    sigmas = np.zeros(len(layout.sigmas))
    for name in layout.names:
        columns = layout.columns[name] - 3 * layout.count
        has = columns >= 0
        true = np.broadcast_to(ERROR_STATES[name].sigma(world)[:, None], columns.shape)
        sigmas[columns[has]] = true[has]
    return sigmas / layout.sigmas


def _considered_along(
    own: Run, truth: TrueRun, covariances: tuple[Array, Array]
) -> Iterator[Array]:
    """Yield the true covariance after each sample of a filter whose run is `own`.

    `covariances` are the filter's and the true one at time 0. The yielded array changes in place
    with the next sample. Raises LinAlgError where the covariance of an innovation is not positive
    definite.
    """
    trusted, true = (one.copy() for one in covariances)
    both = zip(own.samples(), truth.run.samples(), strict=True)
    for k, ((sighted, rows, noise), (_, true_rows, true_noise)) in enumerate(both):
        if k:
            own.predict(trusted, noise)
            truth.predict(true, true_noise)
        if len(rows):
            factor, gain = _factored(rows, trusted)
            half = _solved(factor, gain)
            trusted -= half.T @ half
            gains = truth.gains(_solved(factor, half, transposed=True))
            _take_in(true, truth.rows(true_rows, rows), gains, truth.variances[sighted])
        yield true


def _factored(rows: Array, covariance: Array) -> tuple[Array, Array]:
    """The Cholesky factor (m, m) of the innovation of m rows, and H P (m, size)."""
    gain = rows @ covariance
    innovation = gain @ rows.T
    innovation.reshape(-1)[:: len(rows) + 1] += 1.0
    return np.asarray(np.linalg.cholesky(innovation), dtype=float), gain


def _solved(factor: Array, sides: Array, *, transposed: bool = False) -> Array:
    """L^-1 `sides`, or L^-T `sides`, for the lower factor L (m, m) of an innovation."""
    from scipy.linalg.blas import dtrsm

    # BLAS is column-major, so it takes the transposes as they lie in memory
    found = dtrsm(1.0, factor.T, sides.T, side=1, trans_a=transposed)
    return np.asarray(found, dtype=float).T


def _take_in(covariance: Array, rows: Array, gains: Array, variances: Array) -> None:
    """Update C <- (1 - K H) C (1 - K H)^T + K R K^T in place; `gains` is K^T (m, size)."""
    seen = rows @ covariance
    innovation = seen @ rows.T
    innovation.reshape(-1)[:: len(rows) + 1] += variances
    taken = gains.T @ (seen - 0.5 * innovation @ gains)
    covariance -= taken
    covariance -= taken.T
