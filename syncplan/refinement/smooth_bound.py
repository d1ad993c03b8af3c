"""RMS of the posterior bound over a run as a smooth function of the circles, and its slopes.

The recursion of syncplan.estimation.bounds (Tichavský, Muravchik and Nehorai, IEEE Trans. Signal
Process. 46, 1998, equation 21) runs in coarse steps, a fixed number per turn. The sightings and
motion noise of a step's samples are taken together at its middle. The state is the current one:
poses, then the bias states that the filter estimates, if any. So the inputs of a step repeat every
turn. Sightings show poses alone: a bearing depends on the target's position relative to the
observer, and on the observer's heading less its bearing bias and walk. With these `observed` (r, m)
and the information K (r, r) on them, a step is

    P <- P + motion noise
    S = P - (O P)^T (1 + K O P O^T)^-1 K O P       = (1 + P O^T K O)^-1 P; gives the variances
    P <- F S F^T + noise of gusts and bearing walks

Its slopes are written out, from the last step to the first. With weights B of S,

    U = O S B,  V = U S O^T,  Q = K U - K V K O / 2
    weights of K   -V,    weights of P   B - O^T Q - Q^T O

Automatic differentiation of the same recursion takes about three times as long.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.referred_system import arc_noise_gain
from syncplan.orbits.circles import Orbits, perpendicular, unit
from syncplan.orbits.error_states import ERROR_STATES, StateLayout, layout_of
from syncplan.refinement.problem import RefineProblem, SampleTimes
from syncplan.refinement.smooth_team import SmoothTeam

_STEPS_A_TURN = 32
_MOST_TURNS = 60.0
_LINEAR_SOLVER = "lapackqr"

_AT_ONCE = {"base": -1}
"""Option that unrolls a recursion at once: nested levels pay only where CasADi differentiates."""


@dataclass(frozen=True, slots=True)
class CoarseRun:
    """Coarse steps of a run.

    Attributes
    ----------
    times : samples of one turn
    turn_of_step : (steps,) sample of the turn that each step uses
    """

    times: SampleTimes
    turn_of_step: Index


def coarse_run(problem: RefineProblem) -> CoarseRun:
    """Return the steps of the problem's duration, cut where the bound has become periodic."""
    samples = problem.orbits.period / problem.sensors.sample_time
    number = max(1, min(_STEPS_A_TURN, int(np.ceil(samples))))
    angles = 2.0 * np.pi * (np.arange(number) + 0.5) / number
    turns = min(problem.duration / problem.orbits.period, _MOST_TURNS)
    steps = max(2, round(turns * number))
    counts = np.full(number, samples / number)
    every = problem.sensors.every
    ready = counts[:, None] / every if np.any(every > 1) else None
    return CoarseRun(SampleTimes(angles, counts, ready), np.arange(steps) % number)


@dataclass(frozen=True, slots=True)
class SmoothRms:
    """RMS position bounds of n vehicles, and their slopes.

    Attributes
    ----------
    value : (n,) over the second half, scaled
    slopes : function from weights (n,) to the gradient (4, n) of the weighted sum of `value`, with
        respect to the circles
    """

    value: ca.MX
    slopes: Callable[[ca.MX], ca.MX]


def smooth_rms(
    problem: RefineProblem, run: CoarseRun, seen: SmoothTeam, circles: ca.MX, width: float
) -> SmoothRms:
    """Return the RMS position bounds of circles (4, n), scaled.

    The bias states are those that the team's filter estimates, except clock offsets, which would
    make each observer see its targets elsewhere; exact verdicts include them. `seen` is the team at
    the run's times.
    """
    estimated = problem.team.errors.estimated
    layout = layout_of(problem.team, [name for name in estimated if not ERROR_STATES[name].delays])
    span = 2.0 * np.pi / (len(run.times.angles) * problem.orbits.rate)
    onward, begun = (Passage.of(problem, layout, share * span) for share in (1.0, 0.5))
    at = ca.MX.sym("X", 4, problem.orbits.count)
    noise, arms = _turn_of_vehicles(problem, run.times, at)
    made = ca.Function(
        "made",
        [at],
        [
            begun.carried(_start(problem, layout), begun.by_place @ arms[:, 0]),
            seen.information_now(at, width),
            noise,
            onward.by_place @ arms[:, [*range(1, len(run.times.angles)), 0]],
        ],
    )
    start, *turn = made(circles)
    step = _Step(layout, seen.sparsity, *_observed(problem, layout, run), onward)
    value, after = _forward(step, run.turn_of_step, start, turn)

    def slopes(weights: ca.MX) -> ca.MX:
        number = len(run.turn_of_step)
        late = 0.5 * weights / (value * (number - number // 2))
        found = _backward(step, run.turn_of_step, turn, after, late)
        return made.reverse(1)(circles, start, *turn, *found)

    return SmoothRms(value, slopes)


def _forward(step: "_Step", chosen: Index, start: ca.MX, turn: list[ca.MX]) -> tuple[ca.MX, ca.MX]:
    """RMS (n,) over the second half, and covariances (m, m k) after each step's sightings.

    `turn` holds the information, noise and varying entries of F, a column for each sample.
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
    """Slopes with respect to the covariance at the start and to `turn`.

    `late` (n,) are those with respect to each vehicle's variance, at every step of the second half.
    """
    number, size = len(chosen), step.layout.size
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


# --- one step -------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Step:
    """One coarse step of n vehicles and m states, as a function and its slopes.

    Attributes
    ----------
    layout : of the states
    sparsity : of the information of poses (3 n, 3 n)
    observed, compasses : results of `_observed`
    onward : the passage to the next step
    """

    layout: StateLayout
    sparsity: ca.Sparsity
    observed: ca.DM
    compasses: ca.DM
    onward: "Passage"

    def _inputs(self) -> list[ca.MX]:
        """Symbols of the information, noise and varying entries of F."""
        sizes = self.sparsity.nnz(), 6 * self.layout.count, self.onward.by_place.size1()
        return [ca.MX.sym(name, size) for name, size in zip("MNF", sizes, strict=True)]

    def _known(self, information: ca.MX) -> ca.MX:
        return ca.diagcat(ca.MX(self.sparsity, information), self.compasses)

    def forward(self) -> ca.Function:
        """Return the function (P, information, noise, F's) -> (later P, variances (n,), S)."""
        covariance = ca.MX.sym("P", self.layout.size, self.layout.size)
        information, noise, moved = self._inputs()
        places, entries = _noise_places(self.layout)
        grown = covariance + ca.MX(places, noise[entries])
        after = self._updated(grown, self._known(information))
        after = 0.5 * (after + after.T)
        variances = _places(self.layout).T @ ca.diag(after)
        carried = self.onward.carried(after, moved)
        return ca.Function(
            "step", [covariance, information, noise, moved], [carried, variances, after]
        )

    def _updated(self, grown: ca.MX, known: ca.MX) -> ca.MX:
        """Covariance after sightings, by the smaller of two systems of equations."""
        observations, size = self.observed.shape
        if observations >= size:
            shown = self.observed.T @ known @ self.observed
            return ca.solve(ca.MX.eye(size) + grown @ shown, grown, _LINEAR_SOLVER)
        ways = ca.densify(self.observed @ grown)
        gain = ca.solve(
            ca.MX.eye(observations) + known @ ca.densify(ways @ self.observed.T),
            ca.densify(known @ ways),
            _LINEAR_SOLVER,
        )
        return grown - ways.T @ gain

    def backward(self) -> ca.Function:
        """Return the slopes of `forward` as a function.

        (weights of the later P, S, information, noise, F's, weights of variances) -> slopes with
        respect to P, information, noise and the varying entries of F.
        """
        size, count = self.layout.size, self.layout.count
        later, after = (ca.MX.sym(name, size, size) for name in ("B", "S"))
        information, noise, moved = self._inputs()
        late = ca.MX.sym("late", count)
        by_after, by_moved = self.onward.carried_slopes(after, moved, later)
        by_after += ca.diag(_places(self.layout) @ late)
        known = self._known(information)
        seen = ca.densify(self.observed @ after)
        ways = seen @ by_after
        by_known = ways @ seen.T
        gained = ca.densify(known @ ways) - 0.5 * ca.densify(
            ca.densify(known @ ca.densify(by_known @ known)) @ self.observed
        )
        through = ca.densify(self.observed.T @ gained)
        by_grown = by_after - through - through.T
        places, entries = _noise_places(self.layout)
        number = len(entries)
        gathered = ca.DM.triplet(
            entries, list(range(number)), ca.DM.ones(number), 6 * count, number
        )
        return ca.Function(
            "back",
            [later, after, information, noise, moved, late],
            [
                by_grown,
                -_picked(by_known, self.sparsity),
                gathered @ _picked(by_grown, places),
                by_moved,
            ],
        )


def _picked(matrix: ca.MX, sparsity: ca.Sparsity) -> ca.MX:
    """Entries of a dense matrix at a sparsity's non-zeros, as a column."""
    rows, columns = sparsity.get_triplet()
    size = matrix.size1()
    return ca.vec(matrix)[[row + size * column for row, column in zip(rows, columns, strict=True)]]


def _places(layout: StateLayout) -> ca.DM:
    """Matrix (m, n) with 1 where a state is a coordinate of a vehicle."""
    rows = [3 * k + axis for k in range(layout.count) for axis in (0, 1)]
    ones = ca.DM.ones(len(rows))
    return ca.DM.triplet(rows, [row // 3 for row in rows], ones, layout.size, layout.count)


def _noise_places(layout: StateLayout) -> tuple[ca.Sparsity, list[int]]:
    """Sparsity (m, m) of motion noise, and which entry each non-zero is, of six per vehicle."""
    place = {(0, 0): 0, (0, 1): 1, (1, 1): 2, (0, 2): 3, (1, 2): 4, (2, 2): 5}
    rows, columns, entries = [], [], []
    for k in range(layout.count):
        for j in range(3):
            for i in range(3):
                rows.append(3 * k + i)
                columns.append(3 * k + j)
                entries.append(6 * k + place[min(i, j), max(i, j)])
    return ca.Sparsity.triplet(layout.size, layout.size, rows, columns), entries


def _start(problem: RefineProblem, layout: StateLayout) -> ca.MX:
    """Covariance (m, m) at time 0, with bias states in units of their sigmas."""
    sigma = np.ones(layout.size)
    pose = [problem.noise.position_sigma / problem.scale] * 2 + [problem.noise.heading_sigma]
    sigma[: 3 * layout.count] = np.tile(pose, layout.count)
    return ca.MX(ca.DM(np.diag(sigma**2)))


def _observed(problem: RefineProblem, layout: StateLayout, run: CoarseRun) -> tuple[ca.DM, ca.DM]:
    """Rows (r, m) that sightings observe, and the information (r', r') of compasses in a step.

    The rows are the poses, with headings less errors of bearings, then the headings of vehicles
    with a compass, plus errors of compasses.
    """
    poses = np.eye(3 * layout.count, layout.size)
    headings = poses[2::3].copy()
    rows, signs = {"bearing": poses[2::3], "compass": headings}, {"bearing": -1.0, "compass": 1.0}
    for name in layout.names:
        kind = ERROR_STATES[name].shifts
        if kind not in rows:
            continue
        for k, column in enumerate(layout.columns[name][:, 0].tolist()):
            if column >= 0:
                rows[kind][k, column] = signs[kind] * layout.sigmas[column - 3 * layout.count]
    sigmas = problem.sensors.compass_sigmas_each_sample
    own = np.flatnonzero(sigmas < np.inf)
    headings = headings[own]
    information = run.times.counts.mean() / sigmas[own] ** 2
    return (
        ca.sparsify(ca.DM(np.concatenate([poses, headings]))),
        ca.sparsify(ca.DM(np.diag(information))) if len(own) else ca.DM(0, 0),
    )


# --- motion noise ---------------------------------------------------------------------------------


def _turn_of_vehicles(
    problem: RefineProblem, times: SampleTimes, circles: ca.MX
) -> tuple[ca.MX, ca.MX]:
    """Motion noise of poses at each sample (6 n, k), and positions from the centres (2 n, k)."""
    count, samples = problem.orbits.count, len(times.angles)
    gain = arc_noise_gain(problem.orbits, problem.sensors.sample_time)
    gain[:, :2] /= problem.scale
    # the part driven by turn rate grows with the speed, and so with the radius, which may change
    gain[:, :2, 1] *= (problem.scale / problem.orbits.radii)[:, None]
    gain *= np.array([problem.noise.speed_sigma, problem.noise.turn_rate_sigma])
    parameters = np.concatenate(
        [problem.orbits.senses[None], gain[:, :2, 0].T, gain[:, :2, 1].T, gain[:, 2, 1][None]]
    )
    noise, arms = _vehicle_turn(times).map(count)(circles, ca.DM(parameters))
    return (
        ca.vertcat(*ca.horzsplit(noise, samples)),
        ca.vertcat(*ca.horzsplit(arms, samples)),
    )


def _vehicle_turn(times: SampleTimes) -> ca.Function:
    """Function (circle, parameters) -> (noise (6, k), position from the centre (2, k))."""
    circle, parameters = ca.SX.sym("circle", 4), ca.SX.sym("parameters", 6)
    sense = parameters[0]
    phase = circle[3] + sense * ca.DM(times.angles).T
    ahead = sense * ca.vertcat(-ca.sin(phase), ca.cos(phase))
    across = ca.vertcat(-ahead[1, :], ahead[0, :])
    by_speed = ahead * parameters[1] + across * parameters[2]
    by_turn = circle[2] * (ahead * parameters[3] + across * parameters[4])
    noise = ca.vertcat(
        by_speed[0, :] ** 2 + by_turn[0, :] ** 2,
        by_speed[0, :] * by_speed[1, :] + by_turn[0, :] * by_turn[1, :],
        by_speed[1, :] ** 2 + by_turn[1, :] ** 2,
        by_turn[0, :] * parameters[5],
        by_turn[1, :] * parameters[5],
        ca.repmat(parameters[5] ** 2, 1, len(times.angles)),
    )
    arm = circle[2] * ca.vertcat(ca.cos(phase), ca.sin(phase))
    counts = ca.repmat(ca.DM(times.counts).T, 6, 1)
    return ca.Function("turn", [circle, parameters], [noise * counts, arm])


# --- from moment to moment ------------------------------------------------------------------------
#
#     place by heading           J (p(t + h) - p(t))
#     place by constant errors   their moves in h seconds, see syncplan.orbits.error_states
#     place by gusts             Ts (1 - a^M) / (1 - a)
#     gusts, bearing walks       a^M of themselves,  a = exp(-Ts / correlation time)
#
# with M samples in h seconds. A position on a circle determines that of h seconds before, so each
# entry of F is a constant or a linear function of p(t + h). Applied as factors of rows, the few
# entries that vary are cheap to apply and to differentiate.


@dataclass(frozen=True, slots=True)
class Passage:
    """Transition of the m states over some seconds, positions scaled and errors in their sigmas.

    Attributes
    ----------
    steady : (m, m) part of F that is the same for all circles
    by_place : (q, 2 n) slopes of the entries that vary, by each vehicle's final position from its
        centre
    taken, given : (q, m), (m, q) 1 at the column, and at the row, of each of these entries
    noise : (m, m) of gusts and walks that arise during the passage
    """

    steady: ca.DM
    by_place: ca.DM
    taken: ca.DM
    given: ca.DM
    noise: ca.DM

    @classmethod
    def of(cls, problem: RefineProblem, layout: StateLayout, seconds: float) -> "Passage":
        """Return the passage of `seconds` s."""
        count, sample_time = layout.count, problem.sensors.sample_time
        steady, noise = np.eye(layout.size), np.zeros((layout.size, layout.size))
        varying: dict[tuple[int, int], Array] = {}

        def move(moves: Array, vehicle: int, column: int, size: float) -> None:
            """Add the effect of a state on a vehicle: `moves` is (3, 3), see `_moves`."""
            for row, (constant, *by_place) in enumerate(moves.T.tolist(), 3 * vehicle):
                steady[row, column] += size * constant
                if any(by_place):
                    slots = varying.setdefault((row, column), np.zeros(2 * count))
                    slots[2 * vehicle : 2 * vehicle + 2] = np.multiply(size, by_place)

        turned = _moves(problem, _turned, seconds)
        for vehicle in range(count):
            move(turned[:, 0, :, vehicle], vehicle, 3 * vehicle + 2, 1.0)
        for name in layout.names:
            state = ERROR_STATES[name]
            moves = _moves(problem, state.moves, seconds) if state.constant else None
            for vehicle, axis in np.argwhere(layout.columns[name] >= 0).tolist():
                column = int(layout.columns[name][vehicle, axis])
                sigma = float(layout.sigmas[column - 3 * count])
                if moves is not None:
                    move(moves[:, axis, :, vehicle], vehicle, column, sigma)
                    continue
                change = _Change.of(layout.times[column - 3 * count], sample_time, seconds)
                steady[column, column] = change.kept
                noise[column, column] = 1.0 - change.kept**2
                if state.drifts:
                    row, far = 3 * vehicle + axis, sigma / problem.scale
                    steady[row, column] = far * change.push
                    noise[row, row] = far**2 * change.spread
                    noise[row, column] = noise[column, row] = far * change.joint
        rows, columns = np.array([*varying]).T
        identity = np.eye(layout.size)
        by_place = np.array([*varying.values()])
        matrices = steady, by_place, identity[columns], identity[:, rows], noise
        return cls(*(ca.sparsify(ca.DM(one)) for one in matrices))

    def onward(self, matrix: ca.MX, moved: ca.MX) -> ca.MX:
        """Return F times a matrix (m, c); `moved` (q, 1) are the entries that vary."""
        varying = ca.repmat(moved, 1, matrix.size2()) * (self.taken @ matrix)
        return ca.densify(self.steady @ matrix + self.given @ varying)

    def back(self, matrix: ca.MX, moved: ca.MX) -> ca.MX:
        """Return F's transpose times a matrix (m, c)."""
        varying = ca.repmat(moved, 1, matrix.size2()) * (self.given.T @ matrix)
        return ca.densify(self.steady.T @ matrix + self.taken.T @ varying)

    def carried(self, covariance: ca.MX, moved: ca.MX) -> ca.MX:
        """Return the covariance (m, m) at the end."""
        return self.onward(self.onward(covariance, moved).T, moved) + self.noise

    def carried_slopes(
        self, covariance: ca.MX, moved: ca.MX, weights: ca.MX
    ) -> tuple[ca.MX, ca.MX]:
        """Return the slopes of the sum of `weights` (m, m), symmetric, times `carried`.

        They are with respect to the covariance, (m, m), and to the entries that vary, (q, 1).
        """
        by_covariance = self.back(self.back(weights, moved).T, moved)
        columns = self.taken @ self.onward(covariance, moved).T
        return by_covariance, 2.0 * ca.sum2((self.given.T @ weights) * columns)


_Moves = Callable[[Orbits, Index, Array], Array]
"""Type of ErrorState.moves."""

_ROUNDING = 1e-12
"""Size up to which moves are rounding errors of a cosine that should be 0."""


def _moves(problem: RefineProblem, moves: _Moves, seconds: float) -> Array:
    """Moves (3, axes, 3, n) in `seconds` s: constants, then slopes by x and y of the end position.

    They are read off a circle of radius 0 and circles of radius 1 that end on each axis.
    """
    orbits, vehicles = problem.orbits, np.arange(problem.orbits.count)
    begun = -orbits.senses * orbits.rate * seconds
    constant, by_x, by_y = (
        moves(
            replace(orbits, radii=np.full(len(vehicles), radius), phases=begun + phase),
            vehicles,
            np.full(len(vehicles), seconds),
        )
        for radius, phase in ((0.0, 0.0), (1.0, 0.0), (1.0, 0.5 * np.pi))
    )
    found = np.stack([constant, by_x - constant, by_y - constant])
    found[:, :, :2] /= problem.scale
    found[1:] *= problem.scale
    return np.where(np.abs(found) > _ROUNDING, found, 0.0)


def _turned(orbits: Orbits, vehicles: Index, times: Array) -> Array:
    """Moves (1, 3, s) of vehicles by a unit of heading: their displacement, a quarter turn on."""
    turn = orbits.senses[vehicles] * orbits.rate * times
    gone = unit(orbits.phases[vehicles] + turn) - unit(orbits.phases[vehicles])
    moves = np.zeros((1, 3, len(vehicles)))
    moves[0, :2] = perpendicular(orbits.radii[vehicles][:, None] * gone).T
    return moves


@dataclass(frozen=True, slots=True)
class _Change:
    """Change of an error of variance 1 in some seconds.

    Attributes
    ----------
    kept : share of it that is left
    push : s, displacement of a vehicle by a unit of the gust at the beginning
    spread, joint : s^2, s: variance of the displacement by later gusts, and its covariance with
        the gust at the end
    """

    kept: float
    push: float
    spread: float
    joint: float

    @classmethod
    def of(cls, time: float, sample_time: float, seconds: float) -> "_Change":
        """Return the change in `seconds` s with a correlation time of `time` s."""
        kept_each = float(np.exp(-sample_time / time))
        samples = seconds / sample_time
        kept = kept_each**samples
        once, twice = (1.0 - kept) / (1.0 - kept_each), (1.0 - kept**2) / (1.0 - kept_each**2)
        # within one sample later gusts do not move the vehicle yet
        later = 1.0 if samples > 1.0 else 0.0
        fresh_each = 1.0 - kept_each**2
        spread = fresh_each * (samples - 2.0 * once + twice) / (1.0 - kept_each) ** 2
        return cls(
            kept=kept,
            push=sample_time * once,
            spread=later * sample_time**2 * spread,
            joint=later * sample_time * fresh_each * (once - twice) / (1.0 - kept_each),
        )
