"""Events by their texts, and the texts that are refused in one line each."""

import re
from typing import Any

import pytest

from syncplan.errors import InputError
from syncplan.flight.flying import flight_run
from syncplan.guidance.flight_events import FlightEvents, events_of
from syncplan.guidance.flight_options import DEFAULT_GATE, FlightOptions
from tests.tools.scenarios import changed, example, small

DURATION = 400.0


def _events(lose: Any = (), hold: Any = ()) -> FlightEvents:
    return events_of(FlightOptions(lose=lose, hold=hold), example("boats"), DURATION)


def test_events_are_what_their_texts_say_in_order_of_time() -> None:
    found = _events(("v3@60", "sensor:v4@10", "lighthouse@0"), ("v2@100:20.5", "v1@5:1"))
    assert [(one.name, one.time) for one in found.losses] == [
        ("lighthouse", 0.0),
        ("sensor:v4", 10.0),
        ("v3", 60.0),
    ]
    assert found.losses[0].loss.landmarks == (0,)
    assert found.losses[1].loss.sensors == (3,)
    assert found.losses[2].loss.vehicles == (2,)
    assert [(one.name, one.vehicle, one.time, one.length) for one in found.holds] == [
        ("v1", 0, 5.0, 1.0),
        ("v2", 1, 100.0, 20.5),
    ]
    assert found.sentences == [
        "lighthouse is lost at 0 s",
        "v1 is held from 5 s for 1 s",
        "the sensor of v4 is lost at 10 s",
        "v3 is lost at 60 s",
        "v2 is held from 100 s for 20.5 s",
    ]


def test_a_vehicle_may_be_held_again_and_lost_after() -> None:
    found = _events(("v2@40",), ("v2@10:5", "v2@15:5", "v2@30:10"))
    assert len(found.holds) == 3


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ("v3", "lose: 'v3' has no time; give it as v3@60, in s"),
        ("v33@60", "lose: 'v33': is neither a vehicle (v1, v2, v3, v4, v5, v6, ... v20) nor a"),
        ("v3@-1", "lose: v3@-1: -1 s is outside the flight, which is from 0 to 400 s; give one"),
        ("v3@400", "lose: v3@400: 400 s is outside the flight"),
        ("v3@399.6", "lose: v3@399.6: the last sample of the flight begins at 399.5 s; give a"),
        ("v3@nan", "lose: 'v3@nan': 'nan' is not a number of seconds; give it as v3@60"),
        ("v3@soon", "lose: 'v3@soon': 'soon' is not a number of seconds; give it as v3@60"),
        ("v3@10 v3@20", "lose: v3: stands twice; name it once"),
        ("v2@100", "hold: 'v2@100' is not a hold; give it as v2@100:20, from 100 s for 20 s"),
        ("v2:20", "hold: 'v2:20' is not a hold"),
        ("v22@100:20", "hold: v22@100:20: no vehicle is named v22; vehicles are v1 to v20"),
        ("v2@400:20", "hold: v2@400:20: 400 s is outside the flight"),
        ("v2@100:0", "hold: v2@100:0: 0 s is not a length; give more than 0 s"),
        (
            "v2@390:20",
            "hold: v2@390:20: ends at 410 s, after the flight of 400 s; give at most v2@390:10",
        ),
        (
            "v2@30.1:0.3",
            "hold: v2@30.1:0.3: no sample begins in this time; samples are 0.5 s long, give a",
        ),
        (
            "v2@100:nan",
            "hold: 'v2@100:nan': 'nan' is not a number of seconds; give it as v2@100:20",
        ),
        ("v2@x:5", "hold: 'v2@x:5': 'x' is not a number of seconds; give it as v2@100:20"),
    ],
)
def test_what_is_no_loss_and_no_hold_is_refused_in_one_line(texts: str, message: str) -> None:
    key = message.partition(":")[0]
    with pytest.raises(InputError, match=f"^{re.escape(message)}") as error:
        _events(**{key: texts.split()})
    assert "\n" not in str(error.value)


def test_a_hold_may_end_with_the_flight_and_a_loss_be_of_its_last_sample() -> None:
    found = _events(("v3@399.5",), ("v2@390:10", "v1@399.5:0.5"))
    assert [one.time + one.length for one in found.holds] == [400.0, 400.0]
    assert [one.time for one in found.losses] == [399.5]


@pytest.mark.parametrize("time", [60.0, 60.02, 59.95])
def test_what_rounds_to_no_sample_of_the_flight_is_refused(time: float) -> None:
    """Of 60.05 s, 600 samples of 0.1 s: the last begins at 59.9 s."""
    scenario = example("paper-grid-same")
    problem = f"L1@{time:g}: the last sample of the flight begins at 59.9 s; give a time up to then"
    with pytest.raises(InputError, match=f"^lose: {re.escape(problem)}$"):
        events_of(FlightOptions(lose=(f"L1@{time:g}",)), scenario, 60.05)
    assert events_of(FlightOptions(lose=("L1@59.9",)), scenario, 60.05).losses


def test_sightings_that_never_arrive_are_refused() -> None:
    scenario = example("paper-grid-same")
    problem = "600 given, the flight has 600 samples; give fewer"
    with pytest.raises(InputError, match=f"^late: {problem}$"):
        flight_run(scenario, late=600, duration=60.0)
    assert not events_of(FlightOptions(late=599), scenario, 60.0).sentences


def test_mistaken_sightings_need_another_vehicle_to_be_of() -> None:
    message = "^mistaken: 0.1 given, but no other vehicle could be sighted instead; leave it out$"
    landmarks = [[30.0, 0.0], [0.0, 30.0]]
    alone = small(formation={"centers_m": [[0.0, 0.0]]}, landmarks_m=landmarks)
    pair = small(formation={"centers_m": [[0.0, 0.0], [50.0, 0.0]]})
    mistaken = FlightOptions(mistaken=0.1)
    for scenario in (alone, pair.model_copy(update={"landmarks_m": []})):
        with pytest.raises(InputError, match=message):
            events_of(mistaken, scenario, 10.0)
        events_of(FlightOptions(outliers=0.1), scenario, 10.0)
    beside = small(formation={"centers_m": [[0.0, 0.0], [50.0, 0.0]]}, landmarks_m=landmarks)
    events_of(mistaken, beside, 10.0)


def test_nobody_is_held_twice_at_a_time_or_when_lost() -> None:
    with pytest.raises(InputError, match=r"^hold: v2 is held twice at 29 s; give one hold$"):
        _events((), ("v2@29:5", "v2@10:20"))
    with pytest.raises(InputError, match=r"^hold: v2 is lost at 15 s; end its hold before$"):
        _events(("v2@15",), ("v2@10:5.5",))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"guidance": "luck"}, "guidance: 'luck' is unknown; choose track or mpc or none"),
        ({"filter": "ideal"}, "filter: ideal needs the truth, which no flight has; choose another"),
        ({"filter": "kalman"}, "filter: 'kalman' is unknown"),
        ({"dropout": 1.0}, "dropout: 1 given; allowed is at least 0 and less than 1"),
        ({"outliers": -0.1}, "outliers: -0.1 given; allowed is at least 0 and less than 1"),
        ({"mistaken": float("nan")}, "mistaken: nan given; allowed is at least 0 and less than 1"),
        ({"outliers": 0.5, "mistaken": 0.5}, "outliers: together with mistaken this is 1 or more"),
        ({"late": -1}, "late: -1 given; allowed is 0 to 1000"),
        ({"late": 1001}, "late: 1001 given; allowed is 0 to 1000"),
        ({"wind": (1.0, float("inf"))}, "wind: (1.0, inf) is not a velocity; give x,y in m/s"),
        ({"wind": (1.0, 2.0, 3.0)}, "wind: (1.0, 2.0, 3.0) is not a velocity; give x,y in m/s"),
        ({"lose": "v3@60"}, "lose: 'v3@60': must be a list of texts, such as ['v3@60']"),
        ({"hold": "v3@60:5"}, "hold: 'v3@60:5': must be a list of texts, such as ['v2@100:20']"),
        ({"trials": 0}, "trials: 0 given"),
    ],
)
def test_options_out_of_range_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        FlightOptions(**options)


def test_a_scenario_that_asks_for_the_ideal_filter_is_not_flown_by_it() -> None:
    scenario = changed("paper-grid-same", filter={"kind": "ideal"})
    with pytest.raises(
        InputError, match=r"^filter: ideal needs the truth, which no flight has; choose another"
    ):
        flight_run(scenario)


def test_false_sightings_bring_a_gate_unless_one_is_given() -> None:
    assert FlightOptions().gate_probability is None
    assert FlightOptions(dropout=0.5).gate_probability is None
    assert FlightOptions(outliers=0.1).gate_probability == DEFAULT_GATE
    assert FlightOptions(mistaken=0.1).gate_probability == DEFAULT_GATE
    assert FlightOptions(mistaken=0.1, gate_probability=0.99).gate_probability == 0.99


def test_a_plan_is_flown_by_the_filter_of_its_scenario_or_else_robust() -> None:
    quick: dict[str, Any] = {"duration": 10.0}
    assert flight_run(example("paper-grid-same"), **quick).options.filter == "robust"
    asked = changed("paper-grid-same", filter={"kind": "second-order"})
    assert flight_run(asked, **quick).options.filter == "second-order"
    assert flight_run(asked, filter="ekf", **quick).options.filter == "ekf"


def test_a_flight_is_at_least_a_sample_long() -> None:
    with pytest.raises(InputError, match=r"^duration: 0.01 s given; at least one sample time"):
        flight_run(example("paper-grid-same"), duration=0.01)
