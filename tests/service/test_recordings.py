"""Recordings over HTTP: taken in whole or not at all, each owner's own, kept while needed."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest
from sqlalchemy import Connection, insert, select, update
from typer.main import get_command

from api.documents import PackedRecording, packed_recording
from api.job_kinds.job_table import JOB_KINDS
from api.problems import TooManyRequests
from api.service import MOST, MOST_OF_OWNER, Uploads, limits_of
from api.settings import load_settings
from api.storage import holdings
from api.storage.job_records import NewJob, add_job, end_job
from api.storage.tables import earlier, jobs, moment, recordings
from syncplan.cli import command_line
from syncplan.client.connection import RemoteError
from syncplan.client.service_client import Client
from syncplan.errors import InputError
from syncplan.estimation.recorded_readings import clock_of, true_poses
from syncplan.estimation.replay_settings import ReplayOptions
from syncplan.estimation.replays import replay
from syncplan.recordings.log import Overview, pack_log, unpack_log
from syncplan.recordings.recording_formats import load_log
from syncplan.reports.replay_report import ReplayDocument, replay_document
from tests.tools.api_servers import (
    done,
    ended,
    faults_of,
    key_of,
    problem,
    speaking,
)
from tests.tools.processes import PATIENCE_S, wait_until
from tests.tools.record_examples import RECORDED
from tests.tools.recorded_bags import write_bag
from tests.tools.recordings import Recipe, tarred, write_csv, write_recording, zipped
from tests.tools.serving import Server
from tests.tools.survival import quick

ReplayRequest = JOB_KINDS["replay"].request

ZIP = {"content-type": "application/zip"}
EMPTY = tarred({f"{k}.csv": b"" for k in range(3_000)}, "gz")
SMALL = zipped({f"hall/{name}": text.encode() for name, text in RECORDED.items()})
PACKED = PackedRecording(b"0123", '{"name": "hall"}')


@pytest.fixture
def ann(server: Server) -> Iterator[httpx2.Client]:
    """The owner of no recordings."""
    with speaking(server, "rex") as http:
        yield http
        for one in http.get("/v1/recordings").json()["items"]:
            assert http.delete(f"/v1/recordings/{one['id']}").status_code == 204


def _folder_zipped(folder: Path) -> bytes:
    return zipped({f"{folder.name}/{path.name}": path.read_bytes() for path in folder.iterdir()})


def test_what_is_sent_is_kept_in_short_and_whole(
    ann: httpx2.Client, server: Server, tmp_path: Path
) -> None:
    recipe = Recipe(duration=2.0, period=0.1, nobody=2)
    numbers = write_recording(tmp_path / "numbers", recipe)
    log = load_log(numbers)
    folders = (numbers, write_csv(log, tmp_path / "csv"), write_bag(log, tmp_path / "bag"))
    for folder in folders:
        answer = ann.post("/v1/recordings", content=_folder_zipped(folder), headers=ZIP)
        assert answer.status_code == 201, answer.text
        made = answer.json()
        assert answer.headers["location"] == f"/v1/recordings/{made['id']}"
        assert ann.get(answer.headers["location"]).json() == made
        assert (made["name"], made["robots"]) == (folder.name, ["robot1", "robot2", "robot3"])
        landmarks = [8, 6, 7] if folder is numbers else ["8", "6", "7"]
        assert made["landmarks"] == landmarks
        assert made["distances"] == made["bearings"] == sum(len(one.times) for one in log.robots)
        assert made["has_truth"] is True
        assert made["duration_s"] == pytest.approx(3.0, abs=0.11)
    listed = ann.get("/v1/recordings?limit=2").json()
    assert [one["name"] for one in listed["items"]] == ["bag", "csv"]
    assert [one["name"] for one in ann.get(listed["next"]).json()["items"]] == ["numbers"]


def test_a_recording_may_be_named(ann: httpx2.Client) -> None:
    content = zipped({name: text.encode() for name, text in RECORDED.items()})
    for query, name in (("", "recording"), ("?name=field%203", "field 3")):
        answer = ann.post(f"/v1/recordings{query}", content=content, headers=ZIP)
        assert answer.json()["name"] == name
    answer = ann.post("/v1/recordings?name=%00", content=content, headers=ZIP)
    assert faults_of(answer)[0].path == "query.name"
    # under one key, other bytes are another request
    headers = {**ZIP, "idempotency-key": "one"}
    assert ann.post("/v1/recordings", content=SMALL, headers=headers).status_code == 201
    problem(ann.post("/v1/recordings", content=content, headers=headers), 422)


def test_a_renamed_recording_has_the_name_in_reports(ann: httpx2.Client) -> None:
    at = _kept(ann, SMALL)
    before = ann.get(at).json()
    answer = ann.patch(at, json={"name": "yard"})
    assert (answer.status_code, answer.json()) == (200, {**before, "name": "yard"})
    assert ann.get(at).json() == answer.json()
    job = done(ann, ann.post(f"{at}/replays").headers["location"])
    assert ann.get(job["result"]).json()["name"] == "yard"
    for body in ({}, {"name": ""}, {"name": "n" * 65}):
        assert [one.path for one in faults_of(ann.patch(at, json=body))] == ["name"]


BROKEN = RECORDED["odometry.csv"].replace("60,0.8", "60,fast")


@pytest.mark.parametrize(
    ("content", "path", "reported"),
    [
        (
            zipped({"a/b/odometry.csv": BROKEN.encode(), "a/b/landmarks.csv": b""}),
            "b/odometry.csv",
            "line 3: speed_mps is 'fast'; a number is needed",
        ),
        (zipped({"../odometry.csv": b""}), "", "'../odometry.csv' would be written elsewhere"),
        (EMPTY, "", "holds at least 2001 files and folders; allowed is up to 2000; leave out"),
        (b"", "", "can't be unpacked"),
    ],
    ids=["fault", "traversal", "empty", "nothing"],
)
def test_bad_archives_are_refused_and_nothing_is_kept(
    content: bytes, path: str, reported: str, ann: httpx2.Client
) -> None:
    answer = ann.post("/v1/recordings", content=content, headers=ZIP)
    (fault,) = faults_of(answer)
    assert (fault.path, reported in fault.message) == (path, True), fault
    assert "/tmp" not in answer.text
    assert ann.get("/v1/recordings").json()["items"] == []


def test_archives_have_their_own_limit_and_types(ann: httpx2.Client) -> None:
    # more than other bodies may have
    for size, status in ((1_100_000, 422), (2_000_001, 413)):
        answer = ann.post("/v1/recordings", content=b"x" * size, headers=ZIP)
        assert problem(answer, status).detail.count("2000000") == (status == 413)
    # a body that does not say how long it is
    problem(ann.post("/v1/recordings", content=iter([b"x" * 110_000] * 20), headers=ZIP), 413)
    problem(ann.post("/v1/plans", json={"name": "x" * 1_100_000}), 413)
    answer = ann.post("/v1/recordings", content=SMALL, headers={"content-type": "text/plain"})
    assert problem(answer, 415).detail.startswith("text/plain: the body must be a zip or tar")
    assert "application/zip" in answer.headers["accept"]
    coded = {**ZIP, "content-encoding": "gzip"}
    problem(ann.post("/v1/recordings", content=SMALL, headers=coded), 415)


def test_an_owner_has_room_for_so_many(ann: httpx2.Client) -> None:
    for _ in range(5):
        assert ann.post("/v1/recordings", content=SMALL, headers=ZIP).status_code == 201
    reported = problem(ann.post("/v1/recordings", content=SMALL, headers=ZIP), 507)
    assert reported.detail == "you have 5 stored recordings, the most allowed; delete some"


# --- replays ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def noisy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a while."""
    recipe = Recipe(duration=20.0, jitter=0.5, bearing_sigma=0.05, speed_sigma=0.1)
    return write_recording(tmp_path_factory.mktemp("noisy") / "hall", recipe, seed=5)


def _kept(ann: httpx2.Client, content: bytes) -> str:
    at: str = ann.post("/v1/recordings", content=content, headers=ZIP).headers["location"]
    return at


@pytest.mark.parametrize(
    ("asked", "options"),
    [
        ({}, []),
        (
            {"landmarks": [6, 7], "distances": False, "series": True, "bearing_sigma_rad": 0.05},
            ["--landmarks", "6,7", "--no-distances", "--series", "--bearing-sigma-rad", "0.05"],
        ),
        (
            {"start": "prior", "seed": 3, "gate_probability": 1, "delay_s": 0.01},
            ["--start", "prior", "--seed", "3", "--gate", "1", "--delay-s", "0.01"],
        ),
        ({"tune": True}, ["--tune"]),
    ],
    ids=["defaults", "bearings", "prior", "tune"],
)
def test_a_replay_is_the_command_lines_to_the_byte(
    asked: dict[str, Any],
    options: list[str],
    noisy: Path,
    ann: httpx2.Client,
    tmp_path: Path,
    run: Any,
) -> None:
    report = tmp_path / "report.json"
    assert run("replay", str(noisy), *options, "-o", str(report))[0] == 0
    at = _kept(ann, _folder_zipped(noisy))
    answer = ann.post(f"{at}/replays", json=asked)
    assert answer.status_code == 202, answer.text
    assert answer.json()["recording_id"] == at.rpartition("/")[2]
    ended = done(ann, answer.headers["location"])
    assert ended["progress"]["done"] == ended["progress"]["total"] > 100
    assert ann.get(ended["result"]).content == report.read_bytes()
    figure = ann.get(f"{answer.headers['location']}/figures/accuracy")
    assert figure.status_code == 200
    assert ann.get("/v1/jobs?limit=1").json()["items"][0]["kind"] == "replay"
    assert ann.delete(at).status_code == 204
    assert ann.get(ended["result"]).status_code == 200


@pytest.mark.parametrize(
    ("asked", "path", "reported"),
    [
        ({"landmarks": [9]}, "landmarks", "no landmark 9; there are 8, 6, 7"),
        ({"landmarks": ["6"]}, "landmarks", "no landmark '6'; there are 8, 6, 7"),
        ({"bearing_sigma_rad": 0}, "bearing_sigma_rad", ""),
        ({"speed_sigma_mps": 1e-9}, "speed_sigma_mps", "1e-09 given; allowed is 1e-06 to 1e+06"),
        ({"start": "given"}, "start_poses", "poses belong to a start that is given"),
        ({"start": "anywhere"}, "start", ""),
        ({"gate": 1}, "gate", ""),
    ],
)
def test_faults_of_a_request_name_its_keys(
    asked: dict[str, Any], path: str, reported: str, noisy: Path, ann: httpx2.Client
) -> None:
    at = _kept(ann, _folder_zipped(noisy))
    fault = faults_of(ann.post(f"{at}/replays", json=asked))[0]
    assert (fault.path, reported in fault.message) == (path, True), fault
    assert ann.delete(at).status_code == 204


def test_a_replay_that_can_not_be_says_why(ann: httpx2.Client) -> None:
    at = _kept(ann, SMALL)
    poses = {"start": "given", "start_poses": [[0, 0, 0], [1, 1, 1]]}
    job = ann.post(f"{at}/replays", json=poses).headers["location"]
    failed = ended(ann, job)
    assert failed["state"] == "failed"
    (fault,) = failed["error"]["errors"]
    assert fault["path"] == "start_poses"
    assert fault["message"].startswith("has shape (2, 3);")


def test_a_recording_without_truth_is_replayed_from_a_given_start(
    noisy: Path, server: Server, ann: httpx2.Client, tmp_path: Path, run: Any
) -> None:
    log = load_log(noisy)
    poses = true_poses(log, clock_of(log, 0.05))[0].tolist()
    blind = replace(log, robots=tuple(replace(one, truth=np.zeros((0, 4))) for one in log.robots))
    folder = write_csv(blind, tmp_path / "hall")
    at = _kept(ann, _folder_zipped(folder))
    assert ann.get(at).json()["has_truth"] is False
    for asked in ({}, {"start": "prior", "tune": True}):
        fault = faults_of(ann.post(f"{at}/replays", json=asked))[0]
        assert fault.path == "start"
        assert "needs the truth, which hall does not hold; give the start" in fault.message
    report = tmp_path / "report.json"
    text = ";".join(",".join(map(repr, pose)) for pose in poses)
    words = ("--start", "given", "--start-poses", text, "--series", "-o", str(report))
    assert run("replay", str(folder), *words)[0] == 0
    asked = {"start": "given", "start_poses": poses, "series": True}
    job = ann.post(f"{at}/replays", json=asked).headers["location"]
    ended = done(ann, job)
    assert ann.get(ended["result"]).content == report.read_bytes()
    drawn = {one: ann.get(f"{job}/figures/{one}") for one in ("sigmas", "estimates", "accuracy")}
    assert [answer.status_code for answer in drawn.values()] == [200, 200, 404]
    assert "has no truth, so errors are not known" in problem(drawn["accuracy"], 404).detail
    with Client(server.url, key_of("rex"), timeout_s=PATIENCE_S) as client:
        kept = client.upload(folder)
        document = client.wait(client.replay(kept, **asked))
        assert document == ReplayDocument.model_validate_json(report.read_text())
        assert not document.has_errors
        with pytest.raises(InputError, match="'truth' needs the truth, which hall does not hold"):
            client.replay(kept)


def test_a_recording_stays_until_its_job_has_ended(
    noisy: Path, server: Server, ann: httpx2.Client
) -> None:
    at = _kept(ann, _folder_zipped(noisy))
    with speaking(server, "bob") as bob:
        problem(bob.post(f"{at}/replays", json={}), 404)
    job = ann.post(f"{at}/replays", json={"tune": True}).headers["location"]
    reported = problem(ann.delete(at), 409)
    assert reported.detail.startswith("a job about the recording has not ended; wait for it, or")
    assert ann.post(f"{job}/cancel").json()["state"] == "cancelled"
    assert ann.delete(at).status_code == 204
    problem(ann.post(f"{at}/replays", json={}), 404)


@pytest.mark.long
def test_a_replay_outlives_the_processes_at_work_on_it(noisy: Path, tmp_path: Path) -> None:
    with quick(tmp_path) as site:
        server = site.serve()
        sent = site.ask("POST", "/v1/recordings", content=_folder_zipped(noisy), headers=ZIP)
        at = f"{sent.headers['location']}/replays"
        whole = site.ask("POST", at, json={"tune": True}).json()["id"]
        site.wait_for(whole, "succeeded")
        job = site.ask("POST", at, json={"tune": True}).json()["id"]
        wait_until(lambda: site.job(job)["progress"]["done"] > 0)
        site.kill(server)
        site.serve()
        assert site.wait_for(job, "succeeded")["progress"]["done"] > 0
        one, other = (site.ask("GET", f"/v1/jobs/{which}/result") for which in (whole, job))
        assert one.content == other.content


@pytest.mark.usefixtures("ann")
def test_a_client_replays(noisy: Path, server: Server, tmp_path: Path) -> None:
    with Client(server.url, key_of("rex"), timeout_s=PATIENCE_S) as client:
        kept = client.upload(noisy, name="field 3")
        assert (kept.name, kept.landmarks) == ("field 3", (8, 6, 7))
        seen: list[int] = []
        job = client.replay(kept, landmarks=[6], series=True)
        report = client.wait(job, lambda one: seen.append(one.done))
        assert seen[-1] == job.total
        log = replace(load_log(noisy), name="field 3")
        wanted = replay(log, landmarks=[6], with_series=True)
        assert report == replay_document(wanted)
        renamed = client.rename_recording(kept, "yard")
        assert (renamed.id, renamed.name) == (kept.id, "yard")
        assert list(client.recordings()) == [renamed]
        client.forget(kept)
        with pytest.raises(RemoteError, match="there is no recording"):
            client.replay(kept)
        archive = tmp_path / "hall.zip"
        archive.write_bytes(_folder_zipped(noisy))
        assert client.upload(archive).name == "hall"
        (bag,) = write_bag(load_log(noisy), tmp_path / "bag").glob("*.mcap")
        assert client.upload(bag).robots == kept.robots
        empty = write_bag(load_log(noisy), tmp_path / "empty" / "bag", empty_stamps=True)
        with pytest.raises(InputError, match="were stamps left empty"):
            client.upload(empty)
        assert client.upload(empty, stamps="received").robots == kept.robots
        with pytest.raises(InputError, match="'received' given; MRCLAM recordings have header"):
            client.upload(noisy, stamps="received")
        with pytest.raises(InputError, match="no such file or folder"):
            client.upload(tmp_path / "nowhere")


def test_what_may_be_asked_is_what_the_command_line_offers() -> None:
    command: Any = get_command(command_line.application())
    options = {option.name: option.default for option in command.commands["replay"].params}
    keys = ReplayOptions.request_keys()
    for name, key in keys.items():
        assert options[name] == ReplayRequest.model_fields[key].default, key
    assert set(keys.values()) == set(ReplayRequest.model_fields)
    assert set(options) - set(keys) == {"log", "output", "format_", "stamps"}


def test_a_recording_of_too_much_is_refused() -> None:
    limits = limits_of(load_settings(data_dir="/nowhere", max_sightings=100))
    short = Overview("hall", ("a", "b"), (), 0.0, 9.0, 60, 50, True)
    with pytest.raises(InputError, match=r"about 1.1e\+02 sightings; this service takes up to 1e"):
        ReplayRequest().work(short, limits)
    assert ReplayRequest.model_validate({"distances": False}).work(short, limits) == 60
    many = replace(short, robots=tuple(map(str, range(30_000))), distances=0)
    with pytest.raises(InputError, match="sightings times squared size of the state"):
        ReplayRequest().work(many, limits)


# --- below HTTP -----------------------------------------------------------------------------------


def test_few_recordings_are_taken_in_at_a_time() -> None:
    uploads = Uploads()
    held = [uploads.one_of(f"owner {k // MOST_OF_OWNER}") for k in range(MOST)]
    for k, one in enumerate(held):
        if k == MOST_OF_OWNER:
            with pytest.raises(TooManyRequests, match="2 of your recordings are being taken in"):
                uploads.one_of("owner 0").__enter__()
        one.__enter__()
    with pytest.raises(TooManyRequests, match="0 of your recordings are being taken in, 4 of all"):
        uploads.one_of("another").__enter__()
    held.pop().__exit__(None, None, None)
    with uploads.one_of("another"):
        pass


def test_what_is_packed_is_the_recording(tmp_path: Path) -> None:
    made = packed_recording(SMALL, "field", "header")
    log = unpack_log(made.data)
    assert (log.name, log.robots[0].name, log.robots[0].ranges.tolist()) == ("field", "rover", [8])
    assert pack_log(log) == made.data
    assert json.loads(made.overview)["name"] == "field"
    with pytest.raises(InputError) as refused:
        packed_recording(zipped({"odometry.csv": b"robot"}), None, "header")
    assert refused.value.key == "recording/odometry.csv"


def test_recordings_stay_while_a_job_needs_them(connection: Connection) -> None:
    row = holdings.add_recording(connection, "ann", PACKED)
    other = holdings.add_recording(connection, "ann", PACKED)
    job = add_job(connection, "ann", NewJob("validation", "{}", 1, None, None))
    connection.execute(update(jobs).where(jobs.c.id == job.id).values(recording_id=row.id))
    later = "9999"
    assert not holdings.delete_recording(connection, "ann", row.id)
    holdings.forget_recordings(connection, later)
    assert holdings.find_recording(connection, "ann", row.id) == row
    assert holdings.find_recording(connection, "ann", other.id) is None
    assert end_job(connection, job.id, "cancelled")
    assert holdings.delete_recording(connection, "bob", row.id)
    stored = select(recordings.c.data).where(recordings.c.id == row.id)
    assert connection.execute(stored).scalar() == b"0123"
    assert holdings.delete_recording(connection, "ann", row.id)
    assert connection.execute(stored).scalar() is None


def test_recordings_are_forgotten_by_age(connection: Connection) -> None:
    old, new = (holdings.add_recording(connection, "ann", PACKED) for _ in range(2))
    long_ago = earlier(moment(connection), 100.0)
    mine = recordings.c.id == old.id
    connection.execute(update(recordings).where(mine).values(created_at=long_ago))
    holdings.forget_recordings(connection, earlier(moment(connection), 50.0))
    assert connection.execute(select(recordings.c.id)).scalars().all() == [new.id]
    assert len(holdings.list_recordings(connection, "ann", 10, None)) == 1
    values = {"id": "x", "owner": "bob", "created_at": "", "size": 0, "overview": "", "data": b""}
    connection.execute(insert(recordings).values(values))
    assert len(holdings.list_recordings(connection, "ann", 10, None)) == 1
