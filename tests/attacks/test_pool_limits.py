"""Work beyond its memory, time or share ends with the limit and a remedy; the rest goes on."""

from pathlib import Path

import httpx2
import pytest

from tests.attacks.conftest import TASK_MEMORY_MIB
from tests.tools.api_servers import done, problem, speaking
from tests.tools.processes import family, memory_given_back
from tests.tools.scenarios import document, shared_circles
from tests.tools.serving import Server


def _largest(processes: list[int]) -> int:
    """The most memory, in MiB, that one of these processes ever held."""
    peaks = []
    for one in processes:
        lines = Path(f"/proc/{one}/status").read_text().splitlines()
        peaks += [int(line.split()[1]) // 1024 for line in lines if line.startswith("VmHWM")]
    return max(peaks)


@pytest.mark.long
def test_a_plan_that_needs_too_much_memory_is_refused_with_the_limit(
    server: Server, ann: httpx2.Client
) -> None:
    with memory_given_back(server.popen.pid):
        refused = problem(ann.post("/v1/plans", json=shared_circles(9)), 422)
    assert f"{TASK_MEMORY_MIB} MiB of memory" in refused.detail
    assert "fewer vehicles" in refused.detail
    assert ann.post("/v1/plans", json=document()).status_code == 201
    assert _largest(family(server.popen.pid)) < 1.2 * TASK_MEMORY_MIB


def test_an_owner_whose_seconds_of_a_day_are_spent_is_refused_and_others_are_not(
    server: Server, ann: httpx2.Client
) -> None:
    def asked(http: httpx2.Client) -> httpx2.Response:
        plan = http.post("/v1/plans", json=document()).json()["id"]
        return http.post(f"/v1/plans/{plan}/validations", json={"trials": 40})

    done(ann, asked(ann).headers["location"])
    refused = asked(ann)
    assert "the most allowed is 0.001 s" in problem(refused, 429).detail
    assert int(refused.headers["retry-after"]) > 0
    with speaking(server, "bob") as bob:
        assert asked(bob).status_code == 202
