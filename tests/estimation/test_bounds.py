"""The bounds against independent recursions, and those of lumped sightings against the exact."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncplan.errors import NoSolutionError
from syncplan.estimation import lumped_bound as lumps
from syncplan.estimation.bounds import posterior_bound, steady_bound, window_bound
from syncplan.estimation.referred_system import PosteriorBound, ReferredSystem, arc_noise_gain
from syncplan.observability.rank import assess, link_information
from syncplan.observability.referred_rows import sighting_rows
from syncplan.orbits.circles import Orbits
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.noise import Noise
from syncplan.orbits.sightings import sample_sightings, steps_within
from syncplan.planning import judged_team
from syncplan.planning.plans import Plan
from syncplan.scenario.loading import load_scenario
from syncplan.scenario.specification import Scenario
from tests.searches import lumps as lump_search
from tests.tools.on_paper import plan
from tests.tools.scenarios import changed, example, small

HARD = Path(__file__).parents[1] / "data" / "hard"


@pytest.fixture(scope="module")
def grid() -> Plan:
    return plan(example("paper-grid-same"))


def test_the_steady_bound_of_the_grid_is_that_found_before(grid: Plan) -> None:
    # design.md, section 3: the period averages fall to 1.07 m
    assert abs(steady_bound(grid.team, grid.windows).max() - 1.07) < 0.01


def test_without_motion_noise_the_posterior_tends_to_the_window_bound(grid: Plan) -> None:
    still = Noise(0.0, 0.0, position_sigma=1e5, heading_sigma=1e3)
    steps = steps_within(grid.orbits.period, grid.sensors.sample_time)
    sightings = sample_sightings(grid.windows, grid.orbits.period, grid.sensors, 1, steps)
    links = link_information(grid.team, sightings)
    window = window_bound(assess(grid.team, links))
    rows = sighting_rows(grid.team, sightings)
    dense = np.zeros((len(rows), 18))
    for s, (a, b) in enumerate(zip(sightings.observers, sightings.targets, strict=True)):
        dense[s, 3 * a : 3 * a + 3] += rows[s, :3]
        if b < 6:
            dense[s, 3 * b : 3 * b + 3] += rows[s, 3:]
    variance = np.diag(np.linalg.inv(dense.T @ dense)).reshape(6, 3)[:, :2].sum(axis=1)
    np.testing.assert_allclose(window, 20.0 * np.sqrt(variance), rtol=1e-8)
    run = posterior_bound(
        replace(grid.team, noise=still), grid.windows, steps * grid.sensors.sample_time
    )
    # the last sample is a hundredth of a second short of a whole period, back at the start
    np.testing.assert_allclose(np.sqrt(run.position_variance[-1]), window, rtol=1e-3)


def test_the_window_bound_is_missing_where_the_position_is_not_determined() -> None:
    made = plan(example("landmark-bridge"))
    assert np.isfinite(made.prediction.window[0])
    assert np.isnan(made.prediction.window[1])


def test_covariances_over_a_period_have_the_predicted_error_as_their_trace(grid: Plan) -> None:
    # of a run of two periods, the second half is the last period
    period, sample_time = grid.orbits.period, grid.sensors.sample_time
    made = plan(grid.scenario.following(duration_s=2.0 * period))
    found = made.position_covariances(round(period / sample_time))
    trace = np.trace(found.values, axis1=2, axis2=3)
    assert made.prediction.rms is not None
    np.testing.assert_allclose(np.sqrt(trace.mean(axis=0)), made.prediction.rms, rtol=1e-3)


def test_a_run_shorter_than_a_period_has_fewer_covariances() -> None:
    short = plan(example("paper-grid-same").following(duration_s=4.0))
    assert short.position_covariances(10).times.min() >= 0.0
    assert len(short.position_covariances(10).times) < 10


def test_covariances_of_what_is_not_observable_grow_with_the_duration() -> None:
    sizes = []
    for duration in (100.0, 400.0):
        made = plan(example("landmark-bridge").following(duration_s=duration))
        assert not made.observable
        sizes.append(float(made.position_covariances(4).values.max()))
    assert sizes[1] > 1.05 * sizes[0]


def test_a_team_too_large_for_the_exact_bound_has_no_covariances(
    grid: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(judged_team, "BOUND_WORK_LIMIT", 1.0)
    with pytest.raises(NoSolutionError, match="6 vehicles over 200 s are too many"):
        grid.position_covariances()


def test_the_second_half_is_the_samples_with_twice_their_number_past_the_end() -> None:
    for steps in (5, 6):
        variance = np.arange(steps + 1, dtype=float)[:, None]
        kept = [k for k in range(steps + 1) if 2 * k > steps]
        rms = PosteriorBound(variance, variance).rms_second_half()
        assert rms[0] == pytest.approx(np.sqrt(np.mean(kept)))


def test_the_noise_gain_is_smooth_at_small_turns() -> None:
    def gain(half: float) -> np.ndarray:
        orbits = Orbits(np.zeros((1, 2)), np.ones(1), np.ones(1), np.zeros(1), 2.0 * half)
        return np.asarray(arc_noise_gain(orbits, 1.0)[0] / [1.0, 2.0 * half])

    np.testing.assert_allclose(gain(0.99e-4), gain(1.01e-4), rtol=0.03)


def test_exact_bearings_from_a_still_platform_have_a_steady_bound() -> None:
    still = small(
        orbit={"radius_m": 2.0, "angular_rate_rad_s": 2.0 * np.pi / 30.0},
        formation={"centers_m": [[-1.587, -1.081]]},
        landmarks_m=[[3, 3], [-1, 2], [-2, -1]],
        sensor={"range_m": 10, "bearing_sigma_rad": 0.001, "sample_time_s": 15.0},
        motion={"speed_sigma_mps": 0.0},
        window_s=90.0,
    )
    made = plan(still, steady=True)
    assert made.prediction.steady is not None
    assert made.prediction.steady[0] < 0.02


def test_a_short_window_does_not_hide_the_steady_bound() -> None:
    short = plan(changed("paper-grid-same", window_s=0.5), steady=True).prediction.steady
    whole = plan(example("paper-grid-same"), steady=True).prediction.steady
    assert short is not None
    assert whole is not None
    np.testing.assert_allclose(short, whole)


def test_unobservable_teams_have_no_steady_bound() -> None:
    for name in ("landmark-bridge", "triangle-alternate"):
        steady = plan(example(name), steady=True).prediction.steady
        assert steady is not None
        assert np.isinf(steady[-1])


# --- lumps of sightings ---------------------------------------------------------------------------

BIASES = {"speed_scale_sigma": 0.02, "turn_rate_bias_sigma_rad_s": 0.005}


def _grid(count: int, **keys: Any) -> Scenario:
    formation = {"shape": "grid", "count": count, "columns": 5, "spacing_m": 70.0}
    landmarks = [[-40.0, 0.0], [-40.0, 70.0]]
    return small(formation=formation, landmarks_m=landmarks, duration_s=100.0, **keys)


CASES = {
    "a grid": lambda: plan(_grid(20), bound="never"),
    "a grid with wind and biases": lambda: plan(
        _grid(10, motion=BIASES, wind={"sigma_mps": 1.0}), bound="never"
    ),
    "mixed radii and cameras": lambda: plan(example("mixed-radii-camera"), bound="never"),
    "a part that is not observable": lambda: plan(example("landmark-bridge"), bound="never"),
}


def _system(made: Plan, duration: float) -> ReferredSystem:
    team = made.team
    steps = round(duration / team.sensors.sample_time)
    return ReferredSystem.along(team, made.windows, steps, layout_of(team))


@pytest.mark.parametrize("name", CASES)
def test_lumps_of_one_sample_leave_out_nothing(name: str) -> None:
    system = _system(CASES[name](), 40.0)
    exact, run = system.bound(system.start), lumps.lumped(system.run, 64, 6, 1e9)
    bound = system.carried(system.known(after) for after in lumps._along(run, system.start))
    np.testing.assert_allclose(bound.position_variance, exact.position_variance, rtol=1e-4)
    np.testing.assert_allclose(bound.heading_variance, exact.heading_variance, rtol=1e-4)
    if exact.errors is not None and bound.errors is not None:
        np.testing.assert_allclose(bound.errors, exact.errors, rtol=1e-4)


@pytest.mark.parametrize("name", CASES)
def test_the_error_of_lumps_is_below_its_estimate(name: str) -> None:
    made = CASES[name]()
    exact = posterior_bound(made.team, made.windows, made.scenario.duration_s)
    found = posterior_bound(made.team, made.windows, made.scenario.duration_s, lumped=True)
    off = np.max(np.abs(found.rms_second_half() / exact.rms_second_half() - 1.0))
    assert exact.accuracy == 0.0
    assert 0.0 < off < found.accuracy < 0.05
    if "grid" in name:
        # placed at the first sample of each lump, rows would be off by more
        assert off < 0.003
    assert found.position_variance.shape == exact.position_variance.shape


# lumps of fixed length are further off than they state for the last two
@pytest.mark.parametrize("number", [*range(10), 41, 95])
def test_the_stated_accuracy_of_lumps_holds_for_teams_of_all_kinds(number: int) -> None:
    off, stated = lump_search.error_and_accuracy(lump_search.draw_team(number))
    assert off <= stated + lump_search.ROUNDING
    assert stated <= lumps.MOST_ERROR


def test_sharp_bearings_that_motion_noise_outruns_are_not_lumped() -> None:
    # by lumps of a sixteenth of a period the bound is 44 % too low: they determine the biases
    made = plan(load_scenario(HARD / "lumped-43.json"), bound="never")
    off, stated = lump_search.error_and_accuracy(made)
    assert off < lump_search.ROUNDING
    assert stated == 0.0


def test_rows_of_a_pair_are_lumped_within_a_contact_and_keep_their_information() -> None:
    system = _system(plan(_grid(10), bound="never"), 100.0)
    run = lumps.lumped(system.run, 19, 0, 1e9)
    assert len(run.rows.entries) < len(system.run.rows.entries) / 5

    def information(rows: Any) -> Any:
        dense = np.zeros((len(rows.entries), system.run.size))
        number = np.arange(len(dense))[:, None]
        np.add.at(dense, (number, rows.columns), rows.entries)
        return dense.T @ dense

    whole = information(system.run.rows)
    np.testing.assert_allclose(information(run.rows), whole, atol=1e-9 * whole.max())


def test_errors_that_change_are_predicted_exactly() -> None:
    accuracies = []
    for gusts in ({}, {"gust_sigma_mps": 0.2}):
        made = plan(_grid(10, wind={"sigma_mps": 1.0, **gusts}), bound="never")
        bound = posterior_bound(made.team, made.windows, 100.0, lumped=True)
        accuracies.append(bound.accuracy)
    assert accuracies[0] > accuracies[1] == 0.0


def test_a_large_team_is_predicted_by_lumps_on_request(monkeypatch: pytest.MonkeyPatch) -> None:
    given = small()
    exact = plan(given, bound="always").prediction
    monkeypatch.setattr(judged_team, "BOUND_WORK_LIMIT", 1.0)
    made = plan(given, bound="always")
    assert "lumped over up to 2 s, to an estimated" in made.prediction.note
    assert made.start_up is None
    assert exact.rms is not None
    assert made.prediction.rms == pytest.approx(exact.rms, rel=0.02)
    (finding,) = (one for one in made.verdict.findings if one.message == made.prediction.note)
    assert (finding.code, finding.level) == ("bound-estimated", "note")
