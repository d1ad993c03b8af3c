"""Several HTTP processes on one socket: connections spread, figures add up, none is missed."""

import http.client
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from api.connections import ConnectionTable, Place
from api.metrics import SHARED, forget_process
from api.settings import Share, divided, load_settings
from tests.tools.api_servers import planned, serving, speaking
from tests.tools.processes import PATIENCE_S, alive, command, family, wait_until
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

PUBLISHER = """
import sys
from functools import partial
from api.computing.pool import PoolDepth
from api.metrics import Metrics
from api.readings import pool_readings

requests, running, oldest_s = map(float, sys.argv[1:])
metrics = Metrics()
depth = PoolDepth(4, running, 2, 1, oldest_s, 9)
metrics.watch(partial(pool_readings, {"requests": lambda: depth}))
metrics.watch(lambda: {"syncplan_jobs": {("queued",): 7}}, of="service")
for _ in range(int(requests)):
    metrics.observe("GET", "/v1/plans", "200", 0.25)
metrics.publish()
for _ in sys.stdin:
    print(metrics.render()[0].decode() + "END", flush=True)
"""
"""A process that has answered requests and publishes its metrics; it is scraped by a line."""


class Publisher:
    """One of several processes whose metrics are those of one service."""

    def __init__(self, folder: Path, *figures: float) -> None:
        self.popen = subprocess.Popen(
            [sys.executable, "-c", PUBLISHER, *map(str, figures)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, SHARED: str(folder)},
        )

    def scrape(self) -> dict[str, float]:
        """Return the values of all metrics by their names, labels included."""
        assert self.popen.stdin is not None
        assert self.popen.stdout is not None
        self.popen.stdin.write("\n")
        self.popen.stdin.flush()
        lines = iter(self.popen.stdout.readline, "END\n")
        pairs = (line.rsplit(" ", 1) for line in lines if not line.startswith("#"))
        return {name: float(value) for name, value in pairs}

    def kill(self) -> None:
        """End the process."""
        self.popen.kill()
        self.popen.communicate()


@pytest.fixture
def publishers(tmp_path: Path) -> Iterator[tuple[Publisher, Publisher]]:
    """Two processes: requests that they have answered, tasks at work, the longest wait."""
    both = Publisher(tmp_path, 3, 1, 7.5), Publisher(tmp_path, 4, 2, 2.0)
    for one in both:
        # it has published
        one.scrape()
    yield both
    for one in both:
        one.kill()


REQUESTS = 'syncplan_http_requests_total{method="GET",route="/v1/plans",status="200"}'
SECONDS = 'syncplan_http_request_duration_seconds_sum{method="GET",route="/v1/plans",status="200"}'


def test_figures_of_processes_add_up_and_what_one_counted_stays_when_it_has_ended(
    publishers: tuple[Publisher, Publisher], tmp_path: Path
) -> None:
    for each in publishers:
        found = each.scrape()
        assert found[REQUESTS] == 7.0
        assert found[SECONDS] == 7 * 0.25
        assert found["syncplan_processes_busy"] == 3.0
        assert found['syncplan_pool_processes{pool="requests"}'] == 8.0
        assert found['syncplan_pool_tasks{pool="requests",state="running"}'] == 3.0
        assert found['syncplan_pool_tasks{pool="requests",state="waiting"}'] == 4.0
        assert found['syncplan_pool_owners_waiting{pool="requests"}'] == 2.0
        assert found['syncplan_pool_children_started_total{pool="requests"}'] == 18.0
        # those of the service are taken once, the longest wait is that of all
        assert found['syncplan_jobs{state="queued"}'] == 7.0
        assert found['syncplan_pool_oldest_waiting_seconds{pool="requests"}'] == 7.5
        # the service began with its first process and takes the memory of all
        assert found["process_start_time_seconds"] <= time.time()
        assert found["process_resident_memory_bytes"] > 2**25
        assert found["process_open_fds"] >= 2 * 3
        assert found["process_cpu_seconds_total"] > 0.0
    one, other = publishers
    # while it does not answer, it counts with what it published last
    other.popen.send_signal(signal.SIGSTOP)
    found = one.scrape()
    assert found[REQUESTS] == 7.0
    assert found["syncplan_processes_busy"] == 3.0
    other.kill()
    forget_process(other.popen.pid, str(tmp_path))
    found = one.scrape()
    assert found[REQUESTS] == 7.0
    assert found['syncplan_pool_children_started_total{pool="requests"}'] == 18.0
    assert found["syncplan_processes_busy"] == 1.0
    assert found['syncplan_pool_oldest_waiting_seconds{pool="requests"}'] == 7.5
    assert found['syncplan_jobs{state="queued"}'] == 7.0


# --- a service ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service of two HTTP processes."""
    folder = tmp_path_factory.mktemp("pair")
    with serving(folder, "ann", "--http-processes", "2", "--no-worker") as one:
        wait_until(lambda: begun(one) == 2)
        yield one


def members_of(process: Process) -> list[int]:
    """Return the HTTP processes of a service, oldest first."""
    return [one for one in family(process.popen.pid) if "api.processes" in command(one)]


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


@pytest.mark.long
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


@pytest.mark.long
def test_plans_and_jobs_are_those_of_one_service(pair: Server) -> None:
    with speaking(pair, "ann") as http:
        plan = f"/v1/plans/{planned(http)['id']}"
        job = http.post(f"{plan}/validations").headers["location"]
    for _ in range(4):
        with speaking(pair, "ann") as http:
            assert [http.get(at).status_code for at in (plan, job)] == [200, 200]


@pytest.mark.long
def test_a_process_that_is_killed_is_replaced_while_the_other_answers_and_counts_stay(
    pair: Server,
) -> None:
    before = counted(pair)
    for _ in range(6):
        with speaking(pair, "ann") as http:
            assert http.get("/v1/schemas/scenario").status_code == 200
    assert [counted(pair) for _ in range(4)] == [before + 6.0] * 4
    killed = members_of(pair)[1]
    os.kill(killed, signal.SIGKILL)
    for _ in range(10):
        with speaking(pair, "ann") as http:
            assert http.get("/healthz").status_code == 200
    wait_until(lambda: not alive(killed) and begun(pair) == 3)
    assert counted(pair) == before + 6.0
    assert "HTTP process 1 ended" in pair.log.read_text()


@pytest.mark.long
def test_when_asked_to_end_the_service_ends_in_order_and_leaves_nothing(tmp_path: Path) -> None:
    with serving(tmp_path, "ann", "--http-processes", "2", "--no-worker") as server:
        everyone = family(server.popen.pid)
        wait_until(lambda: begun(server) == 2)
        assert server.stop() == 0
        wait_until(lambda: not any(map(alive, everyone)), 20.0)
        assert server.log.read_text().count("Application shutdown complete") == 2


@pytest.mark.long
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
