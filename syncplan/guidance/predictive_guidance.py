"""Guidance `mpc`: a quadratic program for each vehicle plans at least a third of a turn ahead.

Every `interval` seconds, from estimates:

    guess     the last decision, the tracking law, or an interception: whichever costs least
    program   change of the guess, with limits and changes of commands as constraints
    solve     by OSQP; again with separation if the resulting flight is too near others
    choose    the largest share of the change that makes the exact flight cost less

Flights are always within limits. A program that OSQP does not solve is refused: the vehicle flies
its guess. A held vehicle is assumed to stay where it is.

The horizon has 20 steps of 0.1 rad of a turn, or of the interval where that is longer: at least
10 s and 2 rad, a third of a turn. At 0.8 rad/s it is 1.27 turns. In that time a vehicle with
default limits turns round and crosses its circle, so it can reach its place from half a period off.
Errors count in shares of the radius, commands in shares of the plan's speed and rate: nothing is in
metres. Errors are of places, not of phases: along and across the circle count alike, which leaves
no singular point inside it, and a vehicle in place is in phase.

All programs of a team have one pattern, so one workspace serves all. It keeps nothing from one
program to the next: data are scaled beforehand, the penalty rho is fixed, and each program starts
at its guess (no change) with its own multipliers. There is no time limit. A solution therefore
depends on its program alone, to the byte, under any load. OSQP lets other threads run while it
solves; a solver serves one thread at a time.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from syncplan.arrays import Array, Flags, Index, short_repr
from syncplan.guidance.flight_setup import Circles, FlightLimits
from syncplan.guidance.predictive_model import SEARCHED, Bounds, Course, Laws, Predicted, lay_course
from syncplan.guidance.predictive_program import Program, Weights, write_separation
from syncplan.guidance.predictive_team import (
    Aim,
    TeamFlights,
    TeamState,
    guess_flights,
    improve_flight,
)
from syncplan.guidance.reference_tracking import tracking_gains
from syncplan.orbits.circles import Orbits

# --- OSQP -----------------------------------------------------------------------------------------


SETTINGS = {
    "adaptive_rho": 0,
    "alpha": 1.6,
    "check_termination": 10,
    "eps_abs": 1e-3,
    "eps_rel": 1e-3,
    "max_iter": 1000,
    "polishing": False,
    "scaling": 0,
    "verbose": False,
}
"""Settings of OSQP. Tolerances are in units of the plan's speed and rate; flights are exact."""

RHO, RHO_APART = 0.3, 1.0
"""OSQP's penalty without and with separation, for programs whose diagonal of P is 1 on average.

Of values from 0.1 to 10, these take the fewest iterations in returns from holds under five sets of
limits.
"""

SOLVED = 1
"""OSQP's status of a program solved to the tolerances."""


class Solution(NamedTuple):
    """Solution of a program.

    Fields
    ------
    change : (2N,) of commands in units of the plan's speed and rate; zero where not solved
    multipliers : (4N,) of limits and changes; zero where not solved
    solved : whether OSQP reports so
    iterations : of OSQP
    """

    change: Array
    multipliers: Array
    solved: bool
    iterations: int


class ProgramSolver:
    """Solver of programs of N steps, with separation from `neighbours` others at each, or none."""

    def __init__(self, steps: int, neighbours: int = 0, shortfall: float = 1.0) -> None:
        from osqp import OSQP
        from scipy.sparse import block_diag, csc_array, csc_matrix, eye_array

        own, shortfalls = 2 * steps, steps if neighbours else 0
        hessian = csc_array(np.triu(np.ones((own, own))))
        if shortfalls:
            hessian = block_diag([hessian, eye_array(shortfalls)])
        rows = csc_matrix(_rows(steps, neighbours, shortfall))
        rows.sort_indices()
        self.pattern: Any = rows
        self._own, self._size, self._count = own, own + shortfalls, rows.shape[0]
        separating = rows.indices >= self._count - steps * neighbours
        column = np.repeat(np.arange(self._size), np.diff(rows.indptr))
        self._constant = np.flatnonzero(~separating | (column >= own))
        self._entries = rows.data[self._constant].copy()
        counts = np.bincount(column[separating], minlength=self._size)
        self.starts: Index = rows.indptr[1:].astype(np.int64) - counts
        nothing, settings = np.zeros(self._count), {**SETTINGS, "rho": RHO}
        if neighbours:
            settings["rho"] = RHO_APART
        self._solver: Any = OSQP()
        self._solver.setup(
            csc_matrix(hessian),
            np.zeros(self._size),
            rows,
            nothing - 1.0,
            nothing + 1.0,
            **settings,
        )

    def solve(self, program: Program, multipliers: Array) -> Solution:
        """Return the solution of a program, from no change and `multipliers` (4N,)."""
        own, size, y = self._own, self._size, np.zeros(self._count)
        y[: 2 * own] = multipliers
        data = {"Px": program.hessian[: own * (own + 1) // 2 + size - own]}
        if size > own:  # shortfalls start at zero, and their multipliers at their cost
            y[2 * own : 2 * own + size - own] = -program.gradient[own:size]
            program.rows[self._constant] = self._entries
            data["Ax"] = program.rows
        self._solver.update(
            q=program.gradient[:size],
            l=program.lower[: self._count],
            u=program.upper[: self._count],
            **data,
        )
        self._solver.warm_start(np.zeros(size), y)
        found = self._solver.solve(raise_error=False)
        if found.info.status_val != SOLVED:
            return Solution(np.zeros(own), np.zeros(2 * own), False, found.info.iter)
        return Solution(found.x[:own], found.y[: 2 * own], True, found.info.iter)


def _rows(steps: int, neighbours: int, shortfall: float) -> Any:
    """Matrix A (rows, variables): limits, changes, and with separation shortfalls and distances."""
    from scipy.sparse import block_diag, eye_array, hstack, kron, vstack

    own = 2 * steps
    changes = eye_array(steps) - eye_array(steps, k=-1)
    limits = vstack([eye_array(own), block_diag([changes, changes])])
    if not neighbours:
        return limits
    each = np.ones((neighbours, 1))
    before = kron(np.tril(np.ones((steps, steps))), each)
    lacks = kron(eye_array(steps), each) / np.sqrt(shortfall)
    return vstack([block_diag([limits, eye_array(steps)]), hstack([before, before, lacks])])


STEP_ANGLE = 0.1
"""Least angle of turn in rad of a step of the horizon."""

MOST_GAIN = 0.8
"""Largest share of a heading error that the laws of first guesses correct in a step."""

GUARD = 0.005
"""Separation asked beyond the limit, as a share of `Weights.near`: five tolerances of OSQP."""


class Status(IntEnum):
    """Outcome of a vehicle's program."""

    SOLVED = 0
    NEAR = 1
    """Solved, but the flight comes nearer to another's predicted flight than asked."""
    REFUSED = 2
    """Not solved: the vehicle flies its first guess."""
    HELD = 3
    """The vehicle does not steer."""


@dataclass(frozen=True, slots=True)
class PredictiveOptions:
    """Options of guidance `mpc`.

    Attributes
    ----------
    interval : s between decisions
    steps : number of steps of the horizon
    margin : m added to the separation asked, for the uncertainty of estimates
    neighbours : number of nearest vehicles to keep away from at each step
    change_share : share of its range by which a command may change in a step
    near_share : share of the radius beyond which errors count by the logarithm of their size
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
class Decision:
    """Commands of a team until the next decision.

    Attributes
    ----------
    commands : (n, 2) speed through the air in m/s, turn rate in rad/s
    status : (n,) of Status
    flights : (n, N, 2) commands of the whole horizon
    poses : (n, N + 1, 3) m, m, rad, resulting poses in the estimated wind
    shortfalls : (n,) m, separation that a flight lacks from the predicted flights of others
    iterations : (n,) of OSQP
    """

    commands: Array
    status: Index
    flights: Array
    poses: Array
    shortfalls: Array
    iterations: Index

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, repr=False)
class Memory:
    """State of guidance from one decision to the next.

    Attributes
    ----------
    time : s, of the last decision
    known : (n,) which vehicles decided then
    flights : (n, N, 2) commands
    multipliers : (n, 4N) of the programs
    """

    time: float
    known: Flags
    flights: Array
    multipliers: Array

    __repr__ = short_repr


class PredictiveGuidance:
    """Guidance `mpc` of one team in one flight, for one thread at a time."""

    def __init__(
        self, orbits: Orbits, limits: FlightLimits, options: PredictiveOptions | None = None
    ) -> None:
        chosen = options or PredictiveOptions()
        n, steps = orbits.count, chosen.steps
        self._circles = Circles.of(orbits)
        self._step = max(chosen.interval, STEP_ANGLE / orbits.rate)
        places, headings = np.empty((n, SEARCHED * steps + 1, 2)), np.empty((n, steps + 1))
        self._aim = Aim(
            Course(places, headings, np.empty((n, steps, 2)), np.empty((n, 2))),
            _laws(orbits, limits, self._step),
            _bounds(limits, chosen),
            _weights(orbits, limits, chosen, self._step),
        )
        self._neighbours = min(chosen.neighbours, n - 1)
        self._flights = TeamFlights(*(_foreseen(n, steps) for _ in range(3)))
        self._programs = _programs(n, steps, self._neighbours)
        self._free, self._apart = ProgramSolver(steps), None
        if self._neighbours > 0 and limits.separation > 0.0:
            self._apart = ProgramSolver(steps, self._neighbours, chosen.shortfall)
        nobody = np.zeros(n, dtype=np.bool_)
        self.memory = Memory(0.0, nobody, np.zeros((n, steps, 2)), np.zeros((n, 4 * steps)))

    def decide(
        self,
        time: float,
        poses: Array,
        winds: Array,
        before: Array,
        held: Flags | None = None,
        moved: Array | None = None,
    ) -> Decision:
        """Return the team's commands from `time` s on.

        `poses` (n, 3) m, m, rad and `winds` (n, 2) m/s are estimates, `before` (n, 2) are the last
        commands, `held` (n,) marks vehicles that do not steer, and `moved` (n, 2) m is the shift of
        each circle from its place.
        """
        n, circles, aim = len(poses), self._circles, self._aim
        held = np.zeros(n, dtype=np.bool_) if held is None else held
        if moved is not None:
            circles = circles._replace(centers=circles.centers + moved)
        state = self._state(time, poses, before, held)
        aim.course.winds[:] = winds
        lay_course(circles, time, self._step, aim.course)
        guess_flights(state, self._flights, aim, self._programs)
        _, guesses, found = self._flights
        found.commands[:], found.poses[:] = guesses.commands, guesses.poses
        status, iterations = np.full(n, int(Status.HELD)), np.zeros(n, dtype=np.int64)
        shortfalls, multipliers = np.zeros(n), np.zeros_like(self.memory.multipliers)
        for i in np.flatnonzero(~held).tolist():
            solution, shortfalls[i], iterations[i] = self._solve(i, state)
            multipliers[i] = solution.multipliers
            status[i] = Status.NEAR if shortfalls[i] > 0.0 else Status.SOLVED
            if not solution.solved:
                status[i] = Status.REFUSED
        self.memory = Memory(time, ~held, found.commands.copy(), multipliers)
        return Decision(
            found.commands[:, 0].copy(),
            status,
            self.memory.flights,
            found.poses.copy(),
            shortfalls,
            iterations,
        )

    def _state(self, time: float, poses: Array, before: Array, held: Flags) -> TeamState:
        """Present state of the team; the last decision counts only if it is not in the future."""
        last, (least, most, _) = self.memory, self._aim.bounds
        known = last.known & (last.time <= time)
        steps = (time - last.time) / self._step
        within = np.clip(before, least, most)
        estimates = np.ascontiguousarray(poses)
        return TeamState(estimates, within, held, last.flights, known, steps)

    def _solve(self, i: int, state: TeamState) -> tuple[Solution, float, int]:
        """Fill in the flight of vehicle i; return solution, shortfall in m and iterations."""
        program = Program(*(part[i] for part in self._programs))
        (seen, guesses, _), weights = self._flights, self._aim.weights
        solution = self._free.solve(program, self.memory.multipliers[i])
        short = self._improve(i, solution.change, state)
        if self._apart is None or short <= 0.0:
            return solution, 0.0, solution.iterations
        write_separation(
            i,
            guesses.commands[i],
            guesses.poses[i],
            seen.poses,
            weights,
            self._apart.starts,
            self._neighbours,
            program,
        )
        apart = self._apart.solve(program, solution.multipliers)
        short = max(self._improve(i, apart.change, state) - GUARD * weights.near[i], 0.0)
        iterations = solution.iterations + apart.iterations
        return apart._replace(multipliers=solution.multipliers), short, iterations

    def _improve(self, i: int, change: Array, state: TeamState) -> float:
        """Fill in the flight of vehicle i by a share of a change; return its shortfall in m."""
        return improve_flight(i, change, state.before[i], self._flights, self._aim)


def _laws(orbits: Orbits, limits: FlightLimits, step: float) -> Laws:
    """Gains of `track`, reduced where steps are too long for them."""
    gains = tracking_gains(orbits, limits)
    heading = min(gains.heading, MOST_GAIN / step)
    return Laws(step, 0.25 * heading, heading, 1.0 / step, gains.closing_speeds)


def _bounds(limits: FlightLimits, options: PredictiveOptions) -> Bounds:
    most = np.stack([limits.most_speeds, limits.most_turn_rates], axis=-1)
    least = np.stack([limits.least_speeds, -limits.most_turn_rates], axis=-1)
    return Bounds(least, most, options.change_share * (most - least))


def _weights(
    orbits: Orbits, limits: FlightLimits, options: PredictiveOptions, step: float
) -> Weights:
    near = options.near_share * orbits.radii
    asked = limits.separation + options.margin + GUARD * near
    return Weights(
        near=near,
        heading=options.heading,
        effort=options.effort,
        shortfall=options.shortfall,
        speeds=orbits.speeds,
        rate=orbits.rate,
        separations=asked if limits.separation > 0.0 else np.zeros(orbits.count),
        step=step,
    )


def _foreseen(count: int, steps: int) -> Predicted:
    return Predicted(np.zeros((count, steps, 2)), np.zeros((count, steps + 1, 3)))


def _programs(count: int, steps: int, neighbours: int) -> Program:
    """Arrays for the programs of a team; without separation only their first parts are used."""
    apart = steps * neighbours
    entries = 2 * steps + 2 * (2 * steps - 1) + steps + apart * (steps + 1) + apart
    rows = 5 * steps + apart
    return Program(
        hessian=np.zeros((count, steps * (2 * steps + 1) + steps)),
        gradient=np.zeros((count, 3 * steps)),
        rows=np.zeros((count, entries)),
        lower=np.zeros((count, rows)),
        upper=np.full((count, rows), np.inf),
        scale=np.ones((count, 1)),
    )
