"""The pilot against the compiled filter on the same draws, the bound and dense algebra."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array, Index
from syncplan.estimation import pilot
from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.correction_kernels import second_order_variance
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.pilot import _linear, _Path, batch_start, pilot_squares, pilot_work
from syncplan.estimation.pilot_model import PilotFilter, Seen
from syncplan.estimation.pilot_readings import INSTANTS_A_TURN, PilotReadings, thinned
from syncplan.estimation.start_search import ROUNDS, search_further
from syncplan.orbits.sightings import sample_sightings
from syncplan.planning.planner import Plan, plan
from syncplan.scenario.filters import FILTERS
from tests.tools.inner_kernels import called_alone
from tests.tools.scenarios import changed, example, small


def compiled_squares(
    made: Plan, duration: float, trials: int, seed: int, name: str = "ekf"
) -> Array:
    """What the compiled filter makes of the same trials, (trials, n) m^2."""
    steps = round(duration / made.sensors.sample_time)
    seen = sample_sightings(made.windows, made.orbits.period, made.sensors, 1, steps)
    options = FilterOptions(trials=trials, seed=seed, filter=name)
    found = run_trials(made.team, seen, steps, options, threads=1)
    return np.asarray(found.late_mean_squares[..., :2].sum(axis=-1))


KINDS: dict[str, Any] = {
    "sensor": {"range_sigma_m": 1.0, "interval_s": 0.3, "detection_probability": 0.7},
    "heading_sigma_rad": 0.2,
}
"""Every kind of sighting, at intervals and missed now and then."""


@pytest.mark.parametrize(("name", "off"), [("ekf", 1e-6), ("second-order", 1e-6), ("robust", 0.02)])
def test_with_one_sighting_an_instant_it_is_the_compiled_filter(name: str, off: float) -> None:
    # far apart, each sees but a landmark of its own: nothing is taken in at once
    made = plan(
        small(
            formation={"centers_m": [[0.0, 0.0]]},
            landmarks_m=[[0.0, 45.0]],
            motion={"speed_sigma_mps": 0.2, "turn_rate_sigma_rad_s": 0.05},
            initial_sigma={"position_m": 3.0, "heading_rad": 0.1},
        ),
        bound="never",
    )
    found = pilot_squares(made.team, made.windows, 80.0, FILTERS[name], trials=5, seed=3)
    np.testing.assert_allclose(found, compiled_squares(made, 80.0, 5, 3, name), rtol=off)


def test_with_many_sightings_an_instant_it_is_near_the_compiled_filter() -> None:
    start = {"position_m": 0.5, "heading_rad": 0.01}
    made = plan(changed("paper-grid-same", initial_sigma=start), bound="never")
    found = pilot_squares(made.team, made.windows, 60.0, FILTERS["ekf"], trials=4, seed=1)
    np.testing.assert_allclose(found, compiled_squares(made, 60.0, 4, 1), rtol=0.05)


def test_trials_are_the_same_whatever_their_number() -> None:
    made = plan(example("paper-grid-same"), bound="never")
    thin = thinned(made.team)
    many = pilot_squares(thin, made.windows, 60.0, FILTERS["ekf"], trials=6)
    np.testing.assert_array_equal(
        pilot_squares(thin, made.windows, 60.0, FILTERS["ekf"], trials=2), many[:2]
    )
    other = pilot_squares(thin, made.windows, 60.0, FILTERS["ekf"], trials=2, seed=1)
    assert not np.any(other == many[:2])


@pytest.mark.parametrize("name", ["paper-grid-same", "five-ring"])
def test_samples_thinned_out_leave_the_bound_as_it_is(name: str) -> None:
    made = plan(example(name), bound="never")
    thin = thinned(made.team)
    kept = round(thin.sensors.sample_time / made.sensors.sample_time)
    assert kept > 1
    assert made.orbits.period / thin.sensors.sample_time >= INSTANTS_A_TURN
    full = posterior_bound(made.team, made.windows, 100.0).rms_second_half()
    less = posterior_bound(thin, made.windows, 100.0).rms_second_half()
    np.testing.assert_allclose(less, full, rtol=0.05)


def test_few_samples_a_period_are_all_kept() -> None:
    made = plan(example("paper-grid-same"), bound="never")
    rare = replace(made.team, sensors=replace(made.sensors, sample_time=1.0))
    assert thinned(rare).sensors.sample_time == 1.0
    np.testing.assert_array_equal(thinned(rare).sensors.bearing_sigmas, rare.sensors.bearing_sigmas)


def test_with_other_kinds_of_sighting_it_is_the_compiled_filter() -> None:
    # next to nothing is taken in at once: bearings say little
    rare = {"range_m": 50.0, "bearing_sigma_rad": 3.0, "range_sigma_m": 0.5, "sample_time_s": 0.1}
    made = plan(
        small(
            formation={"centers_m": [[0.0, 0.0]]},
            landmarks_m=[[0.0, 45.0], [30.0, 35.0]],
            sensor=rare,
            heading_sigma_rad=0.1,
            initial_sigma={"position_m": 0.5, "heading_rad": 0.02},
        ),
        bound="never",
    )
    found = pilot_squares(made.team, made.windows, 40.0, FILTERS["ekf"], trials=5, seed=3)
    np.testing.assert_allclose(found, compiled_squares(made, 40.0, 5, 3), rtol=0.03)


def test_with_every_kind_of_sighting_it_finds_the_bound_from_a_well_known_start() -> None:
    start = {"position_m": 1.0, "heading_rad": 0.02}
    made = plan(changed("paper-grid-same", initial_sigma=start, **KINDS), bound="never")
    thin = thinned(made.team)
    less = posterior_bound(thin, made.windows, 100.0).rms_second_half()
    full = posterior_bound(made.team, made.windows, 100.0).rms_second_half()
    np.testing.assert_allclose(less, full, rtol=0.05)
    found = pilot_squares(thin, made.windows, 100.0, FILTERS["ekf"], trials=100)
    ratio = np.sqrt(found.mean(axis=0)) / full
    assert np.all((ratio > 0.85) & (ratio < 1.15))


def test_a_filter_that_breaks_down_has_infinite_errors() -> None:
    made = plan(example("paper-grid-same"), bound="never")
    sure = replace(made.sensors, bearing_sigmas=np.full(6, 1e-160))
    lost = replace(made.team, sensors=sure)
    found = pilot_squares(lost, made.windows, 20.0, FILTERS["ekf"], trials=3)
    assert np.all(np.isinf(found))


# --- second-order noise and batch solutions -------------------------------------------------------


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
    thin = thinned(made.team)
    # beyond a period they part, whether or not what is compared begins before
    for turns, part in ((0.8, False), (1.5, True), (2.5, True)):
        length = turns * made.orbits.period
        robust, second = (
            pilot_squares(thin, made.windows, length, FILTERS[name], trials=3)
            for name in ("robust", "second-order")
        )
        np.testing.assert_array_equal(robust != second, part)
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
