"""Previews, figures and exports over HTTP: what the library makes, and nothing kept."""

import contextlib
import io
import json
import re
import sqlite3
import zipfile
from typing import Any, get_args

import httpx2
import pytest

import syncplan
from api.computing.tasks import checked_request, computed_batch, figure_so_far
from api.job_kinds.job_kind import Batch, JobSpec
from api.routes.rendition_routes import ExportName, PlanFigure, ReportFigure, StoredFigure
from syncplan.exporting.formats import ALL, FORMATS, as_archive, export
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.figure_table import FIGURES
from syncplan.plotting.figures import specs_of
from syncplan.plotting.printed_report import POLICY
from syncplan.reports.covariance_report import position_covariances_document
from syncplan.reports.plan_report import plan_document
from syncplan.reports.validation_report import validation_document
from syncplan.scenario.loading import scenario_from
from syncplan.studies.job_contract import JobKindName
from tests.service.test_requests import LIMITS
from tests.tools.api_servers import done, faults_of, planned, problem
from tests.tools.processes import wait_until
from tests.tools.scenarios import document, example, small
from tests.tools.serving import Server

ORIGIN = {"lat_deg": 47.4, "lon_deg": 8.5, "alt_m": 410.0}
SEEN = {"geo_origin": ORIGIN, "landmarks_m": [[0.0, 60.0], [70.0, 60.0]]}
"""What makes a go of the small team, and lets it be exported in every format."""

NEAR = {"landmarks_m": [[0.0, 60.0], [70.0, 60.0], [-21.0, 0.0]]}
"""What makes a no-go of it: v1 passes L3 at a metre."""


def stored(http: httpx2.Client, **changes: Any) -> str:
    """Return where a new plan is."""
    return f"/v1/plans/{planned(http, **changes)['id']}"


def job(http: httpx2.Client, at: str, **request: Any) -> str:
    """Return where a job is, once it has succeeded."""
    found: str = http.post(at, json=request).headers["location"]
    done(http, found)
    return found


def test_a_preview_is_the_plan_and_its_figures_and_is_kept_nowhere(ann: httpx2.Client) -> None:
    before = ann.get("/v1/plans").json()["items"]
    asked = "figure=formation&figure=spectrum&theme=dark"
    answer = ann.post(f"/v1/previews?{asked}", json=document())
    assert answer.status_code == 200
    made = syncplan.plan(small())
    assert faults_of(ann.post("/v1/previews?figure=comparison", json=document()))
    assert answer.json() == {
        "plan": plan_document(made).as_json(),
        "figures": specs_of(made, ["formation", "spectrum"], style=FigureStyle(theme="dark")),
    }
    assert ann.get("/v1/plans").json()["items"] == before
    assert "location" not in answer.headers


def test_a_preview_waits_for_nobody_who_writes(ann: httpx2.Client, server: Server) -> None:
    database = server.log.parent / "data" / "syncplan.db"
    with contextlib.closing(sqlite3.connect(database, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        assert ann.post("/v1/previews", json=document()).status_code == 200


@pytest.mark.long
def test_figures_of_a_job_under_way_are_of_its_first_trials(ann: httpx2.Client) -> None:
    at = stored(ann)
    asked = {"trials": 50_000, "duration_s": 40.0}
    found = ann.post(f"{at}/validations", json=asked).headers["location"]
    problem(ann.get(f"{found}/figures/accuracy"), 409)
    wait_until(lambda: ann.get(f"{found}/figures/accuracy").status_code == 200)
    drawn = ann.get(f"{found}/figures/accuracy").json()
    ann.post(f"{found}/cancel").raise_for_status()
    trials = int(re.findall(r"(\d+) trials", json.dumps(drawn))[0])
    assert 0 < trials < 50_000
    whole = syncplan.validate(small(), trials=trials, duration=40.0)
    assert drawn == specs_of(validation_document(whole), ["accuracy"])["accuracy"]


@pytest.mark.parametrize(
    ("kind", "plural", "figure"),
    [("validation", "validations", "accuracy"), ("flight", "flights", "meetings")],
)
def test_a_figure_of_first_trials_is_that_of_a_run_of_so_many(
    ann: httpx2.Client, kind: JobKindName, plural: str, figure: str
) -> None:
    at = stored(ann)
    plan = ann.get(at).text
    request, _ = checked_request(kind, b'{"trials": 80, "duration_s": 40}', "json", LIMITS, plan)
    spec = JobSpec("job", kind, request, plan)
    batches = [
        (batch, computed_batch(spec, batch, lambda _: None))
        for batch in (Batch(0, 0, 16), Batch(0, 16, 16))
    ]
    so_far = figure_so_far(spec, batches, figure, FigureStyle())
    of_so_many = job(ann, f"{at}/{plural}", trials=32, duration_s=40)
    assert json.loads(so_far) == ann.get(f"{of_so_many}/figures/{figure}").json()


def test_a_quick_preview_leaves_out_what_takes_long_and_says_so(ann: httpx2.Client) -> None:
    body = example("five-ring").model_dump(mode="json", exclude_none=True)
    quick, whole = (
        ann.post(f"/v1/previews?quick={quick}", json=body).json()["plan"]
        for quick in ("true", "false")
    )
    assert quick["synchronisation"]["bound_m"] is None
    assert whole["synchronisation"]["bound_m"] is not None
    assert quick["predicted_rms_m"]["overall"] is None
    assert quick["predicted_rms_m"]["note"] in quick["notes"]
    assert any("which losses end observability" in note for note in quick["notes"])
    assert "start_up" in whole
    assert "start_up" not in quick
    assert quick["connectivity_period_s"] is None
    assert whole["connectivity_period_s"] is not None
    alike = {"observability", "separation", "witness", "window_bound_m"}
    assert {key: quick[key] for key in alike} == {key: whole[key] for key in alike}


def test_covariances_are_those_of_the_library_for_a_plan_and_a_preview(ann: httpx2.Client) -> None:
    expected = position_covariances_document(syncplan.plan(small())).as_json()
    stored_ones = ann.get(f"{stored(ann)}/covariances")
    assert stored_ones.headers["content-encoding"] == "gzip"
    assert stored_ones.json() == json.loads(json.dumps(expected))
    quick = ann.post("/v1/previews?quick=true&covariances=true", json=document()).json()
    assert quick["covariances"] == stored_ones.json()
    assert problem(ann.get("/v1/plans/01a20923-b955-7add-ae07-0ad7a1aa47b8/covariances"), 404)


def test_figures_of_a_plan_are_the_library_s(ann: httpx2.Client) -> None:
    at = stored(ann)
    made = syncplan.plan(small())
    for name in get_args(PlanFigure):
        answer = ann.get(f"{at}/figures/{name}")
        assert answer.json() == specs_of(made, [name])[name], name
    for name in ("refinement", "comparison"):
        problem(ann.get(f"{at}/figures/{name}"), 404)
    problem(ann.get(f"{at}/figures/other"), 422)
    answer = ann.get(f"{at}/figures/formation?title=false&subtitle=false&legend=false")
    bare = FigureStyle(title=False, subtitle=False, legend=False)
    assert answer.json() == specs_of(made, ["formation"], style=bare)["formation"]


def test_a_printed_plan_is_the_library_s_under_a_policy_that_allows_its_style_alone(
    ann: httpx2.Client,
) -> None:
    at = stored(ann)
    answer = ann.get(f"{at}/report", headers={"accept": "text/html"})
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert answer.headers["content-security-policy"].startswith(POLICY)
    identifier = at.rpartition("/")[2]
    assert answer.text == syncplan.report_page(syncplan.plan(small()), identifier=identifier)


def test_a_refined_plan_is_compared_with_its_parent(ann: httpx2.Client) -> None:
    at = stored(ann)
    ended = job(ann, f"{at}/refinements", starts=1, objective="logdet", time_limit_s=5)
    problem(ann.get(f"{ended}/figures/accuracy"), 409)
    refined = f"/v1/plans/{ann.get(ended).json()['result_plan_id']}"
    drawn = ann.get(f"{refined}/figures/comparison").json()
    assert {trace["type"] for trace in drawn["data"]} >= {"scatter", "bar"}
    assert ann.get(f"{refined}/figures/refinement").json()["data"]
    ann.delete(at)
    problem(ann.get(f"{refined}/figures/comparison"), 404)


def test_figures_of_reports(ann: httpx2.Client) -> None:
    at = stored(ann)
    with_series = job(ann, f"{at}/validations", trials=4, duration_s=30, series=True)
    for name in ("accuracy", "errors", "consistency"):
        assert ann.get(f"{with_series}/figures/{name}").json()["data"], name
    without = job(ann, f"{at}/validations", trials=4, duration_s=30)
    assert "series" in problem(ann.get(f"{without}/figures/errors"), 404).detail
    swept = job(ann, "/v1/sweeps", scenario=document(), range_m=[50, 55], trials=2, duration_s=30)
    assert ann.get(f"{swept}/figures/sweep").json()["data"]
    problem(ann.get(f"{swept}/figures/accuracy"), 404)


@pytest.mark.parametrize(("changes", "go"), [(SEEN, True), (NEAR, False)])
def test_the_report_of_a_validation_has_the_verdict_of_its_plan(
    ann: httpx2.Client, changes: dict[str, Any], go: bool
) -> None:
    at = stored(ann, **changes)
    ended = job(ann, f"{at}/validations", trials=2, duration_s=30)
    report = ann.get(f"{ended}/result").json()
    assert report["verdict"] == ann.get(at).json()["verdict"]
    assert report["verdict"]["go"] is go
    stops = [one for one in report["verdict"]["findings"] if one["level"] == "stop"]
    assert [one["code"] for one in stops] == ([] if go else ["landmark-too-close"])


def test_the_figures_that_can_be_asked_for_are_those_there_are() -> None:
    assert set(get_args(StoredFigure)) | set(get_args(ReportFigure)) == set(FIGURES)
    assert get_args(ExportName) == (*FORMATS, ALL)


@pytest.mark.parametrize("name", [*FORMATS, ALL])
def test_an_export_is_the_library_s_to_the_byte(ann: httpx2.Client, name: str) -> None:
    scenario = document(**SEEN)
    answer = ann.get(f"{stored(ann, **SEEN)}/exports/{name}")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "application/zip"
    assert answer.headers["content-disposition"] == f'attachment; filename="plan-{name}.zip"'
    made = export(syncplan.plan(scenario_from(scenario)), name)
    assert answer.content == as_archive(made)
    assert json.loads(answer.headers["syncplan-notes"]) == list(made.notes)
    assert zipfile.ZipFile(io.BytesIO(answer.content)).testzip() is None


def test_a_plan_that_is_no_go_is_exported_only_by_force(ann: httpx2.Client) -> None:
    at = stored(ann)
    plan = ann.get(at).json()
    assert plan["verdict"]["go"] is False
    reported = problem(ann.get(f"{at}/exports/csv"), 409)
    assert reported.type == "urn:syncplan:no-go"
    assert plan["verdict"]["findings"][0]["message"] in reported.detail
    answer = ann.get(f"{at}/exports/csv?force=true")
    archive = zipfile.ZipFile(io.BytesIO(answer.content))
    (sidecar,) = (one for one in archive.namelist() if one.endswith(".sync.json"))
    assert json.loads(archive.read(sidecar))["verdict"]["findings"] == plan["verdict"]["findings"]


def test_options_of_an_export_count(ann: httpx2.Client) -> None:
    at = stored(ann, **SEEN)
    plain = ann.get(f"{at}/exports/qgc").content
    options = "altitude_m=80 autopilot=px4 vehicle=fixed_wing turns=2 altitude_step_m=5 waypoints=1"
    for option in options.split():
        answer = ann.get(f"{at}/exports/qgc?{option}")
        assert answer.status_code == 200
        assert answer.content != plain, option
    assert faults_of(ann.get(f"{at}/exports/qgc?turns=0"))[0].path == "query.turns"
    assert faults_of(ann.get(f"{stored(ann)}/exports/kml?force=true"))[0].path == "geo_origin"
