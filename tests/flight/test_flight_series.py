"""Flights over time: sums over trials and tracks say what the figures of the trials say."""

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.errors import InputError
from syncplan.flight.flying import flight_run
from syncplan.guidance.flight_options import FlightOptions
from syncplan.guidance.flight_records import MOMENTS, MOST_TIMES, RecordedSteps, tracked_trials
from syncplan.guidance.flight_results import FlightResult
from syncplan.guidance.flights import FlightSeries, mean_series
from syncplan.planning.plan_flights import FlightRun
from syncplan.planning.plans import Plan
from tests.tools.on_paper import plan
from tests.tools.scenarios import changed

OPTIONS = FlightOptions(
    trials=20, seed=3, filter="ekf", lose=("v6@30",), with_series=True, duration=48.0
)


def _grid(sample_time: float, rate: float) -> Plan:
    orbit, sensor = {"angular_rate_rad_s": rate}, {"sample_time_s": sample_time}
    return plan(changed("paper-grid-same", orbit=orbit, sensor=sensor), bound="never")


@pytest.fixture(scope="module")
def run() -> FlightRun:
    """Samples so few that each is recorded."""
    return flight_run(_grid(0.5, 0.2), OPTIONS)


@pytest.fixture(scope="module")
def whole(run: FlightRun) -> FlightResult:
    return run.part(0, run.trials, threads=1)


@pytest.fixture(scope="module")
def found(run: FlightRun, whole: FlightResult) -> FlightSeries:
    return mean_series(run.team, whole)


@given(st.integers(1, 30_000), st.floats(0.01, 2.0), st.floats(5.0, 500.0))
def test_recorded_steps_are_few_in_order_and_moments_are_among_those_of_tracks(
    steps: int, sample_time: float, period: float
) -> None:
    recorded = RecordedSteps.of(steps, sample_time, period)
    for of in (recorded.tracks, recorded.series, recorded.moments):
        assert of[0] >= 0
        assert of[-1] <= steps
        assert (np.diff(of) > 0).all()
    assert len(recorded.series) <= MOST_TIMES
    assert len(recorded.moments) <= MOMENTS
    assert np.isin(recorded.series, recorded.tracks).all()
    assert np.isin(recorded.moments, recorded.tracks).all()
    np.testing.assert_array_equal(recorded.series, recorded.every * np.arange(len(recorded.series)))


def test_moments_go_once_round_the_circle_as_the_run_goes_on() -> None:
    sample_time, period = 0.1, 30.0
    at = RecordedSteps.of(4000, sample_time, period).moments * sample_time
    assert len(at) == MOMENTS
    share = at / period % 1.0
    np.testing.assert_allclose(share[:-1], np.arange(1, MOMENTS) / MOMENTS, atol=1.0 / 60.0)
    assert at[0] < 60.0
    assert at[-1] > 4000 * sample_time - 2.0 * period


def test_the_second_half_of_the_series_is_what_the_trials_say(
    run: FlightRun, whole: FlightResult, found: FlightSeries
) -> None:
    stayed, figures = np.arange(5), whole.figures
    late = 2 * np.arange(run.team.steps + 1) > run.team.steps
    assert len(found.times) == run.team.steps + 1
    estimates = whole.estimates.late_mean_squares[..., :2].sum(axis=2)
    for series, squares in (
        (found.tracking, figures.tracking_squares),
        (found.phase, figures.phase_squares),
        (found.bound, figures.bound_squares),
        (found.error, estimates),
    ):
        np.testing.assert_allclose(
            np.mean(series[late] ** 2, axis=0)[stayed], squares.mean(axis=0)[stayed], rtol=1e-9
        )


def test_the_series_begins_as_the_plan_says(run: FlightRun, found: FlightSeries) -> None:
    sigma = run.plan.noise.position_sigma
    np.testing.assert_allclose(found.sigma[0], np.sqrt(2.0) * sigma, rtol=1e-12)
    np.testing.assert_allclose(found.bound[0], np.sqrt(2.0) * sigma, rtol=1e-12)
    # the estimate starts at the plan: what one is off, the other is
    np.testing.assert_allclose(found.tracking[0], found.error[0], rtol=1e-12)


def test_a_vehicle_that_is_gone_has_no_series_and_no_track(
    whole: FlightResult, found: FlightSeries
) -> None:
    gone = found.times >= 30.0
    for one in fields(FlightSeries)[1:]:
        values = getattr(found, one.name)
        np.testing.assert_array_equal(np.isnan(values[:, 5]), gone)
        assert np.isfinite(values[:, :5]).all()
    for track in whole.tracks:
        np.testing.assert_array_equal(np.isnan(track.true[:, 5, 0]), gone)
        np.testing.assert_array_equal(np.isnan(track.estimated[:, 5, 0]), gone)


def test_tracks_end_where_the_trials_end(run: FlightRun, whole: FlightResult) -> None:
    assert [track.trial for track in whole.tracks] == [0, 1, 2]
    for track in whole.tracks:
        off = (track.estimated - track.true)[-1, :5]
        np.testing.assert_allclose(
            off, whole.estimates.final_errors[track.trial, :5, :2], rtol=0.0, atol=1e-9
        )


def test_ellipses_are_the_filters_own_sigma(run: FlightRun) -> None:
    few = flight_run(run.plan, OPTIONS, trials=tracked_trials(6))
    result = few.part(0, few.trials)
    own = np.mean([t.covariances[..., 0] + t.covariances[..., 1] for t in result.tracks], axis=0)
    steps = RecordedSteps.of(few.team.steps, few.team.setup.time, few.plan.orbits.period)
    sigma = mean_series(few.team, result).sigma[np.searchsorted(steps.series, steps.moments)]
    np.testing.assert_allclose(np.sqrt(own), sigma, rtol=1e-12)
    across = result.tracks[0].covariances
    assert (across[..., 2] ** 2 <= across[..., 0] * across[..., 1])[:, :5].all()


@pytest.mark.parametrize("guidance", ["track", "mpc"])
def test_looking_at_a_flight_does_not_change_it(guidance: str) -> None:
    """Looks fall between decisions, whose number stays as it is."""
    quick, options = _grid(0.1, 0.4), FlightOptions(trials=2, duration=10.0, guidance=guidance)
    plain, looked_at = (
        flight_run(quick, options, with_series=wanted).part(0, 2) for wanted in (False, True)
    )
    for name in ("tracking_squares", "bound_squares", "separations", "refused"):
        one, two = (getattr(of.figures, name) for of in (plain, looked_at))
        np.testing.assert_allclose(one, two, rtol=1e-6)
    assert looked_at.branches
    assert not plain.branches
    assert not plain.tracks


def test_a_flight_without_series_says_how_to_get_one(run: FlightRun) -> None:
    plain = flight_run(run.plan, trials=1, duration=2.0)
    with pytest.raises(InputError, match="with_series=True"):
        mean_series(plain.team, plain.part(0, 1))
