"""Whatever is sent: what comes back is of the 2xx or a 4xx problem, and nothing is kept of it."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.searches.search_requests import SETTINGS, search
from tests.tools.mutations import draw_request, valid_scenarios
from tests.tools.serving import Server, running

QUICK = {
    "SYNCPLAN_MAX_VEHICLES": "15",
    "SYNCPLAN_MAX_SAMPLES": "2500",
    "SYNCPLAN_PLAN_TIMEOUT_S": "60",
    "SYNCPLAN_PROCESSES": "1",
}
"""Limits under which no plan takes long, or too long for a busy machine; one process is soon up."""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    settings = {**SETTINGS, **QUICK, "SYNCPLAN_DATA_DIR": str(tmp_path)}
    one = Server(tmp_path / "log", port=None, **settings)
    with running(one):
        yield one


@pytest.mark.long
def test_no_request_breaks_the_service(server: Server) -> None:
    assert search(server, 60, seed=3, warm_up=6, passes=0).faults == []


def test_the_same_draw_is_the_same_request() -> None:
    scenarios = valid_scenarios()

    def sent(seed: int, number: int) -> list[bytes]:
        drawn = draw_request(np.random.default_rng([seed, number]), scenarios, ["0" * 36])
        return drawn.pieces()

    assert [sent(5, k) for k in range(50)] == [sent(5, k) for k in range(50)]
    assert sent(5, 1) != sent(6, 1)
