"""Several HTTP processes on one socket: connections spread, figures add up, none is missed."""

import http.client
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily

from api.connections import ConnectionTable, Place
from api.metrics import Collected, merged
from api.settings import Share, divided, load_settings
from api.supervisor import Scrapes
from tests.tools.api_servers import done, serving, speaking
from tests.tools.processes import PATIENCE_S, alive, command, family, wait_until
from tests.tools.scenarios import document
from tests.tools.serving import Process, Server

COUNTER = 'syncplan_http_requests_total{method="GET",route="/v1/schemas/scenario",status="200"}'


# --- parts --------------------------------------------------------------------------------------


@pytest.mark.parametrize("total", [1, 2, 3, 7, 64])
@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_parts_of_a_total_add_up_to_it_and_are_one_at_least(total: int, count: int) -> None:
    parts = [Share(number, count).of(total) for number in range(count)]
    assert sum(parts) == max(total, count)
    assert max(parts) - min(parts) <= 1


def test_each_process_has_its_part_of_the_limits_and_the_first_one_the_worker() -> None:
    settings = load_settings(max_plan_queue=9, max_connections=100)
    parts = [divided(settings, Share(number, 2)) for number in range(2)]
    assert [one.max_plan_queue for one in parts] == [5, 4]
    assert [one.max_connections for one in parts] == [50, 50]
    assert [one.max_connections_per_address for one in parts] == [None, None]
    assert [one.embedded_worker for one in parts] == [True, False]
    assert divided(settings, Share()) == settings


def test_a_process_gives_way_to_one_with_fewer_connections_but_not_to_one_that_has_gone() -> None:
    table = ConnectionTable.made(3)
    first, second, _ = (Place(table, number, lambda: None) for number in range(3))
    assert not first.gives_way(5)
    assert not second.gives_way(4)
    assert first.gives_way(5)
    assert not first.gives_way(4)
    second.leave()
    assert not first.gives_way(5)


# --- metrics ------------------------------------------------------------------------------------


def _metrics(requests: float, busy: float, jobs: float) -> Collected:
    counter = CounterMetricFamily("syncplan_http_requests", "", labels=["method"])
    counter.add_metric(["GET"], requests, created=1000.0 + requests)
    states = GaugeMetricFamily("syncplan_jobs", "", labels=["state"])
    states.add_metric(["queued"], jobs)
    return [counter, GaugeMetricFamily("syncplan_processes_busy", "", value=busy), states]


def _values(metrics: Collected) -> dict[str, float]:
    return {sample.name: sample.value for one in metrics for sample in one.samples}


def test_counts_and_gauges_of_processes_add_up_and_those_of_the_service_are_taken_once() -> None:
    assert _values(merged([_metrics(3.0, 1.0, 7.0), _metrics(4.0, 2.0, 7.0)])) == {
        "syncplan_http_requests_total": 7.0,
        "syncplan_http_requests_created": 1003.0,
        "syncplan_processes_busy": 3.0,
        "syncplan_jobs": 7.0,
    }


class Members:
    """Processes that send nothing by themselves, and what they are sent."""

    def __init__(self) -> None:
        self.now = 0.0
        self.sent: list[tuple[int, str, object]] = []
        self.scrapes = Scrapes(lambda *message: self.sent.append(message), lambda: self.now)

    def answer(self) -> dict[str, float]:
        """Return the values of the one answer to a scrape."""
        ((_, _, value),) = [one for one in self.sent if one[1] == "scraped"]
        self.sent.clear()
        assert isinstance(value, tuple)
        return _values(merged(value[1]))


def test_a_scrape_waits_for_every_process_and_answers_the_one_that_asked() -> None:
    members = Members()
    members.scrapes.ask(1, 17, [0, 1])
    assert [(to, kind) for to, kind, _ in members.sent] == [(0, "sample"), (1, "sample")]
    number = members.sent[0][2]
    assert isinstance(number, int)
    members.scrapes.sampled(0, number, _metrics(3.0, 0.0, 0.0))
    assert len(members.sent) == 2
    members.scrapes.sampled(1, number, _metrics(4.0, 0.0, 0.0))
    to, kind, value = members.sent[-1]
    assert (to, kind) == (1, "scraped")
    assert isinstance(value, tuple)
    assert value[0] == 17
    assert members.answer()["syncplan_http_requests_total"] == 7.0
    assert members.scrapes.deadline is None


def test_a_process_that_does_not_answer_in_time_counts_with_its_last_sample() -> None:
    members = Members()
    for asked, replies in ((0, (0, 1)), (1, (0,))):
        members.scrapes.ask(0, asked, [0, 1])
        number = members.sent[-1][2]
        assert isinstance(number, int)
        for one in replies:
            members.scrapes.sampled(one, number, _metrics(3.0, 1.0, 5.0))
        if asked == 0:
            assert members.answer()["syncplan_processes_busy"] == 2.0
    assert members.scrapes.deadline is not None
    members.now = members.scrapes.deadline - 0.01
    members.scrapes.conclude_due()
    assert all(kind == "sample" for _, kind, _ in members.sent)
    members.now += 0.02
    members.scrapes.conclude_due()
    found = members.answer()
    assert found["syncplan_http_requests_total"] == 6.0
    assert found["syncplan_jobs"] == 5.0


def test_what_a_process_counted_stays_when_it_has_ended_and_what_it_did_does_not() -> None:
    members = Members()
    for round_ in range(2):
        present = [0, 1] if round_ == 0 else [0]
        members.scrapes.ask(0, round_, present)
        number = members.sent[-1][2]
        assert isinstance(number, int)
        for one in present:
            members.scrapes.sampled(one, number, _metrics(3.0, 1.0, 5.0))
        if round_ == 0:
            members.sent.clear()
            members.scrapes.ended(1)
    found = members.answer()
    assert found["syncplan_http_requests_total"] == 6.0
    assert found["syncplan_processes_busy"] == 1.0


def test_a_scrape_does_not_wait_for_a_process_that_ends_meanwhile() -> None:
    members = Members()
    members.scrapes.ask(0, 0, [0, 1])
    number = members.sent[-1][2]
    assert isinstance(number, int)
    members.scrapes.sampled(0, number, _metrics(3.0, 1.0, 5.0))
    members.scrapes.ended(1)
    assert members.answer()["syncplan_http_requests_total"] == 3.0
    members.scrapes.ask(0, 1, [0, 1])
    members.scrapes.ended(0)
    assert members.scrapes.deadline is None


# --- a service ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service of two HTTP processes that does its jobs."""
    with serving(tmp_path_factory.mktemp("pair"), "ann", "--http-processes", "2") as one:
        wait_until(lambda: begun(one) == 2)
        yield one


@pytest.fixture
def ann(pair: Server) -> Iterator[httpx2.Client]:
    """A client of the pair."""
    with speaking(pair, "ann") as http:
        yield http


def members_of(process: Process) -> list[int]:
    """Return the HTTP processes of a service, oldest first."""
    return [one for one in family(process.popen.pid) if "api.member" in command(one)]


def begun(server: Server) -> int:
    """Return how many HTTP processes have begun to take connections so far."""
    return server.log.read_text().count("Application startup complete")


def sockets_of(process: int) -> int:
    """Return how many sockets a process has open."""
    folder = Path(f"/proc/{process}/fd")
    return sum(os.readlink(entry).startswith("socket:") for entry in folder.iterdir())


def counted(server: Server) -> float:
    """Return how often the schema was read, as a scrape over a new connection says."""
    with speaking(server, "ann") as http:
        text = http.get("/metrics").text
    return next((float(line.split()[-1]) for line in text.splitlines() if COUNTER in line), 0.0)


def test_connections_that_stay_are_spread_evenly(pair: Server) -> None:
    before = {one: sockets_of(one) for one in members_of(pair)}
    connections = [
        http.client.HTTPConnection("127.0.0.1", pair.port, timeout=PATIENCE_S) for _ in range(8)
    ]
    for one in connections:
        one.request("GET", "/healthz")
        assert one.getresponse().read() == b'{"status":"ok"}'
    taken = sorted(sockets_of(one) - before[one] for one in before)
    for one in connections:
        one.close()
    assert taken[0] >= 3
    assert sum(taken) == 8


def test_every_scrape_counts_what_all_processes_have_answered(pair: Server) -> None:
    before = counted(pair)
    for _ in range(6):
        with speaking(pair, "ann") as http:
            assert http.get("/v1/schemas/scenario").status_code == 200
    assert [counted(pair) for _ in range(4)] == [before + 6.0] * 4


def test_plans_and_jobs_are_those_of_one_service(pair: Server, ann: httpx2.Client) -> None:
    plan = ann.post("/v1/plans", json=document()).json()["id"]
    for _ in range(4):
        with speaking(pair, "ann") as http:
            assert http.get(f"/v1/plans/{plan}").json()["id"] == plan
    job = ann.post(f"/v1/plans/{plan}/validations", json={"trials": 2, "duration_s": 2.0})
    assert done(ann, job.headers["location"])["progress"]["done"] == 2


def test_a_process_that_is_killed_is_replaced_while_the_other_answers(pair: Server) -> None:
    before, killed = counted(pair), members_of(pair)[1]
    os.kill(killed, signal.SIGKILL)
    for _ in range(10):
        with speaking(pair, "ann") as http:
            assert http.get("/healthz").status_code == 200
    wait_until(lambda: not alive(killed) and begun(pair) == 3)
    assert counted(pair) == before
    assert "HTTP process 1 ended" in pair.log.read_text()


def test_told_to_end_the_service_ends_in_order_and_leaves_nothing(tmp_path: Path) -> None:
    with serving(tmp_path, "ann", "--http-processes", "2", "--no-worker") as server:
        everyone = family(server.popen.pid)
        wait_until(lambda: begun(server) == 2)
        assert server.stop() == 0
        wait_until(lambda: not any(map(alive, everyone)), 20.0)
        assert server.log.read_text().count("Application shutdown complete") == 2


def test_a_service_whose_supervisor_is_killed_leaves_nothing(pair: Server) -> None:
    everyone = family(pair.popen.pid)
    assert len(everyone) >= 5
    pair.kill()
    wait_until(lambda: not any(map(alive, everyone)), 20.0)


def test_a_service_whose_processes_cannot_begin_says_so_and_ends(tmp_path: Path) -> None:
    log = tmp_path / "log"
    process = Process(
        "serve", "--port", "0", "--http-processes", "2", log=log, SYNCPLAN_DATA_DIR=str(tmp_path)
    )
    wait_until(lambda: len(members_of(process)) == 2)
    for one in members_of(process):
        os.kill(one, signal.SIGKILL)
    assert process.popen.wait(timeout=PATIENCE_S) == 1
    assert "could not start" in log.read_text()
