"""Whole flights: what their figures mean."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from syncplan.errors import NoSolutionError
from syncplan.flight.flying import flight_run, fly
from syncplan.guidance.flight_results import FlightResult
from syncplan.guidance.flown_figures import _settled
from syncplan.planning.plan_flights import Flight
from syncplan.planning.plans import Plan
from syncplan.reports.flight_report import flight_document
from tests.tools.on_paper import plan
from tests.tools.scenarios import document, small

QUICK: dict[str, Any] = {
    "orbit": {"radius_m": 10.0, "angular_rate_rad_s": 0.8, "direction": "ccw"},
    "formation": {"centers_m": [[0.0, 0.0], [35.0, 0.0], [35.0, 35.0]]},
    "landmarks_m": [[-15.0, 5.0], [50.0, 20.0]],
    "sensor": {"range_m": 27.0, "bearing_sigma_rad": 0.05, "sample_time_s": 0.1},
    "initial_sigma": {"position_m": 2.0, "heading_rad": 0.1},
    "wind": {"sigma_mps": 0.5, "gust_sigma_mps": 0.1},
    "duration_s": 20.0,
}
"""Three vehicles with a period of 8 s: batch solutions at 8 and 16 s."""

TRIALS = 36
OPTIONS: dict[str, Any] = {"dropout": 0.2, "lose": ("v3@14",), "hold": ("v2@4:2",), "seed": 5}


@pytest.fixture(scope="module")
def made() -> Plan:
    return plan(small(**QUICK), pilot=False)


@pytest.fixture(scope="module")
def flight(made: Plan) -> Flight:
    return fly(made, trials=TRIALS, threads=1, **OPTIONS)


@pytest.mark.parametrize(
    ("filter_", "tolerance"),
    [
        ("second-order", 1e-9),  # sightings that others make change the order of sums
        ("robust", 5e-3),  # and where the batch solution begins, which ends when close enough
    ],
)
def test_a_trial_does_not_depend_on_those_beside_it(
    made: Plan, filter_: str, tolerance: float
) -> None:
    options: dict[str, Any] = {**OPTIONS, "filter": filter_, "threads": 1}
    alone, beside = (fly(made, trials=count, **options).result for count in (17, 20))
    of_estimates = ("mean_squares", "late_mean_squares", "nis_sums")
    of_figures = ("tracking_squares", "bound_squares", "separations", "kept_meetings", "saturated")
    for name in (*of_estimates, *of_figures):
        parts = [one.estimates if name in of_estimates else one.figures for one in (alone, beside)]
        found, wanted = (getattr(part, name)[16] for part in parts)
        np.testing.assert_allclose(found, wanted, rtol=tolerance, atol=1e-12)


def test_progress_counts_all_trials(made: Plan) -> None:
    done: list[int] = []
    fly(made, trials=20, duration=2.0, threads=1, progress=done.append)
    assert done == [16, 20]


def test_a_filter_is_lost_where_an_error_is_five_times_its_bound(flight: Flight) -> None:
    n, trials = flight.plan.team.count, flight.result.trials
    bounds = np.full((trials, n), 4.0)
    squares = np.ones((trials, n, 3))
    squares[3, 1] = [49.0, 51.5, 0.0]  # 100.5 of 100 m^2
    squares[4, 1] = [49.0, 50.5, 900.0]
    estimates = replace(flight.result.estimates, late_mean_squares=squares)
    figures = replace(flight.result.figures, bound_squares=bounds)
    found = replace(flight, result=FlightResult(estimates, figures))
    assert np.flatnonzero(found.filter_lost).tolist() == [3]


def test_a_vehicle_is_out_of_contact_after_two_periods_without_a_sighting(flight: Flight) -> None:
    period = flight.plan.orbits.period
    unseen = np.zeros((flight.result.trials, 3))
    unseen[2, 0], unseen[5, 2] = 2.0 * period + 0.1, 2.0 * period - 0.1
    figures = replace(flight.result.figures, longest_unseen=unseen)
    found = replace(flight, result=FlightResult(flight.result.estimates, figures))
    assert np.flatnonzero(found.out_of_contact).tolist() == [2]


def test_a_filter_that_breaks_down_is_said_to(made: Plan) -> None:
    run = flight_run(made, trials=4, duration=2.0)
    part = run.part(0, 4, threads=1)
    broken = part.estimates.mean_squares.copy()
    broken[2, 0, 0] = np.nan
    part = replace(part, estimates=replace(part.estimates, mean_squares=broken))
    with pytest.raises(NoSolutionError, match=r"^the filter diverged in 1 of 4 trials"):
        run.concluded([part])


def test_a_prediction_is_for_the_plans_own_duration(flight: Flight, made: Plan) -> None:
    assert flight.predicted is not None
    assert fly(made, trials=1, duration=2.0, threads=1).predicted is None


def test_a_held_vehicle_is_back_when_it_keeps_its_phase_for_a_period(made: Plan) -> None:
    run = flight_run(made, hold=("v2@4:2",))
    period, ahead = 79, np.zeros((201, 3, 4))
    ahead[40:90, 1, 0] = -2.0
    ahead[40:90, 1, 1] = -2.0
    ahead[100, 1, 1] = 1.5  # off again within a period
    ahead[:, 1, 2] = 1.1
    ahead[:, 0, 3] = 9.0  # another vehicle
    found = _settled(run.team, ahead)[:, 0]
    assert 0.1 * period == pytest.approx(made.orbits.period, abs=0.1)
    np.testing.assert_allclose(found, [3.0, 4.1, np.nan, 0.0])


def test_speeds_of_a_hold_are_not_those_that_a_vehicle_needs(made: Plan) -> None:
    held = fly(made, trials=1, hold=("v2@12:2", "v3@2:18"), threads=1)
    least, most = (getattr(held.result.figures, name)[0] for name in ("slowest", "fastest"))
    assert least[1] > 1.0
    assert least[2] == most[2] == made.orbits.speeds[2]


def test_a_vehicle_that_is_lost_before_it_is_back_never_was(made: Plan) -> None:
    found = [
        _settled(
            flight_run(made, hold=("v2@4:2",), lose=(f"v2@{time}",)).team, np.zeros((201, 3, 1))
        )
        for time in (13.8, 14.0)
    ]
    np.testing.assert_array_equal(np.ravel(found), [np.nan, 0.0])


def test_a_report_says_where_too_little_is_left_to_say_if_a_vehicle_is_back(made: Plan) -> None:
    held = fly(made, trials=1, threads=1, hold=("v2@4:2", "v1@10:3"))
    notes = flight_document(held).notes
    (short,) = [one for one in notes if "less than a period" in one]
    assert short == (
        "v1 is held from 10 s for 3 s: less than a period, 7.85 s, is left, too little to say when "
        "it has its phase again"
    )
    assert "a vehicle that is held stands still in the air, and drifts with the wind" in notes


def test_a_report_says_that_who_has_a_least_speed_circles_when_held() -> None:
    least = small(**QUICK, limits={"speed_mps": [4.0, 12.0]})
    notes = flight_document(fly(least, trials=1, duration=4.0, threads=1, hold=("v2@1:2",))).notes
    (held,) = [one for one in notes if "is held circles" in one]
    assert held == (
        "a vehicle that is held circles at its least speed and largest turn rate in the air, and "
        "drifts with the wind"
    )
    plain = flight_document(fly(least, trials=1, duration=4.0, threads=1)).notes
    assert not [one for one in plain if "held" in one]


def test_sightings_of_another_vehicle_are_said_to_be_of_one(made: Plan) -> None:
    run = flight_run(made, mistaken=0.01)
    assert run.happenings == ["1 % of the sightings are of another vehicle, if one is in sight"]


def _whole(subject: Any, **options: Any) -> dict[str, Any]:
    """The report, which has no NaN and no infinity; the data frame has its rows."""
    flight = fly(subject, threads=1, **options)
    text = json.dumps(flight_document(flight).model_dump(mode="json"), allow_nan=False)
    frame = flight.to_dataframe()
    assert len(frame) == flight.plan.team.count
    assert list(frame["name"]) == flight.plan.scenario.vehicle_names
    found: dict[str, Any] = json.loads(text)
    return found


def test_reports_have_numbers_or_null_whatever_is_lost(made: Plan) -> None:
    found = _whole(made, trials=3, lose=("v1@0", "sensor:v2@10"), hold=("v3@19:1",))
    assert found["vehicles"][0]["errors"] is None
    assert found["vehicles"][1]["errors"] is not None
    assert [one["event"] for one in found["events"]] == ["v1@0", "sensor:v2@10", "v3@19:1"]
    assert found["events"][2]["settled_s"] is None
    assert found["wind_error_mps"] > 0.0
    assert found["least_separation_m"]["between"] == ["v2", "v3"]


def test_a_vehicle_alone_has_nobody_to_come_close_to() -> None:
    alone = document(
        formation={"centers_m": [[0.0, 0.0]]},
        landmarks_m=[[30.0, 0.0], [0.0, 30.0]],
        duration_s=10.0,
    )
    found = _whole(alone, trials=2)
    assert found["least_separation_m"] is None
    assert found["events"] == []


def test_a_run_of_less_than_a_period_has_no_meetings(made: Plan) -> None:
    found = _whole(made, trials=2, duration=3.0)
    assert found["links"] == []
    assert [one["meetings_kept"] for one in found["vehicles"]] == [None] * 3


def test_a_report_says_what_was_flown(flight: Flight) -> None:
    found = flight_document(flight)
    figures, there = flight.result.figures, [0, 1]
    assert found.trials == TRIALS
    assert found.filter.kind == "robust"
    assert found.guidance == "track"
    assert found.least_separation_m is not None
    assert found.least_separation_m.worst == figures.separations.min()
    assert found.least_separation_m.median == np.median(figures.separations)
    for k in there:
        errors = found.vehicles[k].errors
        assert errors is not None
        late = flight.result.estimates.late_mean_squares[:, k, :2].sum(axis=1)
        assert errors.rms_second_half_m == pytest.approx(np.sqrt(late.mean()))
        assert errors.bound_rms_m == pytest.approx(np.sqrt(figures.bound_squares[:, k].mean()))
        assert errors.rms_over_bound == pytest.approx(errors.rms_second_half_m / errors.bound_rms_m)
    planned = figures.planned_meetings
    assert planned.sum() > 0
    for link in found.links:
        assert 0.0 <= link.kept_share <= 1.0
    assert [one.what for one in found.events] == [
        "v2 is held from 4 s for 2 s",
        "v3 is lost at 14 s",
    ]
