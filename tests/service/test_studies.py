"""The table of studies, and what GET /v1/studies says of it."""

import pickle
from dataclasses import dataclass, replace
from typing import Any

import pytest

from api.job_kinds.job_table import JOB_KINDS
from api.job_kinds.requests import PlanRequest, request_for
from api.limits import RequestLimits
from api.routes.study_routes import OptionDescription, described_studies
from api.service import limits_of
from api.settings import load_settings
from syncplan.errors import InputError
from syncplan.options import RunOptions, option
from syncplan.planning.plan_files import loaded_from
from syncplan.studies.study import ALONE, Execution, Study
from syncplan.studies.study_table import STUDIES
from tests.tools.briefs import FIELD
from tests.tools.scenarios import document

LIMITS: RequestLimits = limits_of(load_settings(data_dir="/nowhere", max_trials=7777))
DESCRIBED = {study.name: study for study in described_studies(LIMITS)}


def options_of(name: str) -> dict[str, OptionDescription]:
    return {option.key: option for option in DESCRIBED[name].options}


def test_every_study_is_described_with_the_keys_of_its_request() -> None:
    assert list(DESCRIBED) == list(STUDIES)
    for name, kind in JOB_KINDS.items():
        keys = {key for key, field in kind.request.model_fields.items() if not field.deprecated}
        assert set(options_of(name)) == keys


def test_options_have_labels_units_kinds_and_the_limits_of_the_service() -> None:
    flight = options_of("flight")
    trials = flight["trials"]
    assert (trials.label, trials.unit, trials.kind) == ("Flights", "", "integer")
    assert trials.often
    assert not flight["dropout"].often
    assert (trials.default, trials.limits) == (100, {"minimum": 1, "maximum": 7777})
    wind = flight["wind_mps"]
    assert (wind.label, wind.unit, wind.kind, wind.default) == ("Wind", "m/s", "pair", None)
    assert flight["lose"].kind == "names"
    assert flight["truth"].kind == "document"
    assert flight["guidance"].choices == ["track", "mpc", "none"]
    assert flight["series"].kind == "flag"
    assert options_of("sweep")["range_m"].kind == "numbers"
    assert options_of("refinement")["time_limit_s"].limits["maximum"] == LIMITS.refine_s
    assert "model" not in options_of("validation")


def test_reports_have_fields_with_labels_and_figures() -> None:
    flight = DESCRIBED["flight"]
    fields = {field.path: (field.label, field.unit) for field in flight.fields}
    assert fields["vehicles.name"] == ("vehicle", "")
    assert "tracking" in {figure.name for figure in flight.figures}
    assert DESCRIBED["refinement"].makes_plan
    assert not DESCRIBED["refinement"].fields


REQUESTS: dict[str, dict[str, Any]] = {
    "sweep": {"scenario": document(), "range_m": [50.0]},
    "design": FIELD,
}
"""Requests that are more than options."""


@pytest.mark.parametrize("name", JOB_KINDS)
def test_options_are_fit_for_the_processes_of_a_study(name: str) -> None:
    request = JOB_KINDS[name].request.model_validate(REQUESTS.get(name, {}))
    options = request.options()
    assert pickle.loads(pickle.dumps(options)) == options


# --- a new study ----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class _Options(RunOptions):
    duration: float | None = option(None, "Length in s", key="duration_s", gt=0)
    depth: int = option(3, "How deep to look", ge=1, le=9)


class _Soundings(Study):
    """A study as a newcomer would add one."""

    name, verb, of = "sounding", "sound", "plan"
    sentence, unit, body = "Sound a plan.", "plans", "How deep"
    options: type[Any] = _Options

    def run(self, subject: Any, options: Any, how: Execution = ALONE) -> Any:
        raise NotImplementedError


def test_a_new_study_of_a_plan_has_a_request_with_its_options_and_limits() -> None:
    request: Any = request_for(_Soundings(), PlanRequest)
    assert request.__name__ == "SoundingRequest"
    assert set(request.model_fields) == {"duration_s", "depth"}
    plan = loaded_from(document())
    assert request(depth=5).work(plan, LIMITS) == 1
    assert request(depth=5).options() == _Options(depth=5)
    assert _Soundings().path == "/plans/{plan_id}/soundings"
    with pytest.raises(ValueError, match="less than or equal to 9"):
        request(depth=10)
    with pytest.raises(InputError, match=r"duration_s: 1e\+07 s asked for"):
        request(duration_s=1e7).work(plan, LIMITS)
    with pytest.raises(InputError, match=r"duration_s: 0\.01 s given"):
        request(duration_s=0.01).work(plan, replace(LIMITS, run_s=1e9))


class _Census(_Soundings):
    """One without options, whose plural needs more than an s."""

    name, verb, plural = "census", "count", "censuses"
    options = RunOptions


def test_a_study_may_have_no_options_and_a_plural_of_its_own() -> None:
    request: Any = request_for(_Census(), PlanRequest)
    assert set(request.model_fields) == set()
    assert request().options() == RunOptions()
    assert _Census().path == "/plans/{plan_id}/censuses"
