"""The batch solution against dense least squares in NumPy."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from syncplan.arrays import Array, Flags
from syncplan.estimation.batch_linearisation import linear_pass, smooth
from syncplan.estimation.batch_problem import FAR, Prior, Trajectory, Window, trajectory_cost
from syncplan.estimation.batch_solution import THINNING, BatchSolution, _thinned, problem_of, solve
from syncplan.estimation.filter_setup import DELAY, DISTANCE_KIND, FilterSetup
from syncplan.estimation.kernels import lanes_of
from syncplan.estimation.start_search import is_credible
from syncplan.orbits.circles import wrap
from tests.tools.filter_scenes import ALL, BUT_CLOCKS, Scene, a_team, derivative, scene_of
from tests.tools.plain_filters import in_step
from tests.tools.reference_filter import moved_state, sighted

BEGIN, SAMPLES = 5, 6
LANES = lanes_of(3, 2)


class Case(NamedTuple):
    """A window of a set-up, with two lanes, and a trajectory in it that is not the best."""

    setup: FilterSetup
    window: Window
    prior: Prior
    path: Trajectory


def scene(estimated: tuple[str, ...], samples: int = SAMPLES, **changes: Any) -> Scene:
    """Two trials of three vehicles; gusts pass within a few samples."""
    team = a_team(estimated)
    team = replace(team, errors=replace(team.errors, gust_time=0.12))
    return scene_of(team, BEGIN + samples, 2, **changes)


def case_of(given: Scene, temper: tuple[float, float] = (1.0, 7.0)) -> Case:
    """The window from BEGIN on, a prior about some state and a trajectory off it.

    Rows by clock offsets are exact about offsets of 0 alone, so the trajectory has none.
    """
    setup, readings, truth = given
    random, states, n = np.random.default_rng(4), setup.states, setup.vehicles
    samples = len(setup.spans) - BEGIN
    changing = slice(states.first_changing - 3 * n, None)
    gained = states.variances[changing] * (1.0 - states.decays[changing] ** 2)
    variances = setup.initial_variances
    off = np.sqrt(variances)[:, None] * random.normal(size=(2, len(variances), 2))
    prior = Prior(off[0], variances)
    prior.mean[: 3 * n] += truth.poses[BEGIN, ..., :1].reshape(-1, 1)
    speed, turn = np.sqrt([setup.motion.speed_variance, setup.motion.turn_rate_variance])
    path = Trajectory(
        start=prior.mean + off[1],
        speeds=speed * random.normal(size=(samples, n, 2)),
        turn_rates=turn * random.normal(size=(samples, n, 2)),
        changes=np.sqrt(gained)[:, None] * random.normal(size=(samples, len(gained), 2)),
    )
    path.start[states.columns[states.acts == DELAY]] = 0.0
    window = Window(
        BEGIN,
        readings.speeds[BEGIN:],
        readings.turn_rates[BEGIN:],
        readings.sightings[setup.first[BEGIN + 1] :],
        np.array(temper),
    )
    return Case(setup, window, prior, path)


def unequal(given: Scene) -> Scene:
    """The same with steps of unequal length."""
    spans = np.random.default_rng(5).uniform(0.02, 0.4, len(given.setup.spans))
    return given._replace(setup=given.setup._replace(spans=spans))


def certain(given: Scene) -> Scene:
    """The same with places known at the start, and readings without noise."""
    motion = given.setup.motion._replace(speed_variance=0.0, turn_rate_variance=0.0)
    starts = given.setup.initial_variances.copy()
    starts[:9].reshape(3, 3)[:, :2] = 0.0
    return given._replace(setup=given.setup._replace(motion=motion, initial_variances=starts))


CASES = {
    "poses alone": lambda: scene(()),
    "gusts": lambda: scene(("gusts",)),
    "all states": lambda: scene(ALL),
    "all but clocks": lambda: scene(BUT_CLOCKS),
    "with a gate": lambda: scene(ALL, gate_probability=0.9),
    "steps of unequal length, no clocks": lambda: unequal(scene(BUT_CLOCKS)),
    "a start and readings without noise": lambda: certain(scene(ALL)),
    "paper's sub-steps": lambda: scene(("speed_scale", "turn_rate_bias"), filter="paper"),
}


def stacked(path: Trajectory, lane: int) -> Array:
    """All that a trajectory follows from, of one lane."""
    return np.concatenate([one[..., lane].ravel() for one in path])


def known(case: Case, lane: int) -> tuple[Array, Array]:
    """The expectation and the variance of each of these; a variance of 0 where it is known."""
    setup, states, n = case.setup, case.setup.states, case.setup.vehicles
    motion, changing = setup.motion, slice(states.first_changing - 3 * n, None)
    shares = motion.time / setup.spans[BEGIN:]
    lasting = states.decays[changing] ** (2.0 / shares[:, None])
    variances = np.concatenate(
        [
            case.prior.variances,
            np.repeat(motion.speed_variance * shares, n),
            np.repeat(motion.turn_rate_variance * shares, n),
            (states.variances[changing] * (1.0 - lasting)).ravel(),
        ]
    )
    mean = np.zeros(len(variances))
    mean[: len(case.prior.mean)] = case.prior.mean[:, lane]
    return mean, variances


def rolled_out(case: Case, lane: int, flat: Array) -> tuple[Array, Array, Array, Array]:
    """What follows from a trajectory, with derivatives by all its numbers, by the chain rule.

    Innovations (s,) of the window's sightings over their sigmas and their derivatives (s, all), and
    the state (3n + e,) at its end and its derivatives (3n + e, all).
    """
    setup, window = case.setup, case.window
    n, (samples, g, _) = setup.vehicles, case.path.changes.shape
    cuts = np.cumsum([len(case.prior.mean), samples * n, samples * n])
    state, speeds, turns, gains = np.split(flat, cuts)
    speeds, turns, gains = (one.reshape(samples, -1) for one in (speeds, turns, gains))
    slopes, *inputs = np.split(np.eye(len(flat)), cuts)
    by_speeds, by_turns, by_gains = (one.reshape(samples, -1, len(flat)) for one in inputs)
    innovations, rows, first = [], [], setup.first
    for k in range(samples):
        made = window.speeds[k, :, lane] + speeds[k], window.turn_rates[k, :, lane] + turns[k]
        step, size = in_step(setup, BEGIN + k + 1), len(state)

        def moved(one: Array, step: FilterSetup = step, size: int = size) -> Array:
            return moved_state(one[:size], one[size:-n], one[-n:], step)

        before = np.concatenate([state, *made])
        state = moved(before)
        slopes = derivative(moved, before) @ np.concatenate([slopes, by_speeds[k], by_turns[k]])
        state[size - g :] += gains[k]
        slopes[size - g :] += by_gains[k]
        for s in range(first[BEGIN + k + 1], first[BEGIN + k + 2]):
            kind, o, t = (int(one[s]) for one in (setup.kinds, setup.observers, setup.targets))
            expected, row = sighted(state, kind, o, t, setup, made)
            nu = window.sightings[s - first[BEGIN + 1], lane] - expected
            nu = nu if kind == DISTANCE_KIND else float(wrap(nu))
            sigma = np.sqrt(setup.variances[s] * window.temper[lane])
            innovations.append(nu / sigma)
            rows.append(-row @ slopes / sigma)
    return np.array(innovations), np.array(rows), state, slopes


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
    gate, made = case.setup.gate, ~np.isnan(innovations)
    squares = np.where(made, innovations**2, 0.0)
    if np.isinf(gate) or case.window.temper[lane] == 1.0:
        return np.minimum(squares, gate), np.asarray(made & (squares <= gate), dtype=float)
    far = np.maximum(np.sqrt(squares), FAR)
    return np.where(far > FAR, 2.0 * FAR * far - FAR**2, squares), made * np.sqrt(FAR / far)


def dense(case: Case, lane: int, path: Trajectory) -> Dense:
    """The problem about a trajectory."""
    flat, (mean, variances) = stacked(path, lane), known(case, lane)
    free = variances > 0.0
    scale = np.sqrt(variances[free])
    innovations, slopes, end, ends = rolled_out(case, lane, flat)
    costs, weights = counted(case, lane, innovations)
    made = weights > 0.0
    weights = weights[made]
    innovations = weights * innovations[made]
    return Dense(
        residuals=np.concatenate([(flat - mean)[free] / scale, innovations]),
        rows=np.concatenate([np.diag(1.0 / scale), weights[:, None] * slopes[made][:, free]]),
        free=free,
        ends=ends[:, free],
        end=end,
        constant=float(np.sum(costs) - np.sum(innovations**2)),
    )


@pytest.mark.parametrize("name", CASES)
def test_a_step_is_that_of_dense_least_squares(name: str) -> None:
    case = case_of(CASES[name]())
    assert np.isnan(case.window.sightings).any()
    problem = problem_of(case.setup, case.window, case.prior, SAMPLES)
    trajectory_cost(problem, case.path, LANES)
    costs = problem.scratch.cost.copy()
    linear_pass(problem, case.path, LANES)
    x, P = problem.scratch.x, problem.scratch.P
    smooth(problem, LANES)
    assert ("gusts" in name or "all" in name) <= (problem.found.ended.sum() >= 2)
    for lane in (0, 1):
        plain = dense(case, lane, case.path)
        assert (plain.constant > 1.0) == (name == "with a gate")
        step, flat = plain.step, stacked(case.path, lane)
        best = stacked(problem.best, lane)
        spread = np.linalg.inv(plain.rows.T @ plain.rows)
        sigmas = np.sqrt(np.diag(spread))
        np.testing.assert_allclose((best - flat)[plain.free] / sigmas, step / sigmas, atol=2e-5)
        covariance = plain.ends @ spread @ plain.ends.T
        expected = plain.end + plain.ends @ step
        ending = np.sqrt(np.diag(covariance))
        np.testing.assert_allclose((x[:, lane] - expected) / ending, 0.0, atol=2e-5)
        lower = np.tril_indices(len(x))
        scales = np.outer(ending, ending)[lower]
        np.testing.assert_allclose(
            P[..., lane][lower] / scales, covariance[lower] / scales, atol=1e-6
        )
        cost = plain.residuals @ plain.residuals + plain.constant
        after = plain.residuals + plain.rows @ step
        np.testing.assert_allclose(costs[lane], cost, rtol=1e-12)
        np.testing.assert_allclose(problem.found.cost[lane], cost, rtol=1e-9)
        np.testing.assert_allclose(
            problem.found.linear_cost[lane], after @ after + plain.constant, rtol=1e-6
        )


def solved(
    case: Case, lanes: list[int], close_enough: float = 0.01, away: float = 0.0
) -> BatchSolution:
    """The solution of some lanes from the prior, or from places that are so many m away."""
    window, prior, start = case.window, case.prior, case.prior.mean.copy()
    scale = away * np.tile([1.0, 1.0, 0.02], 3)[:, None]
    start[:9] += scale * np.random.default_rng(1).normal(size=(9, 2))
    return solve(
        case.setup,
        np.ascontiguousarray(window.speeds[..., lanes]),
        np.ascontiguousarray(window.turn_rates[..., lanes]),
        np.ascontiguousarray(window.sightings[..., lanes]),
        Prior(np.ascontiguousarray(prior.mean[:, lanes]), prior.variances),
        BEGIN,
        np.ascontiguousarray(start[:, lanes]),
        close_enough=close_enough,
    )


@pytest.mark.parametrize(
    "given",
    [
        pytest.param(lambda: scene((), 12), id="poses alone"),
        pytest.param(lambda: scene(("speed_scale", "gusts"), 12), id="scales and gusts"),
        pytest.param(lambda: unequal(scene(BUT_CLOCKS)), id="steps of unequal length, no clocks"),
    ],
)
def test_a_solution_is_that_of_dense_least_squares(given: Callable[[], Scene]) -> None:
    case = case_of(given(), temper=(1.0, 1.0))
    found = solved(case, [0, 1], close_enough=1e-14)
    plain = dense(case, 0, found.path)
    spread = np.linalg.inv(plain.rows.T @ plain.rows)
    np.testing.assert_allclose(plain.step / np.sqrt(np.diag(spread)), 0.0, atol=1e-6)
    np.testing.assert_allclose(found.cost[0], plain.residuals @ plain.residuals, rtol=1e-12)
    np.testing.assert_allclose(found.state[:, 0], plain.end, atol=1e-6)
    variances = np.diag(plain.ends @ spread @ plain.ends.T)
    np.testing.assert_allclose(found.covariance[..., 0].diagonal(), variances, rtol=2e-6)


def parts(found: BatchSolution, lane: int) -> list[Array]:
    """All that a solution has of a lane."""
    arrays = (*found.path, found.cost, found.sightings, found.state, found.covariance)
    return [np.asarray(one[..., lane], dtype=float) for one in (*arrays, found.steps)]


@pytest.mark.parametrize("name", ["poses alone", "all states"])
def test_a_lane_does_not_depend_on_those_beside_it(name: str) -> None:
    case = case_of(CASES[name]())
    # so far off that steps are cut short, in some lanes at a time
    crowd = solved(case, [1, 0, 1, 1, 0, 0, 1], away=1000.0)
    for lane, places in ((0, (1, 4, 5)), (1, (0, 2, 3, 6))):
        alone = parts(solved(case, [lane], away=1000.0), 0)
        for place in places:
            for one, other in zip(alone, parts(crowd, place), strict=True):
                np.testing.assert_array_equal(one, other)


def test_what_is_certain_stays_as_it_is() -> None:
    case = case_of(CASES["a start and readings without noise"]())
    found = solved(case, [0, 1])
    sure = case.prior.variances == 0.0
    assert sure.sum() == 6
    np.testing.assert_array_equal(found.path.start[sure], case.prior.mean[sure])
    assert np.all(found.path.speeds == 0.0)
    assert np.all(found.path.turn_rates == 0.0)
    for one in (found.cost, found.state, found.covariance):
        assert np.all(np.isfinite(one))


def test_a_thinned_problem_has_the_same_information_of_every_pair() -> None:
    setup = scene_of(a_team(()), 90, 1).setup
    thin, kept = _thinned(setup, 30, 80)
    whole, window = setup, slice(setup.first[31], setup.first[81])
    step = np.repeat(np.arange(len(whole.first) - 1), np.diff(whole.first))[window]
    np.testing.assert_array_equal(thin.kinds, whole.kinds[window][kept])
    assert thin.first[31] == 0
    assert thin.first[81] == len(kept) < len(step)
    np.testing.assert_array_equal(
        np.repeat(np.arange(31, 81), np.diff(thin.first[31:82])), step[kept]
    )
    pairs, few = (
        np.stack([one.kinds, one.observers, one.targets], axis=1) for one in (whole, thin)
    )
    pairs = pairs[window]
    for pair in np.unique(pairs, axis=0):
        own = np.all(pairs == pair, axis=1)
        stands = np.all(few == pair, axis=1)
        information = np.sum(1.0 / whole.variances[window][own])
        np.testing.assert_allclose(np.sum(1.0 / thin.variances[stands]), information)
        assert stands.sum() == -(-own.sum() // THINNING)


def test_a_cost_is_credible_up_to_six_sigmas_of_chi_square() -> None:
    counts = np.array([0, 50, 50, 50])
    costs = np.array([0.0, 109.9, 110.1, np.nan])
    assert is_credible(costs, counts).tolist() == [True, True, False, False]
