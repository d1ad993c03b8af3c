"""Twenty long jobs of one owner do not hold up a short job of another."""

from functools import partial
from pathlib import Path
from typing import Any

import httpx2
import pytest

from tests.tools.api_servers import serving, speaking
from tests.tools.processes import memory_given_back, wait_until
from tests.tools.scenarios import example

LONG_JOBS = 20
PATIENCE_S = 100.0
"""For a job that takes a second or, where a process is started for it, a few."""


def long_job(number: int, plan_id: str, scenario: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """The path and the body of a job that takes minutes: of each kind in turn."""
    validation = (f"/v1/plans/{plan_id}/validations", {"trials": 100_000, "seed": number})
    search = {"vary": ["phases", "centers"], "starts": 1000, "time_limit_s": 600}
    sweep = {"scenario": scenario, "range_m": [45.0, 55.0], "trials": 50_000, "seed": number}
    return (validation, (f"/v1/plans/{plan_id}/refinements", search), ("/v1/sweeps", sweep))[
        number % 3
    ]


def succeeded(http: httpx2.Client, job: str) -> bool:
    shown = http.get(f"/v1/jobs/{job}").json()
    assert shown["state"] not in ("failed", "cancelled"), shown
    return bool(shown["state"] == "succeeded")


@pytest.mark.long
@pytest.mark.parametrize("address", ["postgresql"], indirect=True)
def test_twenty_long_jobs_do_not_hold_up_a_short_one_of_another(
    address: str | None, tmp_path: Path
) -> None:
    settings = {"SYNCPLAN_PROCESSES": "2"}
    if address is not None:
        settings["SYNCPLAN_DATABASE_URL"] = address
    scenario = example("paper-grid-same").model_dump(mode="json", exclude_none=True)
    with (
        serving(tmp_path, "ann bob", **settings) as server,
        speaking(server, "ann") as ann,
        speaking(server, "bob") as bob,
    ):
        plans = {one: one.post("/v1/plans", json=scenario).json()["id"] for one in (ann, bob)}
        with memory_given_back(server.popen.pid):
            for number in range(LONG_JOBS):
                path, body = long_job(number, plans[ann], scenario)
                answer = ann.post(path, json=body)
                assert answer.status_code == 202, answer.text

        def at_work() -> int:
            jobs = ann.get("/v1/jobs").json()["items"]
            return sum(job["state"] == "running" for job in jobs)

        wait_until(lambda: at_work() >= 2)
        path = f"/v1/plans/{plans[bob]}/validations"
        for seed in range(3):
            job = bob.post(path, json={"trials": 10, "seed": seed}).json()["id"]
            wait_until(partial(succeeded, bob, job), PATIENCE_S)
        ended = [job["id"] for job in ann.get("/v1/jobs").json()["items"] if job["ended_at"]]
        assert ended == []
        assert at_work() >= 2
