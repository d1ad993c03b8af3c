"""The client: the library's results from a real service, its errors, and requests repeated."""

import json
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest

import syncplan
from syncplan.client.connection import RemoteError
from syncplan.client.service_client import Client, RemoteJob, RemotePlan, RemotePlanSummary
from syncplan.errors import InputError
from syncplan.planning.variations import sweep
from syncplan.reports.flight_report import flight_document
from syncplan.reports.plan_report import plan_document
from syncplan.reports.sites_report import sites_document
from syncplan.reports.validation_report import sweep_document, validation_document
from syncplan.runtime.files import as_text
from tests.tools.api_servers import key_of, serving, speaking
from tests.tools.processes import PATIENCE_S
from tests.tools.scenarios import LANDMARKS, circling, document, example, small
from tests.tools.serving import Server, free_port

KEY = key_of("ann")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service that asks for a key."""
    with serving(tmp_path_factory.mktemp("client"), "ann") as one:
        yield one


@pytest.fixture(scope="module")
def client(server: Server) -> Iterator[Client]:
    """A client with its key."""
    with Client(server.url, KEY, timeout_s=PATIENCE_S, patience_s=PATIENCE_S) as one:
        yield one


@pytest.fixture(scope="module")
def http(server: Server) -> Iterator[httpx2.Client]:
    """A connection without the client in between."""
    with speaking(server, "ann") as one:
        yield one


@pytest.fixture(scope="module")
def stored(client: Client) -> RemotePlan:
    """The grid as the service planned it."""
    return client.plan(example("paper-grid-alternate"))


@pytest.fixture(scope="module")
def made() -> syncplan.Plan:
    """The grid as the library plans it."""
    return syncplan.plan(example("paper-grid-alternate"))


# --- the library's results ----------------------------------------------------------------------


def test_a_plan_is_the_librarys(stored: RemotePlan, made: syncplan.Plan) -> None:
    assert isinstance(stored, syncplan.Plan)
    assert stored.observability.rank == made.observability.rank == 16
    assert np.array_equal(stored.orbits.phases, made.orbits.phases)
    assert stored.prediction is not None
    assert stored.prediction.rms is not None
    assert made.prediction is not None
    np.testing.assert_array_equal(stored.prediction.rms, made.prediction.rms)
    added = {"id": stored.id, "created_at": stored.created_at, "parent_id": None}
    assert stored.document == {**added, **plan_document(made).as_json()}
    assert stored.created_at.endswith("Z")


def test_a_path_is_planned_as_the_file_that_it_names(client: Client, tmp_path: Path) -> None:
    plan = syncplan.plan(example("paper-grid-same"))
    path = tmp_path / "plan.json"
    plan.save(path)
    stored = client.plan(path)
    assert stored.scenario == plan.scenario
    np.testing.assert_array_equal(stored.orbits.phases, plan.orbits.phases)
    with pytest.raises(InputError, match=r"missing\.yaml: no such file"):
        client.plan(str(tmp_path / "missing.yaml"))
    with pytest.raises(InputError, match="is a list; give a Plan, a Scenario, the path"):
        client.plan([])  # type: ignore[arg-type]


def test_a_stored_plan_is_read_and_deleted(client: Client) -> None:
    plan = client.plan(document(landmarks_m=LANDMARKS), steady=True)
    assert plan.document["steady_rms_m"] is not None
    again = client.stored(plan.id)
    assert again.document == plan.document
    job = client.validate(plan, trials=16, seed=1)
    client.delete(again)
    # it outlives the plan that it is about
    assert client.wait(job).result.trials == 16
    with pytest.raises(RemoteError, match=f"404: there is no plan {plan.id}") as caught:
        client.stored(plan.id)
    assert caught.value.status == 404


def test_work_is_listed_renamed_and_deleted(client: Client) -> None:
    made = [client.plan(document(name=f"kept {k}", landmarks_m=LANDMARKS)) for k in range(3)]
    renamed = client.rename(made[0], "renamed")
    assert (renamed.id, renamed.scenario.name) == (made[0].id, "renamed")
    assert renamed.document == client.stored(made[0].id).document
    listed = list(islice(client.plans(), 3))
    assert {one.name for one in listed} == {"renamed", "kept 1", "kept 2"}
    assert listed[0].go is made[0].verdict.go
    predicted = made[0].document["predicted_rms_m"]
    assert listed[0].predicted_rms_m == predicted["overall"]
    assert listed[0].worst_predicted_rms_m == max(predicted["vehicles"].values())
    assert listed[0].outline is not None
    assert len(listed[0].outline["circles"]) == 2
    with pytest.raises(InputError, match="name: "):
        client.rename(made[0].id, "two\nlines")
    job = client.validate(made[1], trials=50_000)
    with pytest.raises(RemoteError, match=r"409: the job is .*; cancel it first"):
        client.delete_job(job)
    client.cancel(job)
    assert job.id in {one.id for one in client.jobs("cancelled")}
    client.delete_job(job)
    assert job.id not in {one.id for one in client.jobs()}


def test_usage_is_read(client: Client, http: httpx2.Client) -> None:
    before = client.usage()
    plan = client.plan(document(landmarks_m=LANDMARKS))
    after = client.usage()
    assert after.bytes["plans"] > before.bytes["plans"]
    assert after.bytes["recordings"] == 0
    assert after.max_bytes == 2**31
    assert after.max_job_seconds >= after.computing_s >= 0.0
    assert http.get("/v1/usage").json()["max_bytes"] == after.max_bytes
    client.delete(plan)
    assert client.usage().bytes["plans"] == before.bytes["plans"]


def test_lists_are_read_page_by_page(client: Client) -> None:
    with standing() as (paged, stand):
        row = {one.name: None for one in fields(RemotePlanSummary)}
        pages = [
            {"items": [row, row], "next": "/v1/plans?before=x"},
            {"items": [row], "next": None},
        ]
        stand.turns[:] = [saying(200, json.dumps(page).encode()) for page in pages]
        assert len(list(paged.plans())) == 3
        assert [path for _, path, _ in stand.seen] == ["/v1/plans"] * 2


@pytest.mark.long
def test_a_refinement_is_the_librarys_and_names_its_parent(
    client: Client, stored: RemotePlan, made: syncplan.Plan
) -> None:
    options: dict[str, Any] = {"objective": "logdet", "starts": 2, "seed": 3, "center_box_m": 4.0}
    better = client.wait(client.refine(stored, **options))
    here = syncplan.refine(made, **options)
    assert better.parent_id == stored.id
    assert better.observability.rank == here.observability.rank == 18
    assert np.array_equal(better.orbits.centers, here.orbits.centers)
    assert np.array_equal(better.orbits.phases, here.orbits.phases)
    assert here.refinement is not None
    assert better.document["refinement"]["after"] == json.loads(
        json.dumps(plan_document(here).as_json()["refinement"]["after"])
    )
    assert client.stored(better.id).document == better.document


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("validate", {"trials": 20, "seed": 1, "duration": 50.0, "with_series": True}),
        ("validate", {"trials": 20, "filter": "paper", "substeps": 3, "gate_probability": 0.99}),
        (
            "fly",
            {
                "trials": 20,
                "seed": 2,
                "duration": 10.0,
                "lose": ("v6@6",),
                "hold": ("v2@2:3",),
                "wind": (0.5, 0.0),
                "with_series": True,
            },
        ),
    ],
)
def test_a_report_is_the_librarys_to_the_last_byte(
    client: Client,
    http: httpx2.Client,
    stored: RemotePlan,
    made: syncplan.Plan,
    kind: str,
    options: dict[str, Any],
) -> None:
    documents: dict[str, Any] = {"validate": validation_document, "fly": flight_document}
    job = getattr(client, kind)(stored, **options)
    text = as_text(documents[kind](client.wait(job)).as_json())
    assert text == as_text(documents[kind](getattr(syncplan, kind)(made, **options)).as_json())
    assert http.get(f"/v1/jobs/{job.id}/result").text == text


def test_a_study_is_started_by_its_name(client: Client, stored: RemotePlan) -> None:
    job = client.start("validation", stored, trials=16, seed=3)
    assert (job.kind, job.plan) == ("validation", stored)
    assert client.wait(job).result.seed == 3
    with pytest.raises(
        InputError, match="study: 'validations' is unknown; choose from refinement, "
    ):
        client.start("validations", stored)
    with pytest.raises(InputError, match="subject: give the plan that it is about"):
        client.start("validation")
    with pytest.raises(InputError, match="subject: a sweep has none"):
        client.start("sweep", stored)
    with pytest.raises(InputError, match="trial: unknown key"):
        client.start("validation", stored, trial=16)


def test_a_sweep_is_the_librarys(client: Client) -> None:
    given, values = small(landmarks_m=LANDMARKS), [0.2, 0.4]
    report = client.wait(client.sweep(given, angular_rate_rad_s=values, trials=16, seed=2))
    rows = sweep(given, "angular_rate", values, trials=16, seed=2)
    assert report == sweep_document(rows)


# --- jobs ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("asked", [pytest.param({}, marks=pytest.mark.long), {"bound": "never"}])
def test_losses_are_the_librarys(
    client: Client, stored: RemotePlan, made: syncplan.Plan, asked: dict[str, Any]
) -> None:
    expected = syncplan.what_if(made, threads=1, **asked)
    assert client.what_if(stored, **asked).as_json() == expected.as_json()
    (one,) = client.what_if(stored, ["v1", "sensor:v2"], bound="never").losses
    assert one.lost == ["v1", "sensor:v2"]
    with pytest.raises(InputError, match="is neither a vehicle"):
        client.what_if(stored, ["v9"])


def test_a_choice_of_landmarks_is_the_librarys(client: Client) -> None:
    given = example("paper-grid-same")
    team = given.model_copy(update={"landmarks_m": [*given.landmarks, (35.0, 35.0)]})
    stored, names = client.plan(team), team.landmark_names
    expected = sites_document(syncplan.choose_landmarks(team, names, 2))
    assert client.choose_landmarks(stored, names, 2) == expected
    with pytest.raises(InputError, match="there is no such landmark"):
        client.choose_landmarks(stored, ["L9"], 1)
    with pytest.raises(InputError, match="must be from 1 to the number of candidates"):
        client.choose_landmarks(stored, names, len(names) + 1)


@pytest.mark.long
def test_progress_is_reported_whenever_it_changes(client: Client, stored: RemotePlan) -> None:
    reported: list[RemoteJob] = []
    job = client.validate(stored.id, trials=1500)
    assert (job.kind, job.total, job.ended) == ("validation", 1500, False)
    client.wait(job, progress=reported.append)
    assert all(one != other for one, other in pairwise(reported))
    assert [one.done for one in reported] == sorted(one.done for one in reported)
    assert len({one.done for one in reported}) > 2
    assert {one.state for one in reported[1:-1]} <= {"queued", "running"}
    last = reported[-1]
    assert (last.state, last.done, last.ended) == ("succeeded", 1500, True)
    with pytest.raises(RemoteError, match="409: the job has already ended") as caught:
        client.cancel(job)
    assert caught.value.status == 409


def test_waiting_ends_in_time_and_the_job_goes_on_until_it_is_cancelled(
    client: Client, stored: RemotePlan
) -> None:
    job = client.validate(stored, trials=50_000)
    with pytest.raises(RemoteError, match=r"after 0.5 s; it continues"):
        client.wait(job, timeout_s=0.5)
    assert not client.job(job.id).ended
    assert client.cancel(job).state == "cancelled"
    assert client.cancel(job.id).state == "cancelled"
    with pytest.raises(RemoteError, match=f"job {job.id} was cancelled"):
        client.wait(job)


@pytest.mark.long
def test_a_job_without_solution_says_why(client: Client, stored: RemotePlan) -> None:
    job = client.refine(stored, margin_m=80.0)
    with pytest.raises(syncplan.NoSolutionError, match=rf"job {job.id} failed.*v1-v2.*range 50 m"):
        client.wait(job)


def test_a_job_whose_input_turns_out_bad_says_what(client: Client) -> None:
    far = document(formation={"centers_m": [[-9e6, 0.0], [9e6, 0.0]]})
    job = client.sweep(far, range_m=[50.0], connected=True, trials=1, duration_s=1.0)
    with pytest.raises(syncplan.InputError, match=r"sensor.range_m") as caught:
        client.wait(job)
    assert caught.value.faults[0].key == "sensor.range_m"


# --- errors -------------------------------------------------------------------------------------


def test_a_bad_scenario_is_refused_before_it_is_sent() -> None:
    given = document(sensor={"range_m": -5, "bearing_sigma_rad": 0.1, "sample_time_s": "x"})
    with pytest.raises(syncplan.InputError) as caught, Client("http://127.0.0.1:9") as nobody:
        nobody.plan(given)
    assert {fault.key for fault in caught.value.faults} == {
        "sensor.range_m",
        "sensor.sample_time_s",
    }


def test_what_the_service_refuses_is_an_input_error_with_its_faults(
    client: Client, stored: RemotePlan
) -> None:
    with pytest.raises(InputError, match="v9@3:4: no vehicle is named v9"):
        client.fly(stored.id, hold=("v9@3:4",))
    for start in (client.fly, client.validate):
        with pytest.raises(TypeError, match=r"has no argument 'trails'; did you mean 'trials'\?"):
            start(stored.id, trails=3)
    with pytest.raises(syncplan.InputError) as caught:
        client.refine(stored, starts=0, seeds=1)
    assert [fault.key for fault in caught.value.faults] == ["seeds", "starts"]
    assert str(caught.value).startswith("seeds: unknown key; did you mean seed?")
    assert str(caught.value).endswith("(and 1 more)")
    assert caught.value.faults[1].value == "0"


def test_a_scenario_without_solution_is_the_librarys_error(client: Client) -> None:
    star = {"links": [["v1", f"v{k}"] for k in range(2, 9)]}
    given = document(formation=star, orbit=circling(radius_m=50.0), sensor=SHORT)
    with pytest.raises(syncplan.NoSolutionError, match="at most 6 fit round it"):
        client.plan(given)


SHORT = {"range_m": 10.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1}


@pytest.mark.parametrize("key", [None, "bob-0123456789abcdef"])
def test_a_key_that_is_not_known_is_reported_at_once(server: Server, key: str | None) -> None:
    with (
        Client(server.url, key) as stranger,
        pytest.raises(RemoteError, match="401: send a known key") as caught,
    ):
        stranger.plan(small())
    assert caught.value.status == 401


def test_an_unknown_identifier_is_not_found_whatever_it_looks_like(client: Client) -> None:
    with pytest.raises(RemoteError, match="404: there is no job") as caught:
        client.job("01a1fd95-df6b-7a20-9383-c20e93a41e86")
    assert caught.value.status == 404
    for odd in ("../jobs", "a?b", "x" * 36, "ü"):
        with pytest.raises(syncplan.SyncplanError) as refused:
            client.delete(odd)
        assert isinstance(refused.value, syncplan.InputError) or "404" in str(refused.value)


def test_what_can_not_be_sent_is_an_input_error(
    client: Client, stored: RemotePlan, made: syncplan.Plan
) -> None:
    with pytest.raises(syncplan.InputError, match="a Plan is not known to the service"):
        client.validate(made)  # type: ignore[arg-type]
    for value in (float("nan"), object()):
        with pytest.raises(syncplan.InputError, match="can't be sent as JSON"):
            client.refine(stored, center_box_m=value)
    addresses: list[Any] = ["127.0.0.1:8000", "ftp://here", "", "http://", "http://[::1", None]
    for url in addresses:
        with pytest.raises(syncplan.InputError, match="url: "):
            Client(url)
    for key in ("two\nlines", "schlüssel"):
        with pytest.raises(syncplan.InputError, match="api_key: must be printable") as caught:
            Client("http://127.0.0.1:9", key)
        assert key not in str(caught.value)


def test_a_missing_library_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", {"httpx2": None}.get)
    with pytest.raises(syncplan.InputError) as caught:
        Client("http://127.0.0.1:9")
    assert str(caught.value) == (
        "the client: needs httpx2; install the extra: pip install 'syncplan[client]'"
    )


def test_a_service_that_is_away_is_reported_in_one_line_without_its_password() -> None:
    address, began = f"127.0.0.1:{free_port()}", time.monotonic()
    with (
        pytest.raises(RemoteError, match="can't be reached") as caught,
        Client(f"http://somebody:secretword@{address}", patience_s=1.5) as client,
    ):
        client.stored("any")
    assert caught.value.status is None
    assert "\n" not in str(caught.value)
    assert address in str(caught.value)
    assert "secretword" not in str(caught.value)
    assert time.monotonic() - began > 0.3


def test_a_closed_client_is_closed(server: Server) -> None:
    assert syncplan.Client is Client
    with Client(server.url, KEY) as one:
        one.plan(small())
    with pytest.raises(RuntimeError, match="closed"):
        one.plan(small())


# --- requests repeated --------------------------------------------------------------------------


Turn = Callable[[httpx2.Request], httpx2.Response]


class Stand:
    """Stands before the service: takes its turns as the test has planned them, then passes on."""

    def __init__(self, client: Client, turns: tuple[Turn, ...]) -> None:
        self.turns = list(turns)
        self.seen: list[tuple[str, str, str | None]] = []
        transport = client._remote._http._transport
        self.passed_on = transport.handle_request
        transport.handle_request = self._answer  # type: ignore[method-assign]

    def _answer(self, request: httpx2.Request) -> httpx2.Response:
        key = request.headers.get("idempotency-key")
        self.seen.append((request.method, request.url.path, key))
        return self.turns.pop(0)(request) if self.turns else self.passed_on(request)

    def cut_off(self, request: httpx2.Request) -> httpx2.Response:
        """Pass the request on, and lose its answer."""
        answer = self.passed_on(request)
        answer.read()
        assert answer.is_success
        raise httpx2.ReadError("connection reset", request=request)


@contextmanager
def standing(*turns: Turn, url: str = "http://127.0.0.1:9", **options: Any) -> Iterator[Any]:
    """A client, and what stands between it and the service."""
    with Client(url, KEY, **options) as client:
        yield client, Stand(client, turns)


def saying(status: int, body: bytes = b"", **headers: str) -> Turn:
    """Give an answer of one's own."""
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return lambda _: httpx2.Response(status, headers=named, content=body)


def test_a_post_whose_answer_is_lost_is_done_once(
    server: Server, http: httpx2.Client, stored: RemotePlan
) -> None:
    def kept(what: str) -> set[str]:
        return {one["id"] for one in http.get(f"/v1/{what}?limit=200").json()["items"]}

    with standing(url=server.url) as (client, stand):
        stand.turns[:] = [saying(503), stand.cut_off, stand.cut_off]
        before = kept("plans")
        plan = client.plan(small(name="done once"))
        assert kept("plans") - before == {plan.id}
        assert len(stand.seen) == 4
        assert len(set(stand.seen)) == 1
        # each has a key of its own
        assert client.plan(small(name="done once")).id != plan.id
        assert len({key for _, _, key in stand.seen} - {None}) == 2

        stand.seen.clear()
        stand.turns[:] = [stand.cut_off]
        before = kept("jobs")
        job = client.validate(stored, trials=1, duration=1.0)
        assert kept("jobs") - before == {job.id}
        assert stand.seen[0] == stand.seen[1]

        # the first of the two deletes it: that it is gone then is no failure
        stand.turns[:] = [stand.cut_off]
        client.delete(plan)
        assert http.get(f"/v1/plans/{plan.id}").status_code == 404
        with pytest.raises(RemoteError, match="404"):
            client.delete(plan)


def test_a_busy_service_is_asked_again_when_it_says(server: Server, stored: RemotePlan) -> None:
    with standing(url=server.url) as (client, stand):
        # odd times are passed over
        for when in ("1", "soon", "-3", "Wed, 21 Oct 2026 07:28:00 GMT", "nan"):
            stand.turns[:] = [saying(429 if when == "1" else 503, retry_after=when)]
            stand.seen.clear()
            began = time.monotonic()
            assert client.stored(stored.id).id == stored.id
            assert len(stand.seen) == 2
            assert when != "1" or time.monotonic() - began >= 1.0


def test_a_wait_beyond_patience_is_not_begun() -> None:
    problem = json.dumps({"detail": "20 jobs are unfinished"}).encode()
    busy = saying(429, problem, retry_after="300", content_type="application/problem+json")
    began = time.monotonic()
    with (
        standing(busy, patience_s=5.0) as (client, _),
        pytest.raises(RemoteError, match="429: 20 jobs are unfinished") as caught,
    ):
        client.sweep(small(), range_m=[50.0])
    assert caught.value.status == 429
    assert time.monotonic() - began < 300.0


def test_a_request_that_is_refused_is_not_repeated() -> None:
    with standing(saying(500, b"<h1>no</h1>", content_type="text/html")) as (client, stand):
        with pytest.raises(RemoteError, match=r"500: <h1>no</h1>"):
            client.job("any")
        assert len(stand.seen) == 1


def test_a_server_of_something_else_is_reported() -> None:
    with standing(url="http://127.0.0.1:9/planner/") as (client, stand):
        for body in (b"<h1>Welcome</h1>", b"[]", b"{}", b""):
            stand.turns[:] = [saying(200, body)]
            with pytest.raises(RemoteError, match="the answer is not one of syncplan's service"):
                client.plan(small())
        # a path before the service's own is kept
        assert stand.seen[0][1] == "/planner/v1/plans"


def test_a_slow_answer_is_given_up_after_the_time_for_one_request() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as silent,
        Client(
            f"http://127.0.0.1:{silent.getsockname()[1]}", timeout_s=0.2, patience_s=0.05
        ) as client,
        pytest.raises(RemoteError, match=r"can't be reached.*timed out"),
    ):
        client.job("any")
