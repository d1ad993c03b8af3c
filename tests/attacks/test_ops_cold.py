"""A service that is still loading, and clients that do not wait for it: none is blamed for that."""

import contextlib
from pathlib import Path

import httpx2
import pytest

from tests.tools.api_servers import key_of
from tests.tools.processes import PATIENCE_S, wait_until
from tests.tools.scenarios import document
from tests.tools.serving import Process, free_port, running, settings_of


@pytest.mark.long
def test_requests_before_the_service_is_ready_are_said_to_be_early(tmp_path: Path) -> None:
    port = free_port()
    settings = {
        **settings_of(tmp_path / "data"),
        "SYNCPLAN_API_KEYS": f"ann:{key_of('ann')}",
        # nobody waits for long
        "SYNCPLAN_PLAN_TIMEOUT_S": "0.1",
    }
    process = Process("serve", "--port", str(port), "--no-worker", log=tmp_path / "log", **settings)
    details: list[str] = []
    headers = {"authorization": f"Bearer {key_of('ann')}"}
    with (
        running(process),
        httpx2.Client(
            base_url=f"http://127.0.0.1:{port}", headers=headers, timeout=PATIENCE_S
        ) as ann,
    ):

        def ready() -> bool:
            """Ask for a plan, and whether the service is ready."""
            with contextlib.suppress(httpx2.TransportError):
                answer = ann.post("/v1/plans", params={"paper": "true"}, json=document())
                if answer.status_code == 503:
                    details.append(answer.json()["detail"])
                return ann.get("/readyz").status_code == 200
            return False

        wait_until(ready)
    assert {detail for detail in details if "starting" not in detail} == set()
