"""What may be asked for: limits of the service, and what stands for what was left out."""

import json
from collections.abc import Callable
from dataclasses import replace

import pytest

from api.computing.tasks import checked_request, made_plan, previewed
from api.limits import RequestLimits
from syncplan.errors import InputError
from syncplan.plotting.figure_style import PLAIN
from tests.tools.record_examples import SCENARIO
from tests.tools.scenarios import shared_circles

LIMITS = RequestLimits(
    vehicles=10,
    samples=1000,
    trials=100,
    run_s=1000.0,
    refine_s=5.0,
    sweep_values=3,
    design_evaluations=2000,
    sightings=50_000,
)


def _plan(**refine: object) -> str:
    scenario = {**SCENARIO, "refine": refine} if refine else SCENARIO
    return made_plan(json.dumps(scenario).encode(), "json", LIMITS, False).text


@pytest.mark.parametrize(
    ("planned", "asked", "taken"),
    [({}, {}, 5.0), ({}, {"time_limit_s": 3.0}, 3.0), ({"time_limit_s": 900.0}, {}, 5.0)],
)
def test_a_refinement_that_names_no_time_gets_what_the_service_gives(
    planned: dict[str, float], asked: dict[str, float], taken: float
) -> None:
    body = json.dumps(asked).encode()
    request, _ = checked_request("refinement", body, "json", LIMITS, _plan(**planned))
    assert json.loads(request)["time_limit_s"] == taken


def test_a_shorter_time_of_the_plan_stays() -> None:
    plan = _plan(time_limit_s=2.0)
    request, starts = checked_request("refinement", b"", "json", LIMITS, plan)
    assert "time_limit_s" not in json.loads(request)
    assert starts == 4


CROWD = shared_circles(19)
BODY = json.dumps(CROWD).encode()
SWEEP = json.dumps({"scenario": CROWD, "range_m": [50.0], "trials": 1}).encode()
ASKED: dict[str, Callable[[bytes, RequestLimits], object]] = {
    "plan": lambda body, limits: made_plan(body, "json", limits, False),
    "preview": lambda body, limits: previewed(body, "json", limits, False, [], PLAIN),
    "sweep": lambda _, limits: checked_request("sweep", SWEEP, "json", limits, None),
}


@pytest.mark.parametrize("kind", ASKED)
def test_work_is_estimated_before_it_is_begun(kind: str) -> None:
    limits = replace(LIMITS, vehicles=200, samples=20_000, sightings=5_000_000)
    with pytest.raises(InputError, match=r"sightings expected.*takes up to.*range_m"):
        ASKED[kind](BODY, limits)


def test_a_team_is_refused_by_the_limit_on_its_size_before_it_is_built() -> None:
    shape = {"shape": "grid", "count": 10_000_000, "spacing_m": 70.0}
    body = json.dumps({**SCENARIO, "formation": shape}).encode()
    limits = replace(LIMITS, vehicles=1000)
    for kind in ("plan", "preview"):
        with pytest.raises(InputError) as refused:
            ASKED[kind](body, limits)
        assert str(refused.value) == (
            "formation.count: 10000000 vehicles are more than the limit of 1000; raise it with "
            "--max-vehicles (library: max_vehicles=, service: SYNCPLAN_MAX_VEHICLES)"
        )


def test_pairs_in_range_are_counted_before_their_views_are_sampled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shape = {"shape": "grid", "count": 1000, "spacing_m": 70.0}
    sensor = {"range_m": 700.0, "fov_deg": 150.0, "sample_time_s": 0.5}
    crowd = {**SCENARIO, "formation": shape, "sensor": sensor}
    limits = replace(LIMITS, vehicles=1000)
    monkeypatch.setattr("syncplan.planning.expected_work._share_in_view", None)
    with pytest.raises(InputError, match=r"^sensor: \d{6} pairs .* up to 50000; .*range_m"):
        made_plan(json.dumps(crowd).encode(), "json", limits, False)


def test_a_run_may_hold_as_many_sightings_as_the_service_takes() -> None:
    limits = replace(LIMITS, samples=20_000, run_s=1e5)
    plan = made_plan(json.dumps(SCENARIO).encode(), "json", limits, False).text
    checked_request("validation", b'{"trials": 1}', "json", limits, plan)
    with pytest.raises(InputError, match="sightings expected"):
        checked_request("validation", b'{"trials": 1}', "json", replace(limits, sightings=5), plan)


def test_a_preview_is_the_same_after_the_one_on_paper_as_alone() -> None:
    def flights(scenario: dict[str, object], *, paper: bool) -> tuple[str, str]:
        body = json.dumps(scenario).encode()
        text = previewed(body, "json", LIMITS, False, [], PLAIN, paper=paper)
        return json.loads(text)["plan"]["verdict"]["basis"]["kind"], text

    other = {**SCENARIO, "duration_s": 30.0}
    kind, alone = flights(SCENARIO, paper=False)
    assert kind == "flown"
    assert [flights(of, paper=True)[0] for of in (other, SCENARIO)] == ["paper", "paper"]
    assert flights(SCENARIO, paper=False) == ("flown", alone)
    assert flights(other, paper=False) != ("flown", alone)
