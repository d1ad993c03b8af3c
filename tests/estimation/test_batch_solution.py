"""The batch solution against dense least squares in NumPy, differentiated by differences."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from syncplan.arrays import Array, Flags
from syncplan.estimation.augmented_frame import CLOCK
from syncplan.estimation.augmented_setup import AugmentedSetup
from syncplan.estimation.batch_linearisation import linear_pass
from syncplan.estimation.batch_problem import FAR, Prior, Trajectory, Window, trajectory_cost
from syncplan.estimation.batch_smoother import smooth
from syncplan.estimation.batch_solution import (
    THINNING,
    BatchSolution,
    _Problem,
    _thinned,
    solve,
)
from syncplan.estimation.filter_setup import DISTANCE_KIND
from syncplan.estimation.reference_states import moved_state, sighted
from syncplan.estimation.start_search import is_credible
from syncplan.orbits.circles import wrap
from syncplan.orbits.error_states import ERROR_STATES
from tests.estimation.test_further_states import Scene, a_team, scene_of

ALL = tuple(ERROR_STATES)
BUT_CLOCKS = tuple(name for name in ALL if name != "clock_offset")
BEGIN, SAMPLES = 5, 12


class Case(NamedTuple):
    """A window of a set-up, with two lanes, and a trajectory in it that is not the best."""

    setup: AugmentedSetup
    window: Window
    prior: Prior
    path: Trajectory


def scene(estimated: tuple[str, ...], **changes: object) -> Scene:
    """Two trials of three vehicles; gusts pass within a few samples."""
    team = a_team(estimated)
    team = replace(team, errors=replace(team.errors, gust_time=0.25))
    return scene_of(team, BEGIN + SAMPLES, 2, **changes)


def case_of(given: Scene, temper: tuple[float, float] = (1.0, 7.0)) -> Case:
    """The window from BEGIN on, a prior about some state and a trajectory off it.

    Rows by clock offsets are exact about offsets of 0 alone, so the trajectory has none.
    """
    setup, readings = given
    random, n, e = np.random.default_rng(4), 3, len(setup.variances)
    poses, changing = setup.poses, slice(setup.first_changing - 3 * n, None)
    gained = setup.variances[changing] * (1.0 - setup.decays[changing] ** 2)
    variances = np.concatenate([poses.initial_variances.ravel(), setup.variances])
    off = np.sqrt(variances)[:, None] * random.normal(size=(2, 3 * n + e, 2))
    about = poses.truth[BEGIN].reshape(-1, 1) + off[0, : 3 * n]
    prior = Prior(about.reshape(n, 3, 2), off[0, 3 * n :], variances)
    speed, turn = np.sqrt([poses.motion.speed_variance, poses.motion.turn_rate_variance])
    path = Trajectory(
        poses=prior.poses + off[1, : 3 * n].reshape(n, 3, 2),
        errors=prior.errors + off[1, 3 * n :],
        speeds=speed * random.normal(size=(SAMPLES, n, 2)),
        turn_rates=turn * random.normal(size=(SAMPLES, n, 2)),
        changes=np.sqrt(gained)[:, None] * random.normal(size=(SAMPLES, len(gained), 2)),
    )
    clocks = setup.columns[:, CLOCK]
    path.errors[clocks[clocks >= 0] - 3 * n] = 0.0
    window = Window(
        BEGIN,
        readings.speeds[BEGIN:],
        readings.turn_rates[BEGIN:],
        readings.sightings[poses.first[BEGIN + 1] :],
        np.array(temper),
    )
    return Case(setup, window, prior, path)


def unequal(given: Scene) -> Scene:
    """The same with steps of unequal length."""
    setup, readings = given
    spans = np.random.default_rng(5).uniform(0.02, 0.4, len(setup.poses.spans))
    return Scene(setup._replace(poses=setup.poses._replace(spans=spans)), readings)


def certain(given: Scene) -> Scene:
    """The same with places known at the start, and readings without noise."""
    setup, readings = given
    motion = setup.poses.motion._replace(speed_variance=0.0, turn_rate_variance=0.0)
    starts = setup.poses.initial_variances * [0.0, 0.0, 1.0]
    poses = setup.poses._replace(motion=motion, initial_variances=starts)
    return Scene(setup._replace(poses=poses), readings)


CASES = {
    "poses alone": lambda: scene(()),
    "wind": lambda: scene(("wind",)),
    "bearing bias": lambda: scene(("bearing_bias",)),
    "gusts": lambda: scene(("gusts",)),
    "bearing walk": lambda: scene(("bearing_walk",)),
    "all states": lambda: scene(ALL),
    "all but clocks": lambda: scene(BUT_CLOCKS),
    "with a gate": lambda: scene(ALL, gate_probability=0.9),
    "steps of unequal length": lambda: unequal(scene(ALL)),
    "steps of unequal length, no clocks": lambda: unequal(scene(BUT_CLOCKS)),
    "a start and readings without noise": lambda: certain(scene(ALL)),
    "paper's sub-steps": lambda: scene(("speed_scale", "turn_rate_bias"), filter="paper"),
}


def stacked(path: Trajectory, lane: int) -> Array:
    """All that a trajectory follows from, of one lane."""
    return np.concatenate([one[..., lane].ravel() for one in path])


def variances_of(case: Case) -> Array:
    """The prior variance of each of these; 0 where it is known."""
    setup, n = case.setup, len(case.setup.columns)
    motion = setup.poses.motion
    shares = motion.time / setup.poses.spans[BEGIN:]
    changing = slice(setup.first_changing - 3 * n, None)
    lasting = setup.decays[changing] ** (2.0 / shares[:, None])
    return np.concatenate(
        [
            case.prior.variances,
            np.repeat(motion.speed_variance * shares, n),
            np.repeat(motion.turn_rate_variance * shares, n),
            (setup.variances[changing] * (1.0 - lasting)).ravel(),
        ]
    )


def rolled_out(case: Case, lane: int, flat: Array) -> tuple[Array, Array]:
    """Innovations of the window's sightings over their sigmas, and the state at its end."""
    setup, window = case.setup, case.window
    n, e, g = len(setup.columns), len(setup.variances), case.path.changes.shape[1]
    sizes = [3 * n + e, SAMPLES * n, SAMPLES * n]
    state, speeds, turns, gains = np.split(flat, np.cumsum(sizes))
    speeds, turns, gains = (one.reshape(SAMPLES, -1) for one in (speeds, turns, gains))
    innovations, first = [], setup.poses.first
    for k in range(SAMPLES):
        span = float(setup.poses.spans[BEGIN + k])
        motion = setup.poses.motion._replace(time=span)
        step = setup._replace(
            poses=setup.poses._replace(motion=motion),
            decays=setup.decays ** (span / setup.poses.motion.time),
        )
        read, turned = window.speeds[k, :, lane], window.turn_rates[k, :, lane]
        state = moved_state(state, read + speeds[k], turned + turns[k], step)
        state[len(state) - g :] += gains[k]
        for s in range(first[BEGIN + k + 1], first[BEGIN + k + 2]):
            kind, o, t = (
                int(one[s])
                for one in (setup.poses.kinds, setup.poses.observers, setup.poses.targets)
            )
            made = read + speeds[k], turned + turns[k]
            expected = sighted(state, kind, o, t, setup, made)[0]
            nu = window.sightings[s - first[BEGIN + 1], lane] - expected
            nu = nu if kind == DISTANCE_KIND else float(wrap(nu))
            innovations.append(nu / np.sqrt(setup.poses.variances[s] * window.temper[lane]))
    return np.array(innovations), state


class Dense(NamedTuple):
    """A least-squares problem about a trajectory: rows of what is known, whitened.

    Fields
    ------
    residuals, rows : (r,), (r, p); of the p numbers that are not known exactly
    free : (all,) which these are
    ends : (3n + e, p) derivative of the end by them
    end : (3n + e,) the end
    constant : what sightings cost beyond that
    """

    residuals: Array
    rows: Array
    free: Flags
    ends: Array
    end: Array
    constant: float

    @property
    def step(self) -> Array:
        """(p,) the best step if all were linear."""
        return np.asarray(np.linalg.lstsq(self.rows, -self.residuals, rcond=None)[0])


def counted(case: Case, lane: int, innovations: Array) -> tuple[Array, Array]:
    """What each sighting costs, and the weight of its row; 0 where it is missed or beyond the gate.

    With a gate, a tempered sighting beyond FAR has the slope of one at FAR.
    """
    gate, made = case.setup.poses.gate, ~np.isnan(innovations)
    squares = np.where(made, innovations**2, 0.0)
    if np.isinf(gate) or case.window.temper[lane] == 1.0:
        return np.minimum(squares, gate), np.asarray(made & (squares <= gate), dtype=float)
    far = np.maximum(np.sqrt(squares), FAR)
    return np.where(far > FAR, 2.0 * FAR * far - FAR**2, squares), made * np.sqrt(FAR / far)


def dense(case: Case, lane: int, path: Trajectory) -> Dense:
    """The problem about a trajectory."""
    flat, variances = stacked(path, lane), variances_of(case)
    prior = np.concatenate([case.prior.poses[..., lane].ravel(), case.prior.errors[:, lane]])
    known = np.concatenate([prior, np.zeros(len(flat) - len(prior))])
    free = variances > 0.0
    scale = np.sqrt(variances[free])
    innovations, end = rolled_out(case, lane, flat)
    costs, weights = counted(case, lane, innovations)
    made = weights > 0.0
    weights = weights[made]
    slopes, ends = [], []
    for place, size in zip(np.flatnonzero(free), scale, strict=True):
        moved = np.zeros(len(flat))
        moved[place] = 1e-4 * size
        above, below = (rolled_out(case, lane, flat + one) for one in (moved, -moved))
        slopes.append(weights * (above[0] - below[0])[made] / (2e-4 * size))
        ends.append((above[1] - below[1]) / (2e-4 * size))
    return Dense(
        residuals=np.concatenate([(flat - known)[free] / scale, weights * innovations[made]]),
        rows=np.concatenate([np.diag(1.0 / scale), np.array(slopes).T]),
        free=free,
        ends=np.array(ends).T,
        end=end,
        constant=float(np.sum(costs) - np.sum((weights * innovations[made]) ** 2)),
    )


@pytest.mark.parametrize("name", CASES)
def test_a_step_is_that_of_dense_least_squares(name: str) -> None:
    case = case_of(CASES[name]())
    problem = _Problem.of(case.setup, case.window, case.prior, SAMPLES)
    x, errors, P = linear_pass(*case, problem.found, problem.lanes)
    smooth(case.setup, case.window, case.prior, problem.found, problem.best, problem.lanes)
    assert ("gusts" in name or "all" in name) <= (problem.found.ended.sum() >= 2)
    for lane in (0, 1) if name in ("all states", "with a gate") else (1,):
        plain = dense(case, lane, case.path)
        assert (plain.constant > 1.0) == (name == "with a gate")
        step, flat = plain.step, stacked(case.path, lane)
        best = stacked(problem.best, lane)
        spread = np.linalg.inv(plain.rows.T @ plain.rows)
        sigmas = np.sqrt(np.diag(spread))
        np.testing.assert_allclose((best - flat)[plain.free] / sigmas, step / sigmas, atol=2e-5)
        end = np.concatenate([x[..., lane].ravel(), errors[:, lane]])
        covariance = plain.ends @ spread @ plain.ends.T
        expected = plain.end + plain.ends @ step
        ending = np.sqrt(np.diag(covariance))
        np.testing.assert_allclose((end - expected) / ending, 0.0, atol=2e-5)
        lower = np.tril_indices(len(end))
        scales = np.outer(ending, ending)[lower]
        np.testing.assert_allclose(
            P[..., lane][lower] / scales, covariance[lower] / scales, atol=1e-6
        )
        cost = plain.residuals @ plain.residuals + plain.constant
        after = plain.residuals + plain.rows @ step
        np.testing.assert_allclose(problem.found.cost[lane], cost, rtol=1e-9)
        np.testing.assert_allclose(
            problem.found.linear_cost[lane], after @ after + plain.constant, rtol=1e-6
        )


@pytest.mark.parametrize("name", CASES)
def test_the_cost_of_a_trajectory_is_a_plain_sum(name: str) -> None:
    case = case_of(CASES[name]())
    found = trajectory_cost(*case, np.zeros(2, dtype=np.int8))
    assert np.isnan(case.window.sightings).any()
    for lane in range(2):
        innovations, _ = rolled_out(case, lane, stacked(case.path, lane))
        prior = np.concatenate([case.prior.poses[..., lane].ravel(), case.prior.errors[:, lane]])
        off, variances = stacked(case.path, lane), variances_of(case)
        off[: len(prior)] -= prior
        free = variances > 0.0
        costs, _ = counted(case, lane, innovations)
        expected = np.sum(off[free] ** 2 / variances[free]) + np.sum(costs)
        np.testing.assert_allclose(found[lane], expected, rtol=1e-12)


def solved(case: Case, lanes: list[int], close_enough: float = 0.01) -> BatchSolution:
    """The solution of some lanes from the prior."""
    window, prior = case.window, case.prior
    return solve(
        case.setup,
        np.ascontiguousarray(window.speeds[..., lanes]),
        np.ascontiguousarray(window.turn_rates[..., lanes]),
        np.ascontiguousarray(window.sightings[..., lanes]),
        Prior(
            np.ascontiguousarray(prior.poses[..., lanes]),
            np.ascontiguousarray(prior.errors[..., lanes]),
            prior.variances,
        ),
        BEGIN,
        close_enough=close_enough,
    )


@pytest.mark.parametrize(
    "name", ["poses alone", "all but clocks", "steps of unequal length, no clocks"]
)
def test_the_gradient_vanishes_at_a_solution(name: str) -> None:
    case = case_of(CASES[name](), temper=(1.0, 1.0))
    found = solved(case, [0, 1], close_enough=1e-14)
    plain = dense(case, 0, found.path)
    sigmas = np.sqrt(np.diag(np.linalg.inv(plain.rows.T @ plain.rows)))
    gradient = plain.rows.T @ plain.residuals
    np.testing.assert_allclose(gradient * sigmas, 0.0, atol=1e-5)
    np.testing.assert_allclose(found.cost[0], plain.residuals @ plain.residuals, rtol=1e-12)
    end = np.concatenate([found.poses[..., 0].ravel(), found.errors[:, 0]])
    np.testing.assert_allclose(end, plain.end, atol=1e-5)


def parts(found: BatchSolution, lane: int) -> list[Array]:
    """All that a solution has of a lane."""
    arrays = (*found.path, found.cost, found.sightings, found.poses, found.errors, found.covariance)
    return [np.asarray(one[..., lane], dtype=float) for one in (*arrays, found.steps)]


@pytest.mark.parametrize("name", ["poses alone", "all states"])
def test_a_lane_does_not_depend_on_those_beside_it(name: str) -> None:
    case = case_of(CASES[name]())
    crowd = solved(case, [1, 0, 1, 1, 0, 0, 1])
    for lane, places in ((0, (1, 4, 5)), (1, (0, 2, 3, 6))):
        alone = parts(solved(case, [lane]), 0)
        for place in places:
            for one, other in zip(alone, parts(crowd, place), strict=True):
                np.testing.assert_array_equal(one, other)


def test_what_is_certain_stays_as_it_is() -> None:
    case = case_of(CASES["a start and readings without noise"]())
    found = solved(case, [0, 1])
    np.testing.assert_array_equal(found.path.poses[:, :2], case.prior.poses[:, :2])
    assert np.all(found.path.speeds == 0.0)
    assert np.all(found.path.turn_rates == 0.0)
    for one in (found.cost, found.poses, found.errors, found.covariance):
        assert np.all(np.isfinite(one))


def test_a_thinned_problem_has_the_same_information_of_every_pair() -> None:
    setup = scene_of(a_team(()), 90, 1).setup
    thin, kept = _thinned(setup, 30, 80)
    whole, window = setup.poses, slice(setup.poses.first[31], setup.poses.first[81])
    step = np.repeat(np.arange(len(whole.first) - 1), np.diff(whole.first))[window]
    few = thin.poses
    np.testing.assert_array_equal(few.kinds, whole.kinds[window][kept])
    assert few.first[31] == 0
    assert few.first[81] == len(kept) < len(step)
    np.testing.assert_array_equal(
        np.repeat(np.arange(31, 81), np.diff(few.first[31:82])), step[kept]
    )
    pairs = np.stack([whole.kinds, whole.observers, whole.targets], axis=1)[window]
    for pair in np.unique(pairs, axis=0):
        own = np.all(pairs == pair, axis=1)
        stands = np.all(np.stack([few.kinds, few.observers, few.targets], axis=1) == pair, axis=1)
        information = np.sum(1.0 / whole.variances[window][own])
        np.testing.assert_allclose(np.sum(1.0 / few.variances[stands]), information)
        assert stands.sum() == -(-own.sum() // THINNING)


def test_a_cost_is_credible_up_to_six_sigmas_of_chi_square() -> None:
    counts = np.array([0, 50, 50, 50])
    costs = np.array([0.0, 109.9, 110.1, np.nan])
    assert is_credible(costs, counts).tolist() == [True, True, False, False]
