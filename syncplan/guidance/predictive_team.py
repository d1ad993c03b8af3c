"""Programs of a team: first guesses of all flights, programs about them, and resulting flights.

Each vehicle assumes that the others fly by their last decisions. Programs therefore depend neither
on each other within a step nor on the order of vehicles.
"""

from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array, Flags
from syncplan.estimation.kernels import kernel, linked
from syncplan.guidance.predictive_model import (
    Bounds,
    Course,
    Laws,
    Predicted,
    foresee,
    keep_within,
    roll,
    shift,
)
from syncplan.guidance.predictive_program import Program, Weights, cost_of, write_program

SHARES = (1.0, 0.5, 0.25, 0.125)
"""Shares of the program's change to try; the first that improves the flight is taken."""


class Aim(NamedTuple):
    """Plan, laws, limits and weights by which flights of a team are predicted and judged."""

    course: Course
    laws: Laws
    bounds: Bounds
    weights: Weights


class TeamFlights(NamedTuple):
    """Predicted flights of a team.

    Fields
    ------
    seen : flights by the last decisions
    guesses : first guesses
    found : resulting flights
    """

    seen: Predicted
    guesses: Predicted
    found: Predicted


class TeamState(NamedTuple):
    """State of the team at a step.

    Fields
    ------
    poses : (n, 3) m, m, rad estimated
    before : (n, 2) commands of the step before, within limits
    held : (n,) which vehicles do not steer
    decided : (n, N, 2) commands of the last decision
    known : (n,) which vehicles have decided
    later : steps of the horizon since then
    """

    poses: Array
    before: Array
    held: Flags
    decided: Array
    known: Flags
    later: float


@linked
def _keep(commands: Array, poses: Array, kept: Predicted, i: int) -> None:
    """Copy a flight to that of vehicle i."""
    for k in range(len(commands)):
        for c in range(2):
            kept.commands[i, k, c] = commands[k, c]
    for k in range(len(poses)):
        _copy_pose(poses[k], kept.poses[i, k])


@linked
def _copy_pose(pose: Array, into: Array) -> None:
    for c in range(3):
        into[c] = pose[c]


@linked
def _foresee_decided(
    i: int, state: TeamState, course: Course, laws: Laws, bounds: Bounds, seen: Predicted
) -> None:
    """Fill in the flight of vehicle i by its last decision; a held vehicle stays where it is.

    It stays as in `truth`: at its least speed and, if that is not zero, in a circle.
    """
    commands, poses = seen.commands[i], seen.poses[i]
    _copy_pose(state.poses[i], poses[0])
    given = shift(state.decided[i], state.later, commands) if state.known[i] else 0
    foresee(i, given, False, state.before[i], course, laws, bounds, commands, poses)
    if state.held[i]:
        v = bounds.least[i, 0]
        w = bounds.most[i, 1] if v > 0.0 else 0.0
        for k in range(len(commands)):
            commands[k, 0], commands[k, 1] = v, w
            roll(poses[k], poses[k + 1], v, w, laws.step, course.winds[i])


@kernel
def guess_flights(state: TeamState, flights: TeamFlights, aim: Aim, programs: Program) -> None:
    """Fill in flights by the last decisions, the best first guess of each, and its program."""
    (seen, guesses, _), (course, laws, bounds, weights) = flights, aim
    n = len(state.poses)
    for i in range(n):
        _foresee_decided(i, state, course, laws, bounds, seen)
    commands, poses = np.empty_like(seen.commands[0]), np.empty_like(seen.poses[0])
    for i in range(n):
        _keep(seen.commands[i], seen.poses[i], guesses, i)
        if state.held[i]:
            continue
        least, _ = cost_of(i, seen.commands[i], seen.poses[i], seen.poses, course, weights)
        for law in range(2):
            _copy_pose(state.poses[i], poses[0])
            foresee(i, 0, law == 1, state.before[i], course, laws, bounds, commands, poses)
            cost, _ = cost_of(i, commands, poses, seen.poses, course, weights)
            if cost < least:
                least = cost
                _keep(commands, poses, guesses, i)
        own = Program(
            programs.hessian[i],
            programs.gradient[i],
            programs.rows[i],
            programs.lower[i],
            programs.upper[i],
            programs.scale[i],
        )
        write_program(
            i, guesses.commands[i], guesses.poses[i], state.before[i], course, weights, bounds, own
        )


@kernel
def improve_flight(i: int, change: Array, before: Array, flights: TeamFlights, aim: Aim) -> float:
    """Fill in the flight of vehicle i, its guess improved by a share of `change`.

    `change` (2N,) is in units of the plan's speed and rate. Returns the separation in m that the
    flight lacks. The flight is exact and within limits; it is the guess if no share improves that.
    """
    (seen, guesses, found), (course, laws, bounds, weights) = flights, aim
    guess, steps = guesses.commands[i], guesses.commands.shape[1]
    least, short = cost_of(i, guess, guesses.poses[i], seen.poses, course, weights)
    _keep(guess, guesses.poses[i], found, i)
    commands, poses = np.empty_like(guess), guesses.poses[i].copy()
    for share in SHARES:
        for k in range(steps):
            v = guess[k, 0] + share * weights.speeds[i] * change[k]
            w = guess[k, 1] + share * weights.rate * change[steps + k]
            v, w = keep_within(v, w, before if k == 0 else commands[k - 1], i, bounds)
            commands[k, 0], commands[k, 1] = v, w
            roll(poses[k], poses[k + 1], v, w, laws.step, course.winds[i])
        cost, lack = cost_of(i, commands, poses, seen.poses, course, weights)
        if cost < least:
            least, short = cost, lack
            _keep(commands, poses, found, i)
            break
    return short
