"""The pilot's second-order noise and batch solution against compiled ones and dense algebra."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array, Index
from syncplan.estimation import pilot
from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.correction_kernels import second_order_variance
from syncplan.estimation.pilot import _linear, _Path, batch_start, pilot_squares, pilot_work
from syncplan.estimation.pilot_model import PilotFilter, Seen
from syncplan.estimation.pilot_readings import PilotReadings, thinned
from syncplan.estimation.start_search import ROUNDS, search_further
from syncplan.planning.planner import plan
from syncplan.scenario.filters import FILTERS
from tests.tools.inner_kernels import called_alone
from tests.tools.scenarios import changed

KINDS: dict[str, Any] = {"sensor": {"range_sigma_m": 1.0}, "heading_sigma_rad": 0.2}
"""Every kind of sighting."""


def readings(position: float, heading: float, **keys: Any) -> PilotReadings:
    """What three trials of the paper's grid read in two thirds of a period."""
    start = {"position_m": position, "heading_rad": heading}
    made = plan(changed("paper-grid-same", initial_sigma=start, **keys), bound="never")
    return PilotReadings.drawn(thinned(made.team), made.windows, 20.0, 3, 0)


def off_the_prior(run: PilotReadings) -> _Path:
    """Trajectories that are off prior and readings."""
    generator = np.random.default_rng(5)
    lanes, n = run.initial.shape[:2]
    start = 0.5 * generator.standard_normal((lanes, n, 3))
    noise = 0.5 * generator.standard_normal((lanes, run.steps, n, 2))
    return _Path.of(run, np.arange(lanes), start, noise)


def residuals(path: _Path, lane: int, values: Array, temper: float) -> Array:
    """What a lane's cost is the sum of squares of, at whitened start and noise."""
    starts, noises = path.start.copy(), path.noise.copy()
    starts[lane] = values[: starts[lane].size].reshape(starts[lane].shape)
    noises[lane] = values[starts[lane].size :].reshape(noises[lane].shape)
    there = _Path.of(path.run, path.trials, starts, noises)
    scale = np.sqrt(path.run.variances[path.read] * temper)
    return np.concatenate([values, there.innovation[lane] / scale])


@pytest.mark.parametrize("temper", [1.0, 100.0])
def test_a_step_of_the_batch_solution_is_that_of_dense_least_squares(temper: float) -> None:
    path = off_the_prior(readings(5.0, 0.1, **KINDS))
    step = _linear(path, np.full(3, temper))
    lane, size = 1, path.start[1].size
    here = np.concatenate([path.start[lane].ravel(), path.noise[lane].ravel()])
    far = 1e-4 * np.eye(len(here))
    slopes = np.stack(
        [
            residuals(path, lane, here + one, temper) - residuals(path, lane, here - one, temper)
            for one in far
        ],
        axis=1,
    ) / (2.0 * far[0, 0])
    missed = residuals(path, lane, here, temper)
    best = here - np.linalg.lstsq(slopes, missed)[0]
    np.testing.assert_allclose(step.start[lane].ravel(), best[:size], atol=1e-6)
    np.testing.assert_allclose(step.noise[lane].ravel(), best[size:], atol=1e-6)
    left = missed + slopes @ (best - here)
    assert step.cost[lane] == pytest.approx(left @ left, rel=1e-7)
    assert path.cost(np.full(3, temper))[lane] == pytest.approx(missed @ missed)


@pytest.mark.parametrize("at_once", [1, 1000])
def test_sightings_may_be_taken_in_in_chunks_of_any_size(
    at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = off_the_prior(readings(5.0, 0.1, **KINDS))
    some = _linear(path, np.ones(3))
    monkeypatch.setattr(pilot, "AT_ONCE", at_once)
    other = _linear(path, np.ones(3))
    for name in ("start", "noise", "cost", "P", "errors"):
        one, two = getattr(some, name), getattr(other, name)
        np.testing.assert_allclose(two, one, rtol=1e-7, atol=1e-9 * np.abs(one).max())


def test_from_a_known_start_the_batch_solution_is_where_the_filter_comes() -> None:
    # next to nothing is not linear
    run = readings(0.05, 0.002)
    lanes = PilotFilter.at_start(run, second_order=False)
    for k in range(1, run.steps + 1):
        lanes.predict(run, k)
        lanes.correct(run, k)
    found = batch_start(run, run.steps, 0)
    sigmas = np.sqrt(np.einsum("lii->li", lanes.P)).reshape(lanes.x.shape)
    assert np.all(np.abs(found.x - lanes.x) < 0.1 * sigmas)
    np.testing.assert_allclose(found.P, lanes.P, rtol=0.02, atol=5e-3 * np.max(lanes.P))
    np.testing.assert_allclose(found.gone, lanes.gone, atol=0.5)


@pytest.mark.parametrize(
    ("targets", "place"), [(np.array([1, 4, 0]), 0), (np.array([1, 4, 0]), 1), (None, 2)]
)
def test_second_order_noise_is_that_of_the_compiled_filter(
    targets: Index | None, place: int
) -> None:
    # three vehicles see vehicles and, as number 3, a landmark
    generator = np.random.default_rng(2)
    root = generator.standard_normal((2, 9, 9))
    P = root @ np.swapaxes(root, 1, 2)
    observers = np.array([0, 1, 2])
    moving = observers if targets is None else np.minimum(targets, 3)
    places, gone = generator.uniform(-30.0, 30.0, (2, 2, 4, 2))
    gone[:, 3] = 0.0
    seen = Seen(
        3,
        np.full(3, place),
        observers,
        moving,
        places[:, moving] - places[:, observers],
        np.zeros((2, 3)),
        gone[:, observers],
        gone[:, moving],
    )
    found, variance = seen.second_order(P), called_alone(second_order_variance)
    # the positions' own rows, then the difference of the two bodies
    rows = np.zeros((2, 4, 2, 9))
    for lane in range(2):
        for body in range(3):
            rows[lane, body, :, 3 * body : 3 * body + 2] = np.eye(2)
            rows[lane, body, :, 3 * body + 2] = gone[lane, body]
        for k in range(3):
            apart = rows[lane, moving[k]] - rows[lane, observers[k]]
            C = apart @ P[lane] @ apart.T
            dx, dy = seen.q[lane, k].tolist()
            expected = variance(place, dx, dy, C[0, 0], C[0, 1], C[1, 1])
            assert found[lane, k] == pytest.approx(expected, rel=1e-9)


def test_it_finds_what_the_robust_filter_finds_where_the_extended_one_is_lost() -> None:
    start = {"position_m": 30.0, "heading_rad": 0.6}
    made = plan(changed("paper-grid-same", initial_sigma=start), pilot=False)
    length = 5.0 * made.orbits.period
    bound = posterior_bound(made.team, made.windows, length).rms_second_half()
    worst = {}
    for name in ("ekf", "robust"):
        found = pilot_squares(thinned(made.team), made.windows, length, FILTERS[name])
        worst[name] = np.max(np.sqrt(found.mean(axis=0)) / bound)
    assert worst["ekf"] > 5.0
    assert worst["robust"] < 1.3


def test_a_run_shorter_than_a_period_is_second_order() -> None:
    made = plan(changed("paper-grid-same"), bound="never")
    thin, length = thinned(made.team), 0.8 * made.orbits.period
    robust, second = (
        pilot_squares(thin, made.windows, length, FILTERS[name], trials=3)
        for name in ("robust", "second-order")
    )
    np.testing.assert_array_equal(robust, second)
    # beyond a period they part, whether or not what is compared begins before
    for turns in (1.5, 2.5):
        length = turns * made.orbits.period
        robust, second = (
            pilot_squares(thin, made.windows, length, FILTERS[name], trials=3)
            for name in ("robust", "second-order")
        )
        assert np.all(robust != second)
        assert np.all(np.sqrt(robust) < 10.0)


def test_a_batch_solution_counts_as_work() -> None:
    made = plan(changed("paper-grid-same"), bound="never")
    turn = made.orbits.period

    def work(name: str, length: float) -> float:
        return pilot_work(made.team, made.windows, length, FILTERS[name])

    assert work("ekf", 5.0 * turn) == work("second-order", 5.0 * turn)
    assert work("robust", 5.0 * turn) > 3.0 * work("ekf", 5.0 * turn)
    assert work("robust", 0.9 * turn) == work("ekf", 0.9 * turn)


def test_a_lane_that_breaks_down_does_not_stop_the_others() -> None:
    run = readings(15.0, 0.3)
    whole = batch_start(run, run.steps, 0)
    measured = run.measured.copy()
    measured[1, 3] = np.nan
    with np.errstate(all="ignore"):
        found = batch_start(replace(run, measured=measured), run.steps, 0)
    np.testing.assert_array_equal(found.x[[0, 2]], whole.x[[0, 2]])
    assert np.isnan(found.x[1]).any() or not np.isfinite(found.P[1]).all()


class Tries:
    """Solutions that are known by their cost and by which round found them."""

    def __init__(self, cost: list[float], found_in: int = -1) -> None:
        self.cost = np.array(cost)
        self.found_in = np.full(len(cost), found_in)

    def take(self, other: "Tries", mine: Index, its: Index) -> None:
        self.cost[mine], self.found_in[mine] = other.cost[its], other.found_in[its]


def test_further_starts_are_tried_until_a_solution_is_credible_or_all_agree() -> None:
    # of 100 sightings each: credible up to 185
    costs = {
        0: [100.0],  # credible at once
        1: [900.0, 150.0],  # in the first round
        2: [900.0, 800.0, 120.0],  # in the second
        3: [300.0, 300.5],  # never, but all agree, and errors of the model explain so much
        4: [900.0, 900.0, 899.8],  # never, and all agree: in the first round that is no evidence
        5: [900.0, 800.0, 700.0, 600.0],  # never
    }
    best, asked = Tries([one[0] for one in costs.values()]), []

    def tried(missing: Index, number: int) -> Tries:
        asked.append(missing.tolist())
        of_round = [costs[k][number + 1] for k in missing.tolist()]
        return Tries(np.repeat(of_round, ROUNDS[number]).tolist(), number)

    search_further(best, np.full(6, 100), tried)
    assert asked == [[1, 2, 3, 4, 5], [2, 4, 5], [5]]
    assert best.cost.tolist() == [100.0, 150.0, 120.0, 300.0, 899.8, 600.0]
    assert best.found_in.tolist() == [-1, 0, 1, -1, 1, 2]


def test_where_the_noise_is_not_known_the_least_cost_counts_once_it_is_found_twice() -> None:
    # of 100 sightings each: all of these costs would be credible if the noise were known
    costs: dict[int, list[list[float]]] = {
        0: [[50.0], [50.2, 50.4]],  # all agree
        1: [[50.0], [50.2, 60.0], [50.4, *[90.0] * 7]],  # found again in the second round
        2: [[60.0], [60.0, 65.0], [30.0, *[60.0] * 7], [30.5, *[60.0] * 15]],  # only in the third
        3: [[60.0], [40.0, 80.0], [30.0, 30.2, *[60.0] * 6]],  # twice in the second
        4: [[60.0], [50.0, 50.0], [50.0, *[60.0] * 7]],  # twice in the first, which is too few
    }
    best, asked = Tries([one[0][0] for one in costs.values()]), []

    def tried(missing: Index, number: int) -> Tries:
        asked.append(missing.tolist())
        found = [cost for k in missing.tolist() for cost in costs[k][number + 1]]
        return Tries(found, number)

    search_further(best, np.full(5, 100), tried, noise_known=False)
    assert asked == [[0, 1, 2, 3, 4], [1, 2, 3, 4], [2]]
    assert best.cost.tolist() == [50.0, 50.0, 30.0, 30.0, 50.0]
