"""The quadratic program of one vehicle against finite differences of exact flights."""

from typing import NamedTuple

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.guidance.flight_setup import Circles
from syncplan.guidance.predictive_guidance import ProgramSolver
from syncplan.guidance.predictive_model import Bounds, Course, lay_course, roll
from syncplan.guidance.predictive_program import (
    Program,
    Weights,
    cost_of,
    write_program,
    write_separation,
)
from tests.tools.inner_kernels import called_alone

STEPS, STEP, NEIGHBOURS = 6, 0.5, 2
UNITS = np.repeat([4.0, 0.2], STEPS)
SMALL = 1e-5

roll_alone = called_alone(roll)


class Scene(NamedTuple):
    """One vehicle of three on a flight that is none of its plan's, in wind."""

    commands: Array
    poses: Array
    course: Course
    weights: Weights


def _flown(commands: Array, start: Array, wind: Array) -> Array:
    poses = np.tile(start, (len(commands) + 1, 1))
    for k, (v, w) in enumerate(commands):
        roll_alone(poses[k], poses[k + 1], v, w, STEP, wind)
    return poses


def _drawn(seed: int, separation: float = 0.0) -> Scene:
    generator = np.random.default_rng(seed)
    winds = np.tile(generator.normal(size=2), (3, 1))
    course = Course(
        np.empty((3, 2 * STEPS + 1, 2)), np.empty((3, STEPS + 1)), np.empty((3, STEPS, 2)), winds
    )
    centers = np.array([[0.0, 0.0], [30.0, 0.0], [0.0, 35.0]])
    senses, phases = np.array([1.0, -1.0, 1.0]), generator.uniform(0.0, 6.0, 3)
    lay_course(Circles(centers, np.full(3, 20.0), senses, phases, 0.2), 1.7, STEP, course)
    commands = np.column_stack([generator.uniform(1.0, 7.0, STEPS), generator.normal(size=STEPS)])
    commands[0, 1] = 0.0  # straight on, where slopes are those of a series
    start = np.array([*(course.places[0, 0] + generator.normal(size=2) * 8.0), 1.0])
    poses = np.stack([_flown(commands, start, winds[0]), *np.zeros((2, STEPS + 1, 3))])
    poses[1:, :, :2] = course.places[1:, : STEPS + 1]
    weights = Weights(
        near=np.full(3, 4.0),
        heading=1.0,
        effort=0.1,
        shortfall=100.0,
        speeds=np.full(3, 4.0),
        rate=0.2,
        separations=np.full(3, separation),
        step=STEP,
    )
    return Scene(commands, poses, course, weights)


def _room() -> Program:
    apart = STEPS * NEIGHBOURS
    entries = 7 * STEPS - 2 + apart * (STEPS + 2)
    rows = 5 * STEPS + apart
    return Program(
        np.zeros(STEPS * (2 * STEPS + 1) + STEPS),
        np.zeros(3 * STEPS),
        np.zeros(entries),
        np.zeros(rows),
        np.zeros(rows),
        np.ones(1),
    )


def _written(scene: Scene) -> Program:
    limits = np.tile([0.0, -0.8], (3, 1)), np.tile([8.0, 0.8], (3, 1)), np.tile([4.0, 0.8], (3, 1))
    program = _room()
    write_program(
        0,
        scene.commands,
        scene.poses[0],
        np.array([4.0, 0.2]),
        scene.course,
        scene.weights,
        Bounds(*limits),
        program,
    )
    return program


def _changed(scene: Scene, change: Array) -> tuple[Array, Array]:
    """Commands and the flight, changed by (2N,) in units of the plan's speed and rate."""
    commands = scene.commands + (UNITS * change).reshape(2, STEPS).T
    return commands, _flown(commands, scene.poses[0, 0], scene.course.winds[0])


def _cost(scene: Scene, change: Array) -> float:
    commands, own = _changed(scene, change)
    return cost_of(0, commands, own, scene.poses, scene.course, scene.weights)[0]


def _slopes(scene: Scene) -> Array:
    """(2N, N + 1, 3) by how much poses change with each command."""
    ways = SMALL * np.eye(2 * STEPS)
    ends = [(_changed(scene, way)[1], _changed(scene, -way)[1]) for way in ways]
    return np.array([(a - b) / (2.0 * SMALL) for a, b in ends])


@pytest.mark.parametrize("seed", range(3))
def test_the_gradient_is_that_of_the_exact_flight(seed: int) -> None:
    scene = _drawn(seed)
    program = _written(scene)
    ways = SMALL * np.eye(2 * STEPS)
    slopes = [(_cost(scene, way) - _cost(scene, -way)) / (2.0 * SMALL) for way in ways]
    found = program.gradient[: 2 * STEPS] / program.scale[0]
    np.testing.assert_allclose(found, slopes, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("seed", range(3))
def test_the_hessian_is_that_of_linearised_places_with_their_weights(seed: int) -> None:
    scene = _drawn(seed)
    program, slopes = _written(scene), _slopes(scene)
    off = scene.poses[0, 1:, :2] - scene.course.places[0, 1 : STEPS + 1]
    weights = 1.0 / (16.0 + np.sum(off**2, axis=1))
    expected = np.einsum("imd,jmd,m->ij", slopes[:, 1:, :2], slopes[:, 1:, :2], weights)
    turned = scene.poses[0, -1, 2] - scene.course.headings[0, -1]
    bent = max(np.cos(turned), 0.0)
    expected += bent * np.outer(slopes[:, -1, 2], slopes[:, -1, 2]) + 0.1 * np.eye(2 * STEPS)
    found = np.zeros((2 * STEPS, 2 * STEPS))
    found.T[np.tril_indices(2 * STEPS)] = program.hessian[: STEPS * (2 * STEPS + 1)]
    np.testing.assert_allclose(found / program.scale[0], np.triu(expected), rtol=1e-5, atol=1e-7)
    assert np.trace(found) == pytest.approx(2 * STEPS)


@pytest.mark.parametrize("seed", range(3))
def test_rows_of_separation_are_slopes_of_the_distance(seed: int) -> None:
    from scipy.sparse import csc_array

    scene = _drawn(seed, separation=40.0)
    program, solver = _written(scene), ProgramSolver(STEPS, NEIGHBOURS, 100.0)
    write_separation(
        0,
        scene.commands,
        scene.poses[0],
        scene.poses,
        scene.weights,
        solver.starts,
        NEIGHBOURS,
        program,
    )
    matrix = csc_array(solver.pattern)
    matrix.data[:] = program.rows
    rows = matrix.toarray()[5 * STEPS :, : 2 * STEPS].reshape(STEPS, NEIGHBOURS, -1)
    lower = program.lower[5 * STEPS :].reshape(STEPS, NEIGHBOURS)
    for m, slope in enumerate(np.moveaxis(_slopes(scene)[:, 1:, :2], 0, -1), start=1):
        apart = scene.poses[0, m, :2] - scene.poses[1:, m, :2]
        distances = np.hypot(*apart.T)
        away = apart / distances[:, None]
        moved = scene.poses[0, m, :2] - scene.poses[0, m - 1, :2]
        closing = moved - (scene.poses[1:, m, :2] - scene.poses[1:, m - 1, :2])
        asked = np.sqrt(40.0**2 + 0.25 * np.sum(closing**2, axis=1))
        order = np.argsort(distances - asked)
        np.testing.assert_allclose(rows[m - 1], (away @ slope / 4.0)[order], atol=1e-7)
        np.testing.assert_allclose(lower[m - 1], ((asked - distances) / 4.0)[order])
