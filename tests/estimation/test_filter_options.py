"""Options of a filter run: one type for library, command line and service; the table of filters."""

import inspect
import json
from dataclasses import asdict, fields
from typing import Any

import pytest
from typer.main import get_command

import syncplan
from api.job_kinds.job_table import JOB_KINDS
from syncplan.cli import command_line
from syncplan.errors import InputError
from syncplan.estimation.filter_options import FilterOptions, ValidationOptions, options_with
from syncplan.reports.run_figures import FilterRecord
from syncplan.reports.validation_report import validation_document
from syncplan.scenario.disturbances import Filter
from syncplan.scenario.filters import FILTERS, FOR_RECORDINGS
from tests.tools.scenarios import example

ReplayRequest = JOB_KINDS["replay"].request
ValidationRequest = JOB_KINDS["validation"].request

EVERY = FilterOptions(
    trials=7,
    seed=3,
    duration=12.5,
    filter="paper",
    substeps=3,
    gate_probability=0.99,
    with_series=True,
)


def test_keywords_requests_and_options_have_the_same_names() -> None:
    names = [field.name for field in fields(ValidationOptions)]
    keys = ValidationOptions.request_keys()
    assert list(keys) == names
    assert set(keys.values()) == set(ValidationRequest.model_fields)


def test_a_request_holds_every_option_and_gives_it_back() -> None:
    for options in (FilterOptions(), EVERY):
        request = options.as_request()
        assert FilterOptions.of_request(request) == options
        asked = ValidationRequest.model_validate(request).options()
        assert asked == ValidationOptions(**asdict(options))


def test_defaults_are_those_of_the_library_the_command_line_and_the_service() -> None:
    assert asdict(FilterOptions()) == {
        "trials": 200,
        "seed": 0,
        "duration": None,
        "filter": "auto",
        "substeps": 10,
        "gate_probability": None,
        "with_series": False,
        "truth": None,
        "model": None,
    }
    assert ValidationRequest().options() == ValidationOptions()
    command: Any = get_command(command_line.application())
    shown = {option.name: option.default for option in command.commands["validate"].params}
    assert {name: shown[name] for name in asdict(FilterOptions())} == asdict(FilterOptions())


def test_options_and_keywords_give_the_same_bytes() -> None:
    plan = syncplan.plan(example("paper-grid-same"))

    def report(**given: Any) -> str:
        options = given.pop("options", None)
        return json.dumps(validation_document(syncplan.validate(plan, options, **given)).as_json())

    expected = report(options=EVERY)
    assert report(**asdict(EVERY)) == expected
    rest = asdict(EVERY)
    begun = FilterOptions(trials=rest.pop("trials"), seed=rest.pop("seed"))
    assert report(options=begun, **rest) == expected
    assert report(options=EVERY, seed=4) != expected


def test_a_sweep_takes_the_same_options() -> None:
    scenario = example("paper-grid-same")
    options = FilterOptions(trials=3, duration=5.0, filter="paper", substeps=2)
    (row,) = syncplan.sweep(scenario, "range", [50.0], options)
    assert row.validation.options == options
    (again,) = syncplan.sweep(
        scenario, "range", [50.0], trials=3, duration=5.0, filter="paper", substeps=2
    )
    errors = again.validation.result.final_errors
    assert errors.tobytes() == row.validation.result.final_errors.tobytes()


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("trials", 0, "0 given; allowed is 1 to 1000000"),
        ("trials", 1_000_001, "1000001 given; allowed is 1 to 1000000"),
        ("seed", -1, "-1 given; allowed is 0 to 9223372036854775807"),
        ("seed", 2**63, "allowed is 0 to"),
        ("filter", "rk4", "'rk4' is unknown; choose auto or ekf or "),
        ("model", "rk4", "'rk4' is unknown; choose arc or euler"),
        ("substeps", 0, "0 given; allowed is 1 to 1000"),
        ("gate_probability", 1.0, "1 given; allowed is more than 0 and less than 1"),
        ("gate_probability", float("nan"), "nan given; allowed is more than 0"),
    ],
)
def test_an_option_out_of_range_is_named_with_its_limits(
    key: str, value: Any, message: str
) -> None:
    changes: Any = {key: value}
    with pytest.raises(InputError) as refused:
        options_with(None, changes)
    assert refused.value.key == key
    assert message in refused.value.problem


def test_an_option_that_does_not_exist_is_refused() -> None:
    changes: Any = {"trails": 3}
    with pytest.raises(TypeError, match="trails"):
        options_with(None, changes)


def test_choices_everywhere_are_the_table_of_filters(run: Any) -> None:
    names = list(FILTERS)
    assert FilterOptions().filter_model is FILTERS[names[0]]
    shown = run("validate", "--help")[1]
    assert all(name in shown for name in ("auto", *names))
    asked = ValidationRequest.model_json_schema()["properties"]["filter"]
    assert asked["enum"] == ["auto", *names]
    reported = FilterRecord.model_json_schema()["properties"]["kind"]["anyOf"][0]
    assert reported["enum"] == names
    stated = Filter.model_json_schema()["properties"]["kind"]["anyOf"][0]
    assert stated["enum"] == ["auto", *names]
    recorded = ReplayRequest.model_json_schema()["properties"]["filter"]["enum"]
    assert recorded == list(FOR_RECORDINGS) == names[:-1]


@pytest.mark.parametrize("name", list(FILTERS))
def test_every_filter_runs_and_is_named_in_its_report(name: str) -> None:
    done = syncplan.validate(example("paper-grid-same"), trials=2, duration=3.0, filter=name)
    record = validation_document(done).filter
    assert (record.kind, record.chosen_because) == (name, "asked for")
    assert record.model == FILTERS[name].motion
    assert record.substeps == (10 if FILTERS[name].takes_substeps else 0)
    assert record.used > 0


@pytest.mark.parametrize("function", [syncplan.validate, syncplan.replay, syncplan.sweep])
def test_options_stand_after_the_subject(function: Any) -> None:
    positional = [
        name
        for name, one in inspect.signature(function).parameters.items()
        if one.kind is one.POSITIONAL_OR_KEYWORD
    ]
    assert positional[-1] == "options"


@pytest.mark.parametrize(
    ("name", "wrong", "right"),
    [
        ("validate", "trails", "trials"),
        ("sweep", "durations", "duration"),
        ("fly", "outlier", "outliers"),
        ("refine", "start", "starts"),
        ("replay", "bearing_sigmas", "bearing_sigma"),
    ],
)
def test_options_are_in_the_signature_and_a_wrong_one_is_named_with_the_nearest(
    name: str, wrong: str, right: str
) -> None:
    function = getattr(syncplan, name)
    assert right in inspect.signature(function).parameters
    with pytest.raises(TypeError, match=rf"{name}\(\) has no argument '{wrong}'; .*'{right}'\?"):
        function(**{wrong: 3})


def test_no_public_function_takes_keywords_that_it_does_not_list() -> None:
    public = [getattr(syncplan, name) for name in syncplan.__all__]
    for function in filter(inspect.isfunction, public):
        kinds = {one.kind for one in inspect.signature(function).parameters.values()}
        assert inspect.Parameter.VAR_KEYWORD not in kinds, function.__name__
