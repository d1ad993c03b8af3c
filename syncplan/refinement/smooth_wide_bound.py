"""The posterior bound's RMS with errors as states beside the poses, smooth in the circles.

The coarse steps are those of syncplan.refinement.smooth_bound. There all is referred to time 0,
where sightings and noise of poses repeat every turn; the moves of constant errors grow with the
time. So the state here is that of the moment: from one step to the next, h seconds later, it goes

    x <- F x,    place by heading           J (p(t + h) - p(t))
                 place by wind              h
                 place by speed scale       p(t + h) - p(t)
                 heading by turn-rate bias  h
                 place by turn-rate bias    h J R u(phi(t + h)) - (p(t + h) - p(t)) / (d omega)
                 place by gusts             Ts (1 - a^M) / (1 - a),  a = exp(-Ts / gust time)

with M samples to a step, which repeats every turn. Sightings tell of poses alone: a bearing of the
target's place less the observer's, and of its heading less its bearing bias.

Sources
-------
moves of constant errors : syncplan.orbits.error_states
gusts : sums of geometric series over the samples of a step
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.error_states import ERROR_STATES, StateLayout, layout_of
from syncplan.refinement.problem import RefineProblem
from syncplan.refinement.smooth_bound import CoarseRun, turn_of_vehicles
from syncplan.refinement.smooth_team import SmoothTeam

__all__ = ["smooth_wide_rms"]


_LINEAR_SOLVER = "lapackqr"

_Entry = tuple[int, int, int, float]
"""Row, column, which value it takes, factor."""


@dataclass(frozen=True, slots=True)
class _Passage:
    """How the state goes on for `span` s, its positions scaled.

    Attributes
    ----------
    sparsity : of F (m, m)
    by_place : (nnz, 4 n + 1) F's non-zeros, by how far each vehicle goes, where it then is from its
        centre, and 1
    noise : (m, m) of gusts
    """

    sparsity: ca.Sparsity
    by_place: ca.DM
    noise: ca.DM


def smooth_wide_rms(
    problem: RefineProblem, run: CoarseRun, seen: SmoothTeam, circles: ca.MX, width: float
) -> ca.MX:
    """Return (n,) the RMS position bound over the second half, scaled, of circles (4, n), scaled.

    The states are those that the team's filter estimates; `seen` is the team at the run's times.
    """
    layout = layout_of(problem.team)
    noise, arms = turn_of_vehicles(problem, run.times, circles, now=True)
    span = 2.0 * np.pi / (len(run.times.angles) * problem.orbits.rate)
    onward, begun = (_passage(problem, layout, share * span) for share in (1.0, 0.5))
    following = arms[:, [*range(1, len(run.times.angles)), 0]]
    first = ca.vec(ca.vertcat(*(circles[2, :] * turn(circles[3, :]) for turn in (ca.cos, ca.sin))))
    chosen = run.turn_of_step.tolist()
    step = _step(problem, layout, run, seen.sparsity, onward)
    _, variances = step.mapaccum("run", len(chosen), 1)(
        _carried(begun, _start(problem, layout), _moved(begun, arms[:, 0], first)),
        seen.information_now(circles, width)[:, chosen],
        noise[:, chosen],
        _moved(onward, following, arms)[:, chosen],
    )
    late = variances[:, len(chosen) // 2 :]
    return ca.sqrt(ca.sum2(late) / late.size2())


def _step(
    problem: RefineProblem,
    layout: StateLayout,
    run: CoarseRun,
    sparsity: ca.Sparsity,
    onward: _Passage,
) -> ca.Function:
    """(P, information, noise, F's non-zeros) -> (P a step later, variances (n,))."""
    size, count = layout.size, problem.orbits.count
    covariance = ca.MX.sym("P", size, size)
    information, noise = ca.MX.sym("M", sparsity.nnz()), ca.MX.sym("noise", 6 * count)
    moved = ca.MX.sym("F", onward.sparsity.nnz())
    observed, compasses = _observed(problem, layout, run)
    grown = covariance + ca.MX(*_pose_noise(noise, count, size))
    known = ca.diagcat(ca.MX(sparsity, information), compasses)
    ways = observed @ grown
    gain = ca.solve(
        ca.MX.eye(observed.size1()) + known @ ca.densify(ways @ observed.T),
        ca.densify(known @ ways),
        _LINEAR_SOLVER,
    )
    after = grown - ways.T @ gain
    after = 0.5 * (after + after.T)
    place = [3 * k + axis + size * (3 * k + axis) for axis in (0, 1) for k in range(count)]
    flat = ca.vec(after)
    variances = flat[place[:count]] + flat[place[count:]]
    return ca.Function(
        "step",
        [covariance, information, noise, moved],
        [_carried(onward, after, moved), variances],
    )


def _carried(passage: _Passage, covariance: ca.MX, moved: ca.MX) -> ca.MX:
    """(m, m) P at the end of a passage whose F has the non-zeros `moved`."""
    onward = ca.MX(passage.sparsity, moved)
    return ca.densify(onward @ (onward @ covariance).T + passage.noise)


def _moved(passage: _Passage, after: ca.MX, before: ca.MX) -> ca.MX:
    """(nnz, k) F's non-zeros, for arms (2 n, k) before and after."""
    ones = ca.DM.ones(1, after.size2())
    return passage.by_place @ ca.vertcat(after - before, after, ones)


def _start(problem: RefineProblem, layout: StateLayout) -> ca.MX:
    """(m, m) the covariance at time 0, errors in units of their sigmas."""
    sigma = np.ones(layout.size)
    pose = [problem.noise.position_sigma / problem.scale] * 2 + [problem.noise.heading_sigma]
    sigma[: 3 * layout.count] = np.tile(pose, layout.count)
    return ca.MX(ca.DM(np.diag(sigma**2)))


def _pose_noise(noise: ca.MX, count: int, size: int) -> tuple[ca.Sparsity, ca.MX]:
    """The sparse (m, m) motion noise of six entries a vehicle."""
    place = {(0, 0): 0, (0, 1): 1, (1, 1): 2, (0, 2): 3, (1, 2): 4, (2, 2): 5}
    rows, columns, entries = [], [], []
    for k in range(count):
        for j in range(3):
            for i in range(3):
                rows.append(3 * k + i)
                columns.append(3 * k + j)
                entries.append(6 * k + place[min(i, j), max(i, j)])
    return ca.Sparsity.triplet(size, size, rows, columns), noise[entries]


def _observed(problem: RefineProblem, layout: StateLayout, run: CoarseRun) -> tuple[ca.DM, ca.DM]:
    """What sightings tell of, (r, m) by the state, and what compasses say in one step, (r', r').

    The poses with headings less bearing biases, then the headings of those with a compass.
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


@dataclass(frozen=True, slots=True)
class _Span:
    """How long a passage takes, and what it does to gusts.

    Attributes
    ----------
    seconds : s
    scale : m, of positions
    rate : (n,) rad/s, of each vehicle's phase
    kept : share of a gust that is left
    push : s, how far a gust moves a vehicle that it had at the beginning
    spread, joint, fresh : s^2, s, 1: variance of how far later gusts move it, its covariance with
        the gust left at the end, and the variance of that, for gusts of variance 1
    """

    seconds: float
    scale: float
    rate: Array
    kept: float
    push: float
    spread: float
    joint: float
    fresh: float

    @classmethod
    def of(cls, problem: RefineProblem, seconds: float) -> "_Span":
        """Return what `seconds` s do in a problem."""
        orbits, sample_time = problem.orbits, problem.sensors.sample_time
        kept_each = float(np.exp(-sample_time / problem.team.errors.gust_time))
        samples = seconds / sample_time
        kept = kept_each**samples
        once, twice = (1.0 - kept) / (1.0 - kept_each), (1.0 - kept**2) / (1.0 - kept_each**2)
        # within one sample later gusts move nothing yet
        later = 1.0 if samples > 1.0 else 0.0
        fresh_each = 1.0 - kept_each**2
        spread = fresh_each * (samples - 2.0 * once + twice) / (1.0 - kept_each) ** 2
        return cls(
            seconds=seconds,
            scale=problem.scale,
            rate=orbits.senses * orbits.rate,
            kept=kept,
            push=sample_time * once,
            spread=later * sample_time**2 * spread,
            joint=later * sample_time * fresh_each * (once - twice) / (1.0 - kept_each),
            fresh=1.0 - kept**2,
        )


@dataclass(frozen=True, slots=True)
class _Own:
    """The state of one vehicle, and the values that F is made of.

    Attributes
    ----------
    x, y, heading : rows of its pose
    gone, arm : which values are x and y of how far it goes, and of where it then is
    one : which value is 1
    rate : rad/s of its phase
    """

    x: int
    y: int
    heading: int
    gone: tuple[int, int]
    arm: tuple[int, int]
    one: int
    rate: float

    @classmethod
    def of(cls, vehicle: int, count: int, span: _Span) -> "_Own":
        """Return those of one of `count` vehicles."""
        first, second = 2 * vehicle, 2 * count + 2 * vehicle
        return cls(
            x=3 * vehicle,
            y=3 * vehicle + 1,
            heading=3 * vehicle + 2,
            gone=(first, first + 1),
            arm=(second, second + 1),
            one=4 * count,
            rate=float(span.rate[vehicle]),
        )


def _by_wind(own: _Own, span: _Span, columns: list[int]) -> list[_Entry]:
    far = span.seconds / span.scale
    return [(own.x, columns[0], own.one, far), (own.y, columns[1], own.one, far)]


def _by_speed_scale(own: _Own, span: _Span, columns: list[int]) -> list[_Entry]:
    return [(own.x, columns[0], own.gone[0], 1.0), (own.y, columns[0], own.gone[1], 1.0)]


def _by_turn_rate_bias(own: _Own, span: _Span, columns: list[int]) -> list[_Entry]:
    (column,) = columns
    return [
        (own.x, column, own.arm[1], -span.seconds),
        (own.x, column, own.gone[0], -1.0 / own.rate),
        (own.y, column, own.arm[0], span.seconds),
        (own.y, column, own.gone[1], -1.0 / own.rate),
        (own.heading, column, own.one, span.seconds),
    ]


def _by_nothing(own: _Own, span: _Span, columns: list[int]) -> list[_Entry]:
    return []


def _by_gusts(own: _Own, span: _Span, columns: list[int]) -> list[_Entry]:
    entries = []
    for row, column in zip((own.x, own.y), columns, strict=True):
        entries.append((row, column, own.one, span.push / span.scale))
        entries.append((column, column, own.one, span.kept - 1.0))
    return entries


_MOVES = {
    "wind": _by_wind,
    "speed_scale": _by_speed_scale,
    "turn_rate_bias": _by_turn_rate_bias,
    "bearing_bias": _by_nothing,
    "gusts": _by_gusts,
}
"""What a unit of each error in ERROR_STATES adds to F."""


def _passage(problem: RefineProblem, layout: StateLayout, seconds: float) -> _Passage:
    """How the state goes on for `seconds` s."""
    count, span = layout.count, _Span.of(problem, seconds)
    entries: list[_Entry] = [(k, k, 4 * count, 1.0) for k in range(layout.size)]
    for vehicle in range(count):
        own = _Own.of(vehicle, count, span)
        entries += [(own.x, own.heading, own.gone[1], -1.0)]
        entries += [(own.y, own.heading, own.gone[0], 1.0)]
        for name in layout.names:
            columns = layout.columns[name][vehicle]
            if np.all(columns >= 0):
                for row, column, value, size in _MOVES[name](own, span, columns.tolist()):
                    unit = 1.0 if row == column else layout.sigmas[column - 3 * count]
                    entries.append((row, column, value, size * unit))
    rows, columns = [one[0] for one in entries], [one[1] for one in entries]
    sparsity = ca.Sparsity.triplet(layout.size, layout.size, rows, columns)
    position = {place: k for k, place in enumerate(zip(*sparsity.get_triplet(), strict=True))}
    by_place = np.zeros((sparsity.nnz(), 4 * count + 1))
    for row, column, value, size in entries:
        by_place[position[row, column], value] += size
    return _Passage(sparsity, ca.sparsify(ca.DM(by_place)), _gust_noise(layout, span))


def _gust_noise(layout: StateLayout, span: _Span) -> ca.DM:
    """(m, m) what gusts that come up on the way add."""
    noise = np.zeros((layout.size, layout.size))
    for name in layout.names:
        if ERROR_STATES[name].constant:
            continue
        for vehicle, columns in enumerate(layout.columns[name].tolist()):
            for axis, column in enumerate(columns):
                row, far = 3 * vehicle + axis, layout.sigmas[column - 3 * layout.count] / span.scale
                noise[row, row] += far**2 * span.spread
                noise[row, column] = noise[column, row] = far * span.joint
                noise[column, column] = span.fresh
    return ca.sparsify(ca.DM(noise))
