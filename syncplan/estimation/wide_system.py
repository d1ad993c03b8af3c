"""A team's run whose state has errors beside the poses, and the posterior bound that it gives.

A vehicle at time t is off by its pose at time 0, carried by the closed-form transition, and by what
each constant error has moved it since; gusts act through the pose, and a bearing walk not at all.
So what is known of its place is a quadratic form of the covariance of these few states.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.foreseen_sightings import Foreseen
from syncplan.estimation.referred_system import PosteriorBound, ReferredSystem
from syncplan.estimation.start_up_index import first_samples, index_of_run, second_order_terms
from syncplan.estimation.wide_covariances import GaussMarkov, Sample, WideRun, carried_along
from syncplan.observability.referred_rows import dense_rows, error_moves, wide_rows
from syncplan.orbits.contacts import Windows
from syncplan.orbits.error_states import ERROR_STATES, StateLayout
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team

_SAMPLES_AT_ONCE = 128
"""Samples whose blocks of the covariance are kept until their quadratic forms are taken."""


@dataclass(frozen=True, slots=True)
class WideSystem:
    """A run with all errors referred to time 0.

    Attributes
    ----------
    poses : the run without further states
    layout : of the state
    run : noise and rows with the columns of the layout
    """

    poses: ReferredSystem
    layout: StateLayout
    run: WideRun

    @classmethod
    def along(cls, team: Team, windows: Windows, steps: int, layout: StateLayout) -> "WideSystem":
        """Return the run of a team over so many steps."""
        return cls.widened(ReferredSystem.along(team, windows, steps), layout)

    @classmethod
    def widened(cls, poses: ReferredSystem, layout: StateLayout) -> "WideSystem":
        """Return a run with the errors of a layout as further states."""
        run = WideRun(
            noise=poses.run.noise,
            rows=wide_rows(poses.team, poses.sightings, layout, poses.scale),
            first=poses.run.first,
            size=layout.size,
            changing=_changing(poses.team, layout, poses.scale),
        )
        return cls(poses, layout, run)

    def from_start(self, bound: Callable[[Array], PosteriorBound]) -> PosteriorBound:
        """Return what `bound` makes of the covariance of the start; raises NoSolutionError."""
        return self.poses.from_start(lambda poses: bound(self.with_errors(poses)))

    def with_errors(self, poses: Array) -> Array:
        """Return the covariance of poses with errors of which only the sigmas are known."""
        covariance = np.eye(self.layout.size)
        covariance[: len(poses), : len(poses)] = poses
        return covariance

    def bound(self, covariance: Array) -> PosteriorBound:
        """Return the bound along the run."""
        return self.carried(one.covariance for one in carried_along(self.run, covariance))

    def with_index(self, covariance: Array) -> PosteriorBound:
        """Return the bound along the run with its start-up index."""
        last = first_samples(self.poses.team)
        seen = self.poses.sightings.until(last)
        functions = self._second_order(seen)
        foreseen = Foreseen(np.zeros((2, 2, len(seen.steps))), np.ones(len(seen.steps)))

        def covariances() -> Iterator[Array]:
            for sample in carried_along(self.run, covariance, keep_until=last):
                if sample.before is not None:
                    _foresee(sample, functions[:, sample.rows], foreseen)
                yield sample.covariance

        bound = self.carried(covariances())
        return replace(bound, start_up=index_of_run(self.poses.team, seen, foreseen))

    def carried(self, covariances: Iterable[Array]) -> PosteriorBound:
        """Return the bound that the covariances (size, size) of each sample mean."""
        steps, count = self.run.steps, self.run.count
        columns = _columns(self.layout)
        place, heading = np.empty((2, steps + 1, count))
        errors = np.empty((steps + 1, self.layout.size - 3 * count))
        blocks = np.empty((_SAMPLES_AT_ONCE, count, columns.shape[1], columns.shape[1]))
        lines, across = columns[:, :, None], columns[:, None, :]
        for k, covariance in enumerate(covariances):
            blocks[k % _SAMPLES_AT_ONCE] = covariance[lines, across]
            errors[k] = np.diagonal(covariance)[3 * count :]
            if (k + 1) % _SAMPLES_AT_ONCE and k < steps:
                continue
            known = slice(k - k % _SAMPLES_AT_ONCE, k + 1)
            moves = self._moves(np.arange(known.start, known.stop))
            spread = np.einsum("knvw,knaw->knva", blocks[: len(moves)], moves)
            variances = np.einsum("knav,knva->kna", moves, spread)
            place[known] = variances[..., 0] + variances[..., 1]
            heading[known] = variances[..., 2]
        scale = self.poses.scale
        return PosteriorBound(scale**2 * place, heading, errors=errors * self.layout.sigmas**2)

    def moved_on(self) -> Array:
        """Return the (size, size) change of the state when time 0 is moved to the end of the run.

        The end has to be whole periods later: vehicles are where they were.
        """
        matrix, columns = np.eye(self.layout.size), _columns(self.layout)
        moves = self._moves(np.array([self.run.steps]))[0]
        for vehicle, (own, moved) in enumerate(zip(columns[:, 3:], moves[..., 3:], strict=True)):
            for column, effect in zip(own, moved.T, strict=True):
                matrix[3 * vehicle : 3 * vehicle + 3, column] += effect
        return matrix

    def _second_order(self, seen: Sightings) -> Array:
        """(2, s, size) the functions whose product is each sighting's second-order term."""
        team, scale = self.poses.team, self.poses.scale
        found = []
        for six in second_order_terms(team, seen, scale).functions:
            ways = six[:, :2].T / -scale
            found.append(dense_rows(error_moves(team, seen, self.layout, ways, six), self.run.size))
        return np.stack(found)

    def _moves(self, steps: Index) -> Array:
        """(k, n, 3, 3 + e) how much the columns move each vehicle's place, in `scale`, and heading.

        Those of its pose at time 0, then those of each constant error.
        """
        team, count = self.poses.team, self.run.count
        found = np.zeros((len(steps), count, 3, _columns(self.layout).shape[1]))
        found[..., :3] = np.eye(3)
        east, north = self.poses.moved[..., steps]
        found[:, :, 0, 2], found[:, :, 1, 2] = -north.T, east.T
        times = np.repeat(steps * team.sensors.sample_time, count)
        vehicles = np.tile(np.arange(count), len(steps))
        place = 3
        for name in _constant(self.layout):
            columns = self.layout.columns[name]
            moves = ERROR_STATES[name].moves(team.orbits, vehicles, times)
            moves[:, :2] /= self.poses.scale
            has = columns >= 0
            sigmas = np.where(has, self.layout.sigmas[np.where(has, columns - 3 * count, 0)], 0.0)
            axes = columns.shape[1]
            by_vehicle = np.moveaxis(moves.reshape(axes, 3, len(steps), count), (0, 1), (3, 2))
            found[..., place : place + axes] = by_vehicle * sigmas[:, None]
            place += axes
        return found


def _changing(team: Team, layout: StateLayout, scale: float) -> GaussMarkov | None:
    """How the errors of a layout that change are carried."""
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


def _columns(layout: StateLayout) -> Index:
    """(n, 3 + e) columns of each vehicle's pose and of the constant errors that move it."""
    own = 3 * np.arange(layout.count)[:, None] + np.arange(3)
    others = [layout.columns[name] for name in _constant(layout)]
    # where a vehicle has no such error, any column will do
    return np.concatenate([own, *(np.where(one >= 0, one, 0) for one in others)], axis=1)


def _foresee(sample: Sample, functions: Array, foreseen: Foreseen) -> None:
    """Fill in what is known before each row of a sample of its functions (2, m, size)."""
    assert sample.before is not None
    size = functions.shape[1]
    earlier = np.tril(np.ones((size, size)), -1)
    told = (functions @ sample.halves.T) * earlier
    known = functions @ sample.before
    foreseen.pairs[..., sample.rows] = np.einsum("amc,bmc->abm", known, functions) - np.einsum(
        "amj,bmj->abm", told, told
    )
    foreseen.innovation[sample.rows] = sample.innovation
