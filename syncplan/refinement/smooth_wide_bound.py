"""The posterior bound's RMS with errors as states beside the poses, smooth in the circles.

The coarse steps are those of syncplan.refinement.smooth_bound. There all is referred to time 0,
where sightings and noise of poses repeat every turn; the moves of constant errors grow with the
time. So the state here is that of the moment, and its passages from step to step repeat every turn
(syncplan.refinement.smooth_passages). Sightings tell of poses alone: a bearing of the target's
place less the observer's, and of its heading less its bearing bias and walk. With these `observed`
(r, m) and what they tell K (r, r), a step goes

    P <- P + motion noise
    S = P - (O P)^T (1 + K O P O^T)^-1 K O P       variances are taken here
    P <- F S F^T + noise of gusts and bearing walks

Its slopes are written out, from the last step to the first: with weights B of S,

    U = O S B,  V = U S O^T,  Q = K U - K V K O / 2
    weights of K   -V,    weights of P   B - O^T Q - Q^T O

Automatic differentiation of the same recursion takes about three times as long.
"""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from syncplan.arrays import Index
from syncplan.orbits.error_states import ERROR_STATES, StateLayout, layout_of
from syncplan.refinement.problem import RefineProblem
from syncplan.refinement.smooth_bound import CoarseRun, turn_of_vehicles
from syncplan.refinement.smooth_passages import Passage
from syncplan.refinement.smooth_team import SmoothTeam

_LINEAR_SOLVER = "lapackqr"

_AT_ONCE = {"base": -1}
"""Unrolls a recursion in one go: levels within levels only pay where CasADi differentiates them."""


@dataclass(frozen=True, slots=True)
class WideRms:
    """The RMS position bounds of n vehicles, and their slopes.

    Attributes
    ----------
    value : (n,) over the second half, scaled
    slopes : of weights (n,), the gradient (4, n) of the weighted sum of `value` by the circles
    """

    value: ca.MX
    slopes: Callable[[ca.MX], ca.MX]


def smooth_wide_rms(
    problem: RefineProblem, run: CoarseRun, seen: SmoothTeam, circles: ca.MX, width: float
) -> WideRms:
    """Return the RMS position bounds of circles (4, n), scaled.

    The states are those that the team's filter estimates, but for clock offsets, which would make
    each observer see its targets elsewhere: exact verdicts have them. `seen` is the team at the
    run's times.
    """
    estimated = problem.team.errors.estimated
    layout = layout_of(problem.team, [name for name in estimated if not ERROR_STATES[name].delays])
    span = 2.0 * np.pi / (len(run.times.angles) * problem.orbits.rate)
    onward, begun = (Passage.of(problem, layout, share * span) for share in (1.0, 0.5))
    at = ca.MX.sym("X", 4, problem.orbits.count)
    noise, arms = turn_of_vehicles(problem, run.times, at, now=True)
    following = arms[:, [*range(1, len(run.times.angles)), 0]]
    first = ca.vec(ca.vertcat(*(at[2, :] * turn(at[3, :]) for turn in (ca.cos, ca.sin))))
    made = ca.Function(
        "made",
        [at],
        [
            begun.carried(_start(problem, layout), begun.moved(arms[:, 0], first)),
            seen.information_now(at, width),
            noise,
            onward.moved(following, arms),
        ],
    )
    start, *turn = made(circles)
    step = _Step.of(problem, layout, run, seen.sparsity, onward)
    value, after = _forward(step, run.turn_of_step, start, turn)

    def slopes(weights: ca.MX) -> ca.MX:
        number = len(run.turn_of_step)
        late = 0.5 * weights / (value * (number - number // 2))
        found = _backward(step, run.turn_of_step, turn, after, late)
        return made.reverse(1)(circles, start, *turn, *found)

    return WideRms(value, slopes)


def _forward(step: "_Step", chosen: Index, start: ca.MX, turn: list[ca.MX]) -> tuple[ca.MX, ca.MX]:
    """The RMS (n,) over the second half, and the covariances (m, m k) after each step's sightings.

    `turn` are information, noise and what varies in F at the samples of a turn, a column each.
    """
    number = len(chosen)
    _, variances, after = step.forward().mapaccum("run", number, _AT_ONCE)(
        start, *(one[:, chosen.tolist()] for one in turn)
    )
    late = variances[:, number // 2 :]
    return ca.sqrt(ca.sum2(late) / late.size2()), after


def _backward(
    step: "_Step", chosen: Index, turn: list[ca.MX], after: ca.MX, late: ca.MX
) -> list[ca.MX]:
    """Slopes by the covariance at the start and by `turn`.

    `late` (n,) are those by each vehicle's variance, at every step of the second half.
    """
    number, size = len(chosen), step.size
    back = np.arange(number)[::-1]
    counted = ca.DM(np.where(back >= number // 2, 1.0, 0.0)).T
    columns = (size * back[:, None] + np.arange(size)).ravel()
    by_start, *by_step = step.backward().mapaccum("back", number, _AT_ONCE)(
        ca.MX.zeros(size, size),
        after[:, columns.tolist()],
        *(one[:, chosen[back].tolist()] for one in turn),
        late @ counted,
    )
    # steps at the same sample of the turn add up
    place = ca.DM.triplet(
        list(range(number)), chosen[back].tolist(), ca.DM.ones(number), number, turn[0].size2()
    )
    return [by_start[:, -size:], *(one @ place for one in by_step)]


@dataclass(frozen=True, slots=True)
class _Step:
    """One coarse step of n vehicles and m errors, as a function and its slopes.

    Attributes
    ----------
    count, size : n, m
    sparsity : of the information of poses (3 n, 3 n)
    observed, compasses : as `_observed` has them
    onward : the passage to the next step
    """

    count: int
    size: int
    sparsity: ca.Sparsity
    observed: ca.DM
    compasses: ca.DM
    onward: Passage

    @classmethod
    def of(
        cls,
        problem: RefineProblem,
        layout: StateLayout,
        run: CoarseRun,
        sparsity: ca.Sparsity,
        onward: Passage,
    ) -> "_Step":
        """Return the step of a run."""
        observed, compasses = _observed(problem, layout, run)
        return cls(layout.count, layout.size, sparsity, observed, compasses, onward)

    def _inputs(self) -> list[ca.MX]:
        """Information, noise, what varies in F."""
        sizes = self.sparsity.nnz(), 6 * self.count, self.onward.by_place.size1()
        return [ca.MX.sym(name, size) for name, size in zip("MNF", sizes, strict=True)]

    def _known(self, information: ca.MX) -> ca.MX:
        return ca.diagcat(ca.MX(self.sparsity, information), self.compasses)

    def forward(self) -> ca.Function:
        """(P, information, noise, F's) -> (P a step later, variances (n,), S)."""
        covariance = ca.MX.sym("P", self.size, self.size)
        information, noise, moved = self._inputs()
        places, entries = _noise_places(self.count, self.size)
        grown = covariance + ca.MX(places, noise[entries])
        known = self._known(information)
        ways = ca.densify(self.observed @ grown)
        gain = ca.solve(
            ca.MX.eye(self.observed.size1()) + known @ ca.densify(ways @ self.observed.T),
            ca.densify(known @ ways),
            _LINEAR_SOLVER,
        )
        after = grown - ways.T @ gain
        after = 0.5 * (after + after.T)
        variances = _places(self.count, self.size).T @ ca.diag(after)
        carried = self.onward.carried(after, moved)
        return ca.Function(
            "step", [covariance, information, noise, moved], [carried, variances, after]
        )

    def backward(self) -> ca.Function:
        """(weights of P a step later, S, information, noise, F's, weights of variances) -> slopes.

        By P, information, noise, and what varies in F.
        """
        later, after = (ca.MX.sym(name, self.size, self.size) for name in ("B", "S"))
        information, noise, moved = self._inputs()
        late = ca.MX.sym("late", self.count)
        by_after, by_moved = self.onward.carried_slopes(after, moved, later)
        by_after += ca.diag(_places(self.count, self.size) @ late)
        known = self._known(information)
        seen = ca.densify(self.observed @ after)
        ways = seen @ by_after
        by_known = ways @ seen.T
        told = ca.densify(known @ ways) - 0.5 * ca.densify(
            ca.densify(known @ ca.densify(by_known @ known)) @ self.observed
        )
        through = ca.densify(self.observed.T @ told)
        by_grown = by_after - through - through.T
        rows, columns = self.sparsity.get_triplet()
        places, entries = _noise_places(self.count, self.size)
        noise_rows, noise_columns = places.get_triplet()
        gathered = ca.DM.triplet(
            entries,
            list(range(len(entries))),
            ca.DM.ones(len(entries)),
            6 * self.count,
            len(entries),
        )
        return ca.Function(
            "back",
            [later, after, information, noise, moved, late],
            [
                by_grown,
                -_picked(by_known, rows, columns),
                gathered @ _picked(by_grown, noise_rows, noise_columns),
                by_moved,
            ],
        )


def _picked(matrix: ca.MX, rows: list[int], columns: list[int]) -> ca.MX:
    """Single entries of a dense matrix, as a column."""
    size = matrix.size1()
    return ca.vec(matrix)[[row + size * column for row, column in zip(rows, columns, strict=True)]]


def _places(count: int, size: int) -> ca.DM:
    """(m, n) 1 where an error is of a vehicle's place."""
    rows = [3 * k + axis for k in range(count) for axis in (0, 1)]
    return ca.DM.triplet(rows, [row // 3 for row in rows], ca.DM.ones(2 * count), size, count)


def _noise_places(count: int, size: int) -> tuple[ca.Sparsity, list[int]]:
    """Sparsity (m, m) of motion noise, and which of six entries a vehicle each non-zero is."""
    place = {(0, 0): 0, (0, 1): 1, (1, 1): 2, (0, 2): 3, (1, 2): 4, (2, 2): 5}
    rows, columns, entries = [], [], []
    for k in range(count):
        for j in range(3):
            for i in range(3):
                rows.append(3 * k + i)
                columns.append(3 * k + j)
                entries.append(6 * k + place[min(i, j), max(i, j)])
    return ca.Sparsity.triplet(size, size, rows, columns), entries


def _start(problem: RefineProblem, layout: StateLayout) -> ca.MX:
    """(m, m) the covariance at time 0, errors in units of their sigmas."""
    sigma = np.ones(layout.size)
    pose = [problem.noise.position_sigma / problem.scale] * 2 + [problem.noise.heading_sigma]
    sigma[: 3 * layout.count] = np.tile(pose, layout.count)
    return ca.MX(ca.DM(np.diag(sigma**2)))


def _observed(problem: RefineProblem, layout: StateLayout, run: CoarseRun) -> tuple[ca.DM, ca.DM]:
    """What sightings tell of, (r, m) by the state, and what compasses say in one step, (r', r').

    The poses with headings less errors of bearings, then the headings of those with a compass.
    """
    poses = np.eye(3 * layout.count, layout.size)
    for name in layout.names:
        if not ERROR_STATES[name].shifts:
            continue
        for k, column in enumerate(layout.columns[name][:, 0].tolist()):
            if column >= 0:
                poses[3 * k + 2, column] = -layout.sigmas[column - 3 * layout.count]
    sigmas = problem.sensors.compass_sigmas_each_sample
    own = np.flatnonzero(sigmas < np.inf)
    headings = np.zeros((len(own), layout.size))
    headings[np.arange(len(own)), 3 * own + 2] = 1.0
    told = run.times.counts.mean() / sigmas[own] ** 2
    return (
        ca.sparsify(ca.DM(np.concatenate([poses, headings]))),
        ca.sparsify(ca.DM(np.diag(told))) if len(own) else ca.DM(0, 0),
    )
