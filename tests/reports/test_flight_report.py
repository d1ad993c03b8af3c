"""The report of a flight says what was flown, and by what means."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from syncplan.flight.flying import fly
from syncplan.planning.plan_flights import Flight
from syncplan.reports.flight_report import FlightDocument, flight_document
from tests.tools.on_paper import plan
from tests.tools.scenarios import small

BRIEF: dict[str, Any] = {"trials": 2, "duration": 12.0, "threads": 1}
WRONG: dict[str, Any] = {"dropout": 0.3, "outliers": 0.1, "mistaken": 0.05, "late": 3}


def flown(options: dict[str, Any], **keys: object) -> Flight:
    return fly(plan(small(**keys), pilot=False), **BRIEF, **options)


def notes(flight: Flight) -> str:
    return "\n".join(flight_document(flight).notes)


@pytest.fixture(scope="module")
def calm() -> Flight:
    return flown({})


@pytest.fixture(scope="module")
def troubled() -> Flight:
    # of two vehicles alone, no sighting could be of another
    return flown({**WRONG, "wind": (0.3, 0.0)}, landmarks_m=[[30.0, 0.0], [0.0, 30.0]])


@pytest.fixture(scope="module")
def predicted() -> Flight:
    return flown({"guidance": "mpc"})


def test_conditions_are_those_asked_for(calm: Flight, troubled: Flight) -> None:
    given = flight_document(troubled)
    assert given.conditions.model_dump() == {**WRONG, "wind_mps": (0.3, 0.0)}
    assert given.filter.gate_probability == 0.9999
    assert (
        "in every trial 30 % of the sightings are lost on their way, 10 % of the bearings are "
        "false, 5 % of the sightings are of another vehicle, if one is in sight, sightings arrive "
        "3 samples late, the wind is 0.3, 0 m/s"
    ) in given.notes
    none = flight_document(calm)
    nothing = {"dropout": 0.0, "outliers": 0.0, "mistaken": 0.0, "late": 0, "wind_mps": None}
    assert none.conditions.model_dump() == nothing
    assert "in every trial" not in notes(calm)
    assert FlightDocument.model_validate(given.as_json()) == given


def test_a_wind_that_the_filter_does_not_know_is_noted(calm: Flight, troubled: Flight) -> None:
    words = "the wind is no state of the filter"
    assert words in notes(troubled)
    assert words not in notes(calm)
    assert words not in notes(flown({"wind": (0.0, 0.0)}))
    known = flown({"wind": (0.3, 0.0)}, wind={"sigma_mps": 0.5})
    assert words not in notes(known)
    # said once where a wind is stated that the filter leaves out
    left_out = flown({"wind": (0.3, 0.0)}, wind={"sigma_mps": 0.5}, filter={"estimate": "none"})
    assert words not in notes(left_out)
    assert "the filter does not estimate wind" in notes(left_out)


def test_limits_are_noted_one_by_one_where_they_are_supposed() -> None:
    speeds, turns = {"speed_mps": [2.0, 6.0]}, {"turn_rate_rad_s": 0.9}
    for limits, origins in (
        ({}, ("default", "default")),
        (speeds, ("scenario", "default")),
        (turns, ("default", "scenario")),
    ):
        flight = flown({}, limits=limits or None)
        model = flight_document(flight).vehicle_model
        assert (model.speed_from, model.turn_rate_from) == origins
        said = notes(flight)
        assert ("no limits.speed_mps" in said) == (origins[0] == "default")
        assert ("no limits.turn_rate_rad_s" in said) == (origins[1] == "default")


def test_programs_that_were_not_solved_are_counted(calm: Flight, predicted: Flight) -> None:
    assert [one.refused_share for one in flight_document(calm).vehicles] == [None, None]
    figures = predicted.result.figures
    shares = [one.refused_share for one in flight_document(predicted).vehicles]
    assert shares == figures.refused.mean(axis=0).tolist()
    for refused, named in ((np.zeros((2, 2)), False), (np.array([[0.0, 0.1], [0.0, 0.3]]), True)):
        result = replace(predicted.result, figures=replace(figures, refused=refused))
        said = notes(replace(predicted, result=result))
        assert ("was not solved in up to 20 % of a vehicle's decisions (v2)" in said) == named
        assert ("was not solved" in said) == named


def test_states_that_are_no_poses_have_the_bound_along_the_path() -> None:
    flight = flown({}, wind={"sigma_mps": 0.5})
    errors = flight_document(flight).errors
    assert errors is not None
    assert [one.state for one in errors] == ["wind x", "wind y"]
    for k, one in enumerate(errors):
        squares = flight.result.figures.state_bound_squares[:, k]
        assert one.bound_rms == pytest.approx(np.sqrt(squares.mean()))
        assert one.ratio == pytest.approx(one.rms_second_half / one.bound_rms)
        assert "predicted_rms" not in one.model_dump()


def test_what_flights_do_not_look_at_is_noted(calm: Flight) -> None:
    square = [[-90.0, -90.0], [190.0, -90.0], [190.0, 130.0], [-90.0, 130.0]]
    corner = [[-80.0, -80.0], [-75.0, -80.0], [-75.0, -75.0]]
    assert "flights do not check" not in notes(calm)
    assert "flights do not check area_m:" in notes(flown({}, area_m=square))
    both = flown({}, area_m=square, keep_out_m=[corner])
    assert "flights do not check area_m and keep_out_m:" in notes(both)
