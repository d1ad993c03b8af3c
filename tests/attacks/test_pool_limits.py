"""Work that needs too much memory or time ends with the limit and a remedy; the rest goes on."""

from pathlib import Path
from typing import Any

import httpx2

from tests.tools.api_servers import problem, serving, speaking
from tests.tools.processes import family, memory_given_back, wait_until
from tests.tools.scenarios import document, shared_circles


def _ended(http: httpx2.Client, at: str) -> dict[str, Any]:
    last: dict[str, Any] = {}

    def ended() -> bool:
        last.update(http.get(at).json())
        return last["ended_at"] is not None

    wait_until(ended)
    return last


def _largest(processes: list[int]) -> int:
    """The most memory, in bytes, that one of these processes ever held."""
    peaks = []
    for one in processes:
        lines = Path(f"/proc/{one}/status").read_text().splitlines()
        peaks += [int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM")]
    return max(peaks)


def test_a_plan_that_needs_too_much_memory_is_refused_with_the_limit(tmp_path: Path) -> None:
    limit = 350 * 2**20
    settings = {"SYNCPLAN_TASK_MEMORY_BYTES": str(limit)}
    with serving(tmp_path, "ann", **settings) as server, speaking(server, "ann") as ann:
        assert ann.post("/v1/plans", json=document()).status_code == 201
        with memory_given_back(server.popen.pid):
            refused = problem(ann.post("/v1/plans", json=shared_circles(9)), 422)
        assert "350 MiB of memory" in refused.detail
        assert "fewer vehicles" in refused.detail
        assert ann.post("/v1/plans", json=document()).status_code == 201
        assert _largest(family(server.popen.pid)) < 1.2 * limit


def test_a_row_of_a_sweep_that_takes_too_long_fails_with_the_limit(tmp_path: Path) -> None:
    with (
        serving(tmp_path, "ann", SYNCPLAN_JOB_TASK_S="2") as server,
        speaking(server, "ann") as ann,
    ):
        sweep = {"scenario": shared_circles(8), "range_m": [50.0], "trials": 1}
        answer = ann.post("/v1/sweeps", json=sweep)
        assert answer.status_code == 202, answer.text
        with memory_given_back(server.popen.pid):
            job = _ended(ann, answer.headers["location"])
        assert job["state"] == "failed"
        assert "2 s" in job["error"]["detail"]
        assert "fewer vehicles" in job["error"]["detail"]


def test_what_would_take_minutes_is_refused_before_it_is_begun(tmp_path: Path) -> None:
    crowd = shared_circles(19)
    asked: dict[str, dict[str, Any]] = {
        "/v1/plans": crowd,
        "/v1/previews": crowd,
        "/v1/sweeps": {"scenario": crowd, "range_m": [50.0, 60.0], "trials": 10},
    }
    with serving(tmp_path, "ann") as server, speaking(server, "ann") as ann:
        for path, body in asked.items():
            with memory_given_back(server.popen.pid):
                refused = problem(ann.post(path, json=body), 422)
            assert "sightings expected" in refused.detail, path
            assert "takes up to" in refused.detail
