"""Flights as jobs: what may be asked for, and batches that come to the library's bytes."""

import json
from dataclasses import asdict, fields, replace
from functools import cache
from typing import Any

import pytest

from api.computing.tasks import (
    checked_request,
    computed_batch,
    concluded_job,
    made_plan,
    measured_runs,
)
from api.job_kinds.job_kind import Batch, JobSpec
from api.job_kinds.job_table import JOB_KINDS
from api.service import limits_of
from api.settings import load_settings
from syncplan.errors import InputError
from syncplan.flight.flying import fly
from syncplan.guidance.flight_options import GUIDANCES, FlightOptions
from syncplan.guidance.flight_results import unpack_flight
from syncplan.reports.flight_report import flight_document
from syncplan.runtime.files import as_text
from tests.tools.scenarios import FILES, document, example

FlightRequest = JOB_KINDS["flight"].request

LIMITS = limits_of(load_settings())
EVERY = FlightOptions(
    trials=20,
    seed=3,
    duration=12.0,
    filter="paper",
    substeps=3,
    gate_probability=0.99,
    guidance="none",
    lose=("v6@6", "sensor:v5@3", "L1@9"),
    hold=("v2@2:3",),
    dropout=0.1,
    outliers=0.05,
    mistaken=0.02,
    late=2,
    wind=(0.5, -0.25),
)


@cache
def plan_text() -> str:
    return made_plan((FILES / "paper-grid-same.yaml").read_bytes(), "yaml", LIMITS, False).text


def asked(limits: Any = LIMITS, **request: Any) -> tuple[str, int]:
    return checked_request("flight", json.dumps(request).encode(), "json", limits, plan_text())


# --- requests -----------------------------------------------------------------------------------


def test_keywords_requests_and_options_of_a_flight_have_the_same_names() -> None:
    keys = FlightOptions.request_keys()
    assert list(keys) == [field.name for field in fields(FlightOptions)]
    assert {*keys.values()} - {"model"} == set(FlightRequest.model_fields)


def test_a_request_holds_every_option_of_a_flight_and_gives_it_back() -> None:
    for options in (FlightOptions(), EVERY):
        # as JSON has it, which knows no tuples
        request = json.loads(json.dumps(options.as_request()))
        assert FlightOptions.of_request(request) == options
        assert FlightRequest.model_validate(request).options() == options


def test_a_flight_is_asked_for_with_the_defaults_of_the_library() -> None:
    request, work = asked()
    assert work == FlightOptions().trials
    assert FlightOptions.of_request(json.loads(request)) == FlightOptions()


@pytest.mark.parametrize(
    ("request_", "key", "problem"),
    [
        ({"lose": ["v9@10"]}, "lose", "'v9': is neither a vehicle (v1, v2, v3"),
        ({"lose": ["v1@30"], "duration_s": 20}, "lose", "which is from 0 to 20 s"),
        ({"hold": ["v1@190:20"]}, "hold", "v1@190:20: ends at 210 s, after the flight of 200 s"),
        ({"late": 200, "duration_s": 20}, "late", "200 given, the flight has 200 samples"),
        ({"outliers": 0.6, "mistaken": 0.4}, "outliers", "together with mistaken"),
        ({"guidance": "autopilot"}, "guidance", "must be 'track', 'mpc' or 'none'"),
        ({"filter": "ideal"}, "filter", "must be 'auto', 'ekf'"),
        ({"wind_mps": [1.0]}, "wind_mps[1]", "is missing"),
        ({"duration_s": 0.01}, "duration_s", "at least one sample time"),
    ],
)
def test_what_can_not_be_flown_is_refused_by_its_key_and_value_in_one_line(
    request_: dict[str, Any], key: str, problem: str
) -> None:
    with pytest.raises(InputError) as caught:
        asked(**request_)
    (fault,) = caught.value.faults
    assert fault.key == key
    assert problem in fault.problem
    assert "\n" not in str(caught.value)


def test_a_plan_whose_filter_takes_the_truth_is_refused_unless_another_is_asked_for() -> None:
    scenario = example("paper-grid-same").model_dump(mode="json", exclude_none=True)
    body = json.dumps({**scenario, "filter": {"kind": "ideal"}}).encode()
    text = made_plan(body, "json", LIMITS, False).text
    problem = "filter: ideal needs the truth, which no flight has; choose another"
    with pytest.raises(InputError, match=problem):
        checked_request("flight", b"", "json", LIMITS, text)
    checked_request("flight", b'{"filter": "ekf"}', "json", LIMITS, text)


def test_flights_are_limited_in_trials_and_figures() -> None:
    fewer = replace(LIMITS, trials=60)
    asked(fewer, trials=60)
    with pytest.raises(
        InputError, match="trials: 61 trials asked for; this service takes up to 60"
    ):
        asked(fewer, trials=61)
    # of ten vehicles in a line, 18 ordered pairs may meet
    line = {"shape": "line", "count": 10, "spacing_m": 70.0}
    body = json.dumps(document(formation=line)).encode()
    text = made_plan(body, "json", LIMITS, False).text
    checked_request("flight", b'{"trials": 54}', "json", fewer, text)
    with pytest.raises(
        InputError, match=r"trials: 10890 figures of trials asked for.* up to 10800"
    ):
        checked_request("flight", b'{"trials": 55}', "json", fewer, text)


@pytest.mark.parametrize(("guidance", "most_s"), [("track", 3000.0), ("mpc", 1000.0)])
def test_a_flight_that_is_more_than_a_task_can_do_is_refused(
    monkeypatch: pytest.MonkeyPatch, guidance: str, most_s: float
) -> None:
    # a run of the grid is 17700 operations a second
    work = 8 * 17_673 + 6 * GUIDANCES[guidance].work_per_s
    monkeypatch.setattr("api.limits.MOST_TRIAL_WORK", 1.001 * most_s * work)
    far = replace(LIMITS, run_s=1e5, samples=10**6, sightings=10**8)
    asked(far, duration_s=most_s, guidance=guidance)
    with pytest.raises(InputError, match=r"duration_s: a flight of .* fly a shorter time"):
        asked(far, duration_s=1.01 * most_s, guidance=guidance)


# --- batches ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "options",
    [
        replace(EVERY, guidance="track", filter="auto"),
        FlightOptions(trials=20, duration=8.0, guidance="mpc", with_series=True),
    ],
    ids=["events", "mpc"],
)
def test_batches_of_a_flight_come_to_the_librarys_report(options: FlightOptions) -> None:
    request, _ = asked(**options.as_request())
    spec = JobSpec("job", "flight", request, plan_text())
    said: list[object] = []
    batches = [Batch(0, 16, 4), Batch(0, 0, 16)]
    report = concluded_job(
        spec, [(batch, computed_batch(spec, batch, said.append)) for batch in batches]
    )
    whole = fly(json.loads(plan_text()), options, threads=1)
    assert report.text == as_text(flight_document(whole).as_json())
    assert said == [4, 16]
    assert report.trials is not None
    kept = unpack_flight(report.trials).figures
    assert {name: value.tobytes() for name, value in asdict(kept).items()} == {
        name: value.tobytes() for name, value in asdict(whole.result.figures).items()
    }


def test_a_flight_is_timed_before_it_is_divided() -> None:
    request, _ = asked(trials=5, duration_s=2.0)
    ((trials, seconds),) = measured_runs(JobSpec("timed", "flight", request, plan_text()))
    assert trials == 5
    assert 0.0 < seconds < 10.0
