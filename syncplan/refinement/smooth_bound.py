"""The posterior bound's RMS over a run as a smooth function of the circles.

The recursion of syncplan.estimation.bounds (Tichavský, Muravchik and Nehorai, IEEE Trans. Signal
Process. 46, 1998, equation 21) in coarse steps, a fixed number a turn: sightings and motion noise
of a step's samples are taken together at its middle. Information and noise repeat every turn, so
they are computed for one turn only.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from syncplan.arrays import Index
from syncplan.estimation.referred_system import arc_noise_gain
from syncplan.refinement.problem import RefineProblem, SampleTimes

_STEPS_A_TURN = 32
_MOST_TURNS = 60.0
_LINEAR_SOLVER = "lapackqr"


@dataclass(frozen=True, slots=True)
class CoarseRun:
    """The coarse steps of a run.

    Attributes
    ----------
    times : of one turn
    turn_of_step : (steps,) the sample of the turn that each step uses
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


def smooth_rms(
    problem: RefineProblem,
    run: CoarseRun,
    sparsity: ca.Sparsity,
    information: ca.MX,
    circles: ca.MX,
) -> ca.MX:
    """Return (n,) the RMS position bound over the second half, scaled, of circles (4, n), scaled.

    `information` holds its non-zeros (nnz, k) for each sample of a turn.
    """
    count = problem.orbits.count
    noise, turns = turn_of_vehicles(problem, run.times, circles)
    chosen = run.turn_of_step.tolist()
    sigma = np.array([problem.noise.position_sigma] * 2 + [problem.noise.heading_sigma])
    sigma[:2] /= problem.scale
    start = ca.DM(np.diag(np.tile(sigma**2, count)))
    step = _step(sparsity, count).mapaccum("run", len(chosen), 1)
    _, variances = step(start, information[:, chosen], noise[:, chosen], turns[:, chosen])
    late = variances[:, len(chosen) // 2 :]
    return ca.sqrt(ca.sum2(late) / late.size2())


def _step(sparsity: ca.Sparsity, count: int) -> ca.Function:
    """(P, information, noise, turns) -> (P, variances (n,)) over one coarse step."""
    size = 3 * count
    covariance = ca.MX.sym("P", size, size)
    information = ca.MX.sym("M", sparsity.nnz())
    noise, turns = ca.MX.sym("noise", 6 * count), ca.MX.sym("turns", 2 * count)
    grown = covariance + ca.MX(_block_diagonal(count), noise[_block_entries(count)])
    seen = ca.MX(sparsity, information)
    after = ca.solve(ca.MX.eye(size) + grown @ seen, grown, _LINEAR_SOLVER)
    after = 0.5 * (after + after.T)
    flat = ca.vec(after)
    at = [
        [int(3 * k + i + size * (3 * k + j)) for k in range(count)]
        for i, j in ((0, 0), (1, 1), (0, 2), (1, 2), (2, 2))
    ]
    x, y = turns[0::2], turns[1::2]
    variances = (
        flat[at[0]]
        + flat[at[1]]
        + 2.0 * (x * flat[at[2]] + y * flat[at[3]])
        + (x**2 + y**2) * flat[at[4]]
    )
    return ca.Function("step", [covariance, information, noise, turns], [after, variances])


def _block_diagonal(count: int) -> ca.Sparsity:
    return ca.diagcat(*[ca.Sparsity.dense(3, 3)] * count)


def _block_entries(count: int) -> list[int]:
    """Where each non-zero of the block diagonal, column by column, stands among 6 a vehicle."""
    place = {(0, 0): 0, (0, 1): 1, (1, 1): 2, (0, 2): 3, (1, 2): 4, (2, 2): 5}
    return [
        6 * k + place[min(i, j), max(i, j)]
        for k in range(count)
        for j in range(3)
        for i in range(3)
    ]


def turn_of_vehicles(
    problem: RefineProblem, times: SampleTimes, circles: ca.MX, *, now: bool = False
) -> tuple[ca.MX, ca.MX]:
    """Return motion noise (6 n, k), and displacements since time 0 turned by 90 degrees (2 n, k).

    The noise is that of poses at time 0; with `now` that of poses at each sample, with places from
    the centres in place of displacements.
    """
    count, samples = problem.orbits.count, len(times.angles)
    gain = arc_noise_gain(problem.orbits, problem.sensors.sample_time)
    gain[:, :2] /= problem.scale
    # the part driven by turn rate grows with the speed, so with the radius, which may change
    gain[:, :2, 1] *= (problem.scale / problem.orbits.radii)[:, None]
    gain *= np.array([problem.noise.speed_sigma, problem.noise.turn_rate_sigma])
    parameters = np.concatenate(
        [problem.orbits.senses[None], gain[:, :2, 0].T, gain[:, :2, 1].T, gain[:, 2, 1][None]]
    )
    function = _vehicle_turn(times, now).map(count)
    noise, turns = function(circles, ca.DM(parameters))
    return (
        ca.vertcat(*ca.horzsplit(noise, samples)),
        ca.vertcat(*ca.horzsplit(turns, samples)),
    )


def _vehicle_turn(times: SampleTimes, now: bool) -> ca.Function:
    """(circle, parameters) -> (noise (6, k), turned displacement or place (2, k)) of a vehicle."""
    circle, parameters = ca.SX.sym("circle", 4), ca.SX.sym("parameters", 6)
    sense = parameters[0]
    phase = circle[3] + sense * ca.DM(times.angles).T
    arm = circle[2] * ca.vertcat(ca.cos(phase), ca.sin(phase))
    gone = arm - ca.repmat(
        circle[2] * ca.vertcat(ca.cos(circle[3]), ca.sin(circle[3])), 1, len(times.angles)
    )
    turned = ca.vertcat(-gone[1, :], gone[0, :])
    ahead = sense * ca.vertcat(-ca.sin(phase), ca.cos(phase))
    across = ca.vertcat(-ahead[1, :], ahead[0, :])
    by_speed = ahead * parameters[1] + across * parameters[2]
    by_turn = circle[2] * (ahead * parameters[3] + across * parameters[4])
    if not now:
        by_turn = by_turn - turned * parameters[5]
    noise = ca.vertcat(
        by_speed[0, :] ** 2 + by_turn[0, :] ** 2,
        by_speed[0, :] * by_speed[1, :] + by_turn[0, :] * by_turn[1, :],
        by_speed[1, :] ** 2 + by_turn[1, :] ** 2,
        by_turn[0, :] * parameters[5],
        by_turn[1, :] * parameters[5],
        ca.repmat(parameters[5] ** 2, 1, len(times.angles)),
    )
    counts = ca.repmat(ca.DM(times.counts).T, 6, 1)
    return ca.Function("turn", [circle, parameters], [noise * counts, arm if now else turned])
