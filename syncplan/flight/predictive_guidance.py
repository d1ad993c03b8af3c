"""Guidance `mpc`: each vehicle decides by a quadratic program how to fly the next third of a turn.

Every `interval` seconds, from estimates:

    guess     the last decision carried on, the tracking law, or an interception, the least costly
    program   how to change the guess, with limits and changes of commands as constraints
    solve     OSQP; again with separation where the flight that comes out would be too near another
    choose    the largest share of the change that makes the exact flight less costly

A program that OSQP does not solve is refused: the vehicle flies its guess, which is within limits.

Steps of the horizon take 0.1 rad of a turn, but at least the interval, 20 of them by default: 2 rad.
That is as long as a vehicle with default limits needs to turn round and to cross its circle at full
speed, so one that is half a period off sees its place in reach.

Solving does not depend on load or time: OSQP has no limit of time, its penalty is fixed, its data
come scaled, and each program starts from the guess and its multipliers, whatever was solved before.
"""

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import numpy as np

from syncplan.arrays import Array, Flags, Index, short_repr
from syncplan.flight.flight_limits import FlightLimits
from syncplan.flight.predictive_model import SEARCHED, Bounds, Course, Foreseen, Laws, lay_course
from syncplan.flight.predictive_program import Program, Weights, write_separation
from syncplan.flight.predictive_team import TeamState, guess_flights, improve_flight
from syncplan.flight.reference_tracking import tracking_gains
from syncplan.orbits.circles import Orbits

__all__ = ["Commands", "PredictiveGuidance", "PredictiveOptions", "Status"]

STEP_ANGLE = 0.1
"""rad of a turn that a step of the horizon takes at least."""

SETTINGS = {
    "adaptive_rho": 0,
    "rho": 0.3,
    "alpha": 1.6,
    "scaling": 0,
    "check_termination": 10,
    "max_iter": 500,
    "eps_abs": 1e-3,
    "eps_rel": 1e-3,
    "polishing": False,
    "verbose": False,
}
"""Of OSQP. Nothing in them depends on time; the penalty rho is fixed."""

SOLVED = 1
"""OSQP's status of a program that is solved to the tolerances."""


class Status(IntEnum):
    """What became of a vehicle's program."""

    SOLVED = 0
    NEAR = 1
    """Solved, but the flight decided on comes nearer to another's than asked."""
    REFUSED = 2
    """Not solved: the vehicle flies its first guess, which is within limits."""
    HELD = 3
    """Does not steer."""


@dataclass(frozen=True, slots=True)
class PredictiveOptions:
    """How guidance `mpc` decides.

    Attributes
    ----------
    interval : s between decisions
    steps : of the horizon
    margin : m added to the separation asked, for the uncertainty of estimates
    neighbours : others that a vehicle keeps away from at a step of the horizon, the nearest
    change_share : share of its range by which a command may change from a step to the next
    near_share : of the radius; from errors of this size on, their size counts, not their square
    heading, effort, shortfall : weights of the objective, see `predictive_program`
    """

    interval: float = 0.5
    steps: int = 20
    margin: float = 0.0
    neighbours: int = 2
    change_share: float = 0.5
    near_share: float = 0.2
    heading: float = 1.0
    effort: float = 0.1
    shortfall: float = 100.0


@dataclass(frozen=True, slots=True, repr=False)
class Commands:
    """What a team is to do until the next decision.

    Attributes
    ----------
    values : (n, 2) speed through the air in m/s, turn rate in rad/s
    status : (n,) of Status
    flights : (n, N, 2) commands of the whole horizon
    poses : (n, N + 1, 3) where these lead, in m and rad
    shortfalls : (n,) m of separation, summed over the horizon
    iterations : (n,) of OSQP
    """

    values: Array
    status: Index
    flights: Array
    poses: Array
    shortfalls: Array
    iterations: Index

    __repr__ = short_repr


class PredictiveGuidance:
    """Decides for one team in one flight; remembers what was decided last."""

    def __init__(
        self, orbits: Orbits, limits: FlightLimits, options: PredictiveOptions | None = None
    ) -> None:
        self._orbits, self._options = orbits, options or PredictiveOptions()
        chosen, n = self._options, orbits.count
        self._step = max(chosen.interval, STEP_ANGLE / orbits.rate)
        self._laws = _laws(orbits, limits, self._step)
        self._bounds = _bounds(limits, chosen)
        self._weights = _weights(orbits, limits, chosen, self._step)
        steps, self._neighbours = chosen.steps, max(min(chosen.neighbours, n - 1), 0)
        self._seen, self._guesses, self._found = (_foreseen(n, steps) for _ in range(3))
        self._course = Course(
            np.empty((n, SEARCHED * steps + 1, 2)),
            np.empty((n, steps + 1)),
            np.empty((n, steps, 2)),
            np.zeros((n, 2)),
        )
        self._free = _Solver(steps, 0)
        self._apart: _Solver | None = None
        self._programs = _programs(n, steps, self._neighbours)
        self._known = np.zeros(n, dtype=bool)
        self._decided_at = 0.0
        self._multipliers = np.zeros((n, 4 * steps))

    def command(
        self,
        time: float,
        poses: Array,
        winds: Array,
        before: Array,
        held: Flags | None = None,
        moved: Array | None = None,
    ) -> Commands:
        """Return what the team does from `time` s on.

        `poses` (n, 3) and `winds` (n, 2) are estimates, `before` (n, 2) the commands so far, `held`
        (n,) says who does not steer, `moved` (n, 2) m where the circles are flown instead.
        """
        orbits, n = self._orbits, self._orbits.count
        held = np.zeros(n, dtype=bool) if held is None else held
        centers = orbits.centers if moved is None else orbits.centers + moved
        course = self._course._replace(winds=np.ascontiguousarray(winds))
        lay_course(centers, orbits.radii, orbits.turn_rates, orbits.phases, time, self._step, course)
        later = (time - self._decided_at) / self._step
        state = TeamState(
            np.ascontiguousarray(poses),
            np.clip(before, self._bounds.least, self._bounds.most),
            held,
            self._found.commands.copy(),
            self._known & (0.0 <= later),
            later,
        )
        guess_flights(
            state,
            course,
            self._laws,
            self._bounds,
            self._weights,
            self._seen,
            self._guesses,
            self._programs,
        )
        status, iterations = np.full(n, int(Status.HELD)), np.zeros(n, dtype=np.int64)
        shortfalls = np.zeros(n)
        for i in np.flatnonzero(~held):
            status[i], shortfalls[i], iterations[i] = self._decide(int(i), state, course)
        self._found.commands[held], self._found.poses[held] = 0.0, self._seen.poses[held]
        self._known, self._decided_at = ~held, time
        return Commands(
            self._found.commands[:, 0].copy(),
            status,
            self._found.commands.copy(),
            self._found.poses.copy(),
            shortfalls,
            iterations,
        )

    def _decide(self, i: int, state: TeamState, course: Course) -> tuple[int, float, int]:
        """Fill in the flight of vehicle i; return its status, m of shortfall and iterations."""
        steps = self._options.steps
        program = Program(*(part[i] for part in self._programs))
        change, solved, iterations = self._free.solve(program, self._multipliers[i])
        short = self._improve(i, change, state, course)
        if short > 0.0 and self._neighbours:
            if self._apart is None:
                self._apart = _Solver(steps, self._neighbours)
            write_separation(
                i,
                self._guesses.commands[i],
                self._guesses.poses[i],
                self._seen.poses,
                course,
                self._weights,
                self._apart.starts,
                self._neighbours,
                program,
            )
            program.rows[self._apart.fixed] = self._apart.entries
            change, solved, more = self._apart.solve(program, None)
            iterations += more
            short = self._improve(i, change, state, course)
        status = Status.REFUSED if not solved else Status.NEAR if short > 0.0 else Status.SOLVED
        return int(status), short, iterations

    def _improve(self, i: int, change: Array, state: TeamState, course: Course) -> float:
        return improve_flight(
            i,
            change,
            state.before[i],
            course,
            self._laws,
            self._bounds,
            self._weights,
            self._seen,
            self._guesses,
            self._found,
        )


class _Solver:
    """OSQP for programs of one pattern: N steps, and so many neighbours at each."""

    def __init__(self, steps: int, neighbours: int) -> None:
        from osqp import OSQP
        from scipy.sparse import block_diag, csc_matrix, eye_array, tril

        n, self.slack = 2 * steps, steps if neighbours else 0
        size = n + self.slack
        hessian = csc_matrix(np.triu(np.ones((n, n))))
        if self.slack:
            hessian = csc_matrix(block_diag([hessian, eye_array(self.slack)]))
        blocks = _pattern(steps, neighbours)
        rows = csc_matrix(blocks)
        rows.sort_indices()
        self.rows, self.size = rows.shape[0], size
        separating = rows.indices >= self.rows - steps * neighbours if neighbours else np.zeros(0)
        self.starts = np.zeros(size, dtype=np.int64)
        if neighbours:
            counts = np.add.reduceat(separating.astype(np.int64), rows.indptr[:-1])
            self.starts = rows.indptr[1:].astype(np.int64) - counts
        self.fixed = np.arange(len(rows.data))
        if neighbours:
            column = np.repeat(np.arange(size), np.diff(rows.indptr))
            self.fixed = np.flatnonzero(~separating | (column >= n))
        self.entries = rows.data[self.fixed].copy()
        self.start = np.zeros(size)
        self.solver: Any = OSQP()
        none = np.zeros(self.rows)
        self.solver.setup(hessian, np.zeros(size), rows, none - 1.0, none + 1.0, **SETTINGS)

    def solve(self, program: Program, multipliers: Array | None) -> tuple[Array, bool, int]:
        """Return the change (size,), whether it is solved, and iterations."""
        entries = len(self.start)
        count = (entries - self.slack) * (entries - self.slack + 1) // 2 + self.slack
        data = {"Px": program.hessian[:count]}
        if self.slack:
            data["Ax"] = program.rows
        self.solver.update(
            q=program.gradient[:entries],
            l=program.lower[: self.rows],
            u=program.upper[: self.rows],
            **data,
        )
        y = np.zeros(self.rows) if multipliers is None else multipliers
        self.solver.warm_start(self.start, y)
        found = self.solver.solve(raise_error=False)
        solved = found.info.status_val == SOLVED
        if multipliers is not None:
            multipliers[:] = found.y if solved else 0.0
        return (found.x if solved else self.start), solved, found.info.iter


def _pattern(steps: int, neighbours: int) -> Any:
    """A (rows, variables) of ones and minus ones: limits, changes, shortfalls, separation."""
    from scipy.sparse import block_diag, eye_array, hstack, kron, vstack

    n = 2 * steps
    changes = eye_array(steps) - eye_array(steps, k=-1)
    own = vstack([eye_array(n), block_diag([changes, changes])])
    if not neighbours:
        return own
    each = np.ones((neighbours, 1))
    late = kron(np.tril(np.ones((steps, steps))), each)
    limits = block_diag([own, eye_array(steps)])
    apart = hstack([late, late, kron(eye_array(steps), each)])
    return vstack([limits, apart])


def _laws(orbits: Orbits, limits: FlightLimits, step: float) -> Laws:
    """Gains, at most such that the heading is made good in two steps."""
    gains = tracking_gains(orbits, limits)
    heading = min(gains.heading, 0.8 / step)
    return Laws(step, 0.25 * heading, heading, 1.0 / step, gains.closing_speeds)


def _bounds(limits: FlightLimits, options: PredictiveOptions) -> Bounds:
    most = np.stack([limits.most_speeds, limits.most_turn_rates], axis=-1)
    least = np.stack([limits.least_speeds, -limits.most_turn_rates], axis=-1)
    return Bounds(least, most, options.change_share * (most - least))


def _weights(
    orbits: Orbits, limits: FlightLimits, options: PredictiveOptions, step: float
) -> Weights:
    return Weights(
        options.near_share * orbits.radii,
        options.heading,
        options.effort,
        options.shortfall,
        orbits.speeds,
        orbits.rate,
        limits.separation + options.margin if limits.separation > 0.0 else 0.0,
        step,
    )


def _foreseen(count: int, steps: int) -> Foreseen:
    return Foreseen(np.zeros((count, steps, 2)), np.zeros((count, steps + 1, 3)))


def _programs(count: int, steps: int, neighbours: int) -> Program:
    entries = steps * (2 * steps + 1) + steps
    rows = 4 * steps + (steps + steps * neighbours if neighbours else 0)
    nonzeros = 0
    if neighbours:
        nonzeros = 2 * steps + 2 * (2 * steps - 1) + steps
        nonzeros += neighbours * steps * (steps + 1) + neighbours * steps
    return Program(
        np.zeros((count, entries)),
        np.zeros((count, 3 * steps)),
        np.zeros((count, nonzeros)),
        np.zeros((count, rows)),
        np.full((count, rows), np.inf),
        np.ones((count, 1)),
    )
