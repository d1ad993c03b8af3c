"""Flights as documents: figures over time, tracks, and what figures need of the plan."""

import json

import numpy as np
import pytest

from syncplan.flight.flying import flight_run
from syncplan.guidance.flight_records import RecordedSteps
from syncplan.reports.flight_report import FlightDocument, flight_document
from syncplan.reports.flight_series import FlightOverTime
from syncplan.reports.plan_report import plan_document
from tests.tools.flown import LOST_AT, short_flight
from tests.tools.on_paper import plan
from tests.tools.scenarios import example


@pytest.fixture(scope="module")
def report() -> FlightDocument:
    return flight_document(short_flight())


@pytest.fixture(scope="module")
def series(report: FlightDocument) -> FlightOverTime:
    assert report.series is not None
    return report.series


def test_a_report_with_series_is_read_back_as_it_was(report: FlightDocument) -> None:
    text = json.dumps(report.as_json())
    assert FlightDocument.model_validate_json(text) == report
    events = [(event.kind, event.subject, event.begin_s, event.end_s) for event in report.events]
    assert events == [("hold", "v2", 12.0, 18.0), ("loss", "v6", LOST_AT, None)]


def test_ellipses_are_the_filters_covariance(series: FlightOverTime) -> None:
    flight = short_flight()
    steps = RecordedSteps.of(96, 0.5, flight.plan.orbits.period)
    for track, kept in zip(series.tracks, flight.result.tracks, strict=True):
        assert track.trial == kept.trial
        for k, vehicle in enumerate(track.vehicles):
            stayed = steps.moments * 0.5 < (LOST_AT if vehicle.name == "v6" else np.inf)
            assert len(vehicle.ellipses) == stayed.sum()
            for one, covariance in zip(vehicle.ellipses, kept.covariances[stayed, k], strict=True):
                cos, sin = np.cos(one.angle_rad), np.sin(one.angle_rad)
                turn = np.array([[cos, -sin], [sin, cos]])
                axes = np.diag([one.major_sigma_m**2, one.minor_sigma_m**2])
                xx, yy, xy = covariance
                np.testing.assert_allclose(turn @ axes @ turn.T, [[xx, xy], [xy, yy]], atol=1e-4)
                assert one.major_sigma_m >= one.minor_sigma_m
                place = series.track_time_s.index(one.time_s)
                estimated = vehicle.estimated_x_m[place], vehicle.estimated_y_m[place]
                assert one.center_m == estimated


def test_values_end_where_a_vehicle_is_lost(series: FlightOverTime) -> None:
    lost = next(one for one in series.vehicles if one.name == "v6")
    for values in (lost.tracking_rms_m, lost.phase_rms_s, lost.rms_m, lost.sigma_m, lost.bound_m):
        for time, value in zip(series.time_s, values, strict=True):
            assert (value is None) == (time >= LOST_AT)
    stayed = series.vehicles[0]
    assert None not in [*stayed.tracking_rms_m, *stayed.bound_m]


def test_phase_tolerances_without_series_are_the_least_of_the_plans_links() -> None:
    chain = plan(example("mixed-radii-camera"), bound="never")
    run = flight_run(chain, trials=1, duration=2.0, filter="ekf")
    flown = flight_document(run.concluded([run.part(0, 1, threads=1)]))
    assert "series" not in flown.as_json()
    links = plan_document(chain).links
    differ = 0
    for vehicle in flown.vehicles:
        own = [one.phase_tolerance_s for one in links if vehicle.name in (one.a, one.b)]
        assert vehicle.phase_tolerance_s == pytest.approx(min(own), rel=1e-12)
        differ += max(own) > 1.01 * min(own)
    assert differ


def test_separations_are_those_of_the_trials(report: FlightDocument) -> None:
    least, each = report.least_separation_m, short_flight().result.figures.separations
    assert least is not None
    assert (least.quantiles[0], least.quantiles[-1]) == (each.min(), each.max())
    assert least.quantiles[20] == least.median
    assert least.asked == 22.0
    assert np.mean(np.array(each) < 22.0) == least.below_asked_share


def test_the_ground_is_the_plans(series: FlightOverTime) -> None:
    ground, planned = series.ground, short_flight().plan
    assert [circle.name for circle in ground.circles] == planned.scenario.vehicle_names
    np.testing.assert_allclose(
        [circle.center_m for circle in ground.circles], planned.orbits.centers
    )
    np.testing.assert_allclose(
        [circle.phase_rad for circle in ground.circles], planned.orbits.phases
    )
    np.testing.assert_allclose(
        [landmark.position_m for landmark in ground.landmarks], planned.landmarks
    )
    assert ground.keep_out_m == planned.scenario.keep_out_m
