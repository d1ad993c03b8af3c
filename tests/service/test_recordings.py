"""Recordings over HTTP: taken in whole or not at all, each owner's own, kept while needed."""

import json
from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest
from sqlalchemy import Connection, insert, select, update

from api.packed_recordings import PackedRecording, packed_recording
from api.problems import TooManyRequests
from api.storage import recording_records
from api.storage.clock import earlier, moment
from api.storage.job_records import NewJob, add_job, end_job
from api.storage.tables import jobs, recordings
from api.uploads import MOST, MOST_OF_OWNER, Uploads
from syncplan.errors import InputError
from syncplan.recordings.packed_logs import pack_log, unpack_log
from syncplan.recordings.recording_formats import load_log
from tests.tools.api_servers import problem, serving, speaking
from tests.tools.record_examples import RECORDED
from tests.tools.recorded_bags import write_bag
from tests.tools.recordings import Recipe, write_csv, write_recording, zipped
from tests.tools.serving import Server

ZIP = {"content-type": "application/zip"}
SMALL = zipped({f"hall/{name}": text.encode() for name, text in RECORDED.items()})
PACKED = PackedRecording(b"0123", '{"name": "hall"}')


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service that takes archives of up to 100 kB, more than it does of other bodies."""
    folder = tmp_path_factory.mktemp("recordings")
    limits = {
        "SYNCPLAN_RECORDING_LIMIT_BYTES": "100000",
        "SYNCPLAN_BODY_LIMIT_BYTES": "50000",
        "SYNCPLAN_MAX_RECORDINGS": "5",
        "SYNCPLAN_PROCESSES": "1",
    }
    with serving(folder, "ann bob", "--no-worker", **limits) as one:
        yield one


@pytest.fixture
def ann(server: Server) -> Iterator[httpx2.Client]:
    """The first owner, who has no recordings."""
    with speaking(server, "ann") as http:
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
    answer = ann.post("/v1/recordings", content=content, headers=ZIP)
    assert answer.json()["name"] == "recording"
    answer = ann.post("/v1/recordings?name=field%203", content=content, headers=ZIP)
    assert answer.json()["name"] == "field 3"
    told = problem(ann.post("/v1/recordings?name=%00", content=content, headers=ZIP), 422)
    assert told.errors is not None
    assert told.errors[0].path == "query.name"


def test_a_request_that_is_repeated_keeps_one(ann: httpx2.Client) -> None:
    headers = {**ZIP, "idempotency-key": "one"}
    first = ann.post("/v1/recordings", content=SMALL, headers=headers)
    again = ann.post("/v1/recordings", content=SMALL, headers=headers)
    assert (again.status_code, again.content) == (201, first.content)
    assert len(ann.get("/v1/recordings").json()["items"]) == 1
    problem(ann.post("/v1/recordings", content=SMALL + b"\0", headers=headers), 422)


def test_what_is_anothers_is_not_there(ann: httpx2.Client, server: Server) -> None:
    at = ann.post("/v1/recordings", content=SMALL, headers=ZIP).headers["location"]
    with speaking(server, "bob") as bob:
        for method in ("GET", "DELETE"):
            told = problem(bob.request(method, at), 404)
            assert told.detail == f"there is no recording {at.rpartition('/')[2]}"
        assert bob.get("/v1/recordings").json()["items"] == []
    assert ann.delete(at).status_code == 204
    problem(ann.get(at), 404)


BROKEN = RECORDED["odometry.csv"].replace("60,0.8", "60,fast")


@pytest.mark.parametrize(
    ("content", "path", "told"),
    [
        (
            zipped({"a/b/odometry.csv": BROKEN.encode(), "a/b/landmarks.csv": b""}),
            "b/odometry.csv",
            "line 3: speed_mps is 'fast'; a number is needed",
        ),
        (zipped({"../odometry.csv": b""}), "", "'../odometry.csv' would be written elsewhere"),
        (zipped({"words.txt": b""}), "", "holds none of *.dat, *.csv"),
        (zipped({"odometry.csv": bytes(2**30 + 1)})[: 2**21], "", ""),
        (b"no archive", "", "can't be unpacked"),
        (b"", "", "can't be unpacked"),
    ],
    ids=["fault", "traversal", "words", "bomb", "bytes", "nothing"],
)
def test_bad_archives_are_refused_and_nothing_is_kept(
    content: bytes, path: str, told: str, ann: httpx2.Client
) -> None:
    if len(content) > 100_000:
        problem(ann.post("/v1/recordings", content=content, headers=ZIP), 413)
        return
    found = problem(ann.post("/v1/recordings", content=content, headers=ZIP), 422)
    assert found.errors is not None
    assert [one.path for one in found.errors] == [path]
    assert told in found.errors[0].message
    assert "/tmp" not in found.detail
    assert ann.get("/v1/recordings").json()["items"] == []


def test_archives_have_their_own_limit_and_types(ann: httpx2.Client) -> None:
    for size, status in ((60_000, 422), (100_001, 413)):
        answer = ann.post("/v1/recordings", content=b"x" * size, headers=ZIP)
        assert problem(answer, status).detail.count("100000") == (status == 413)
    # a body that does not say how long it is
    problem(ann.post("/v1/recordings", content=iter([b"x" * 60_000] * 2), headers=ZIP), 413)
    problem(ann.post("/v1/plans", json={"name": "x" * 60_000}), 413)
    answer = ann.post("/v1/recordings", content=SMALL, headers={"content-type": "text/plain"})
    assert problem(answer, 415).detail.startswith("text/plain: the body must be a zip or tar")
    assert "application/zip" in answer.headers["accept"]
    coded = {**ZIP, "content-encoding": "gzip"}
    problem(ann.post("/v1/recordings", content=SMALL, headers=coded), 415)


def test_an_owner_has_room_for_so_many(ann: httpx2.Client) -> None:
    for _ in range(5):
        assert ann.post("/v1/recordings", content=SMALL, headers=ZIP).status_code == 201
    told = problem(ann.post("/v1/recordings", content=SMALL, headers=ZIP), 507)
    assert told.detail == "you have 5 stored recordings, the most allowed; delete some"


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
    made = packed_recording(SMALL, "field")
    log = unpack_log(made.data)
    assert (log.name, log.robots[0].name, log.robots[0].ranges.tolist()) == ("field", "rover", [8])
    assert pack_log(log) == made.data
    assert json.loads(made.overview)["name"] == "field"
    with pytest.raises(InputError) as refused:
        packed_recording(zipped({"odometry.csv": b"robot"}), None)
    assert refused.value.key == "recording/odometry.csv"


def test_recordings_stay_while_a_job_needs_them(connection: Connection) -> None:
    row = recording_records.add_recording(connection, "ann", PACKED)
    other = recording_records.add_recording(connection, "ann", PACKED)
    job = add_job(connection, "ann", NewJob("validation", "{}", 1, None, None))
    connection.execute(update(jobs).where(jobs.c.id == job.id).values(recording_id=row.id))
    later = "9999"
    assert not recording_records.delete_recording(connection, "ann", row.id)
    recording_records.forget_recordings(connection, later)
    assert recording_records.find_recording(connection, "ann", row.id) == row
    assert recording_records.find_recording(connection, "ann", other.id) is None
    assert end_job(connection, job.id, "cancelled")
    assert recording_records.delete_recording(connection, "bob", row.id)
    assert recording_records.recording_data(connection, row.id) == b"0123"
    assert recording_records.delete_recording(connection, "ann", row.id)
    assert recording_records.recording_data(connection, row.id) is None


def test_recordings_are_forgotten_by_age(connection: Connection) -> None:
    old, new = (recording_records.add_recording(connection, "ann", PACKED) for _ in range(2))
    long_ago = earlier(moment(connection), 100.0)
    mine = recordings.c.id == old.id
    connection.execute(update(recordings).where(mine).values(created_at=long_ago))
    recording_records.forget_recordings(connection, earlier(moment(connection), 50.0))
    assert connection.execute(select(recordings.c.id)).scalars().all() == [new.id]
    assert recording_records.count_recordings(connection, "ann") == 1
    values = {"id": "x", "owner": "bob", "created_at": "", "size": 0, "overview": "", "data": b""}
    connection.execute(insert(recordings).values(values))
    assert recording_records.count_recordings(connection, "ann") == 1
