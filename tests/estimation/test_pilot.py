"""The pilot against the compiled filter on the same draws, and against the bound."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.pilot import pilot_squares
from syncplan.estimation.pilot_readings import INSTANTS_A_TURN, thinned
from syncplan.orbits.sightings import sample_sightings
from syncplan.planning.planner import Plan, plan
from syncplan.scenario.filters import FILTERS
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
    scenario = example("paper-grid-same")
    small_start = scenario.initial_sigma.model_copy(update={"position_m": 0.5, "heading_rad": 0.01})
    made = plan(scenario.model_copy(update={"initial_sigma": small_start}), bound="never")
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


KINDS: dict[str, Any] = {
    "sensor": {"range_sigma_m": 1.0, "interval_s": 0.3, "detection_probability": 0.7},
    "heading_sigma_rad": 0.2,
}
"""Every kind of sighting, at intervals and missed now and then."""


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
    made = plan(changed("paper-grid-same", initial_sigma=start, **KINDS))
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
