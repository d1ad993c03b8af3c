"""A key that has leaked is withdrawn while the service runs, and its streams end."""

from pathlib import Path

import httpx2
import pytest

from tests.tools.processes import PATIENCE_S, wait_until
from tests.tools.raw_connections import crowd_of, read_until, request_of
from tests.tools.scenarios import document
from tests.tools.serving import open_server

OLD, NEW, OTHER = "old-0123456789abcdef", "new-0123456789abcdef", "bob-0123456789abcdef"


def listed(path: Path, *entries: str) -> None:
    """Put keys in the place of those that are there, as a whole."""
    beside = path.with_name("next")
    beside.write_text("\n".join(("# owners", *entries)))
    beside.chmod(0o600)
    beside.replace(path)


@pytest.mark.long
def test_a_key_is_changed_without_downtime_and_the_old_one_ends_with_its_streams(
    tmp_path: Path,
) -> None:
    keys = tmp_path / "keys"
    listed(keys, f"ann:{OLD}")
    given = {"SYNCPLAN_API_KEYS_FILE": str(keys), "SYNCPLAN_API_KEYS": f"bob:{OTHER}"}
    with (
        open_server(tmp_path, "--no-worker", **given) as server,
        httpx2.Client(base_url=server.url, timeout=PATIENCE_S) as http,
    ):

        def status(key: str) -> int:
            return http.get("/v1/plans", headers={"authorization": f"Bearer {key}"}).status_code

        def queued(key: str) -> str:
            headers = {"authorization": f"Bearer {key}"}
            plan = http.post("/v1/plans", json=document(), headers=headers).json()["id"]
            at = http.post(f"/v1/plans/{plan}/validations", json={}, headers=headers)
            return str(at.headers["location"])

        def log() -> str:
            return server.log.read_text()

        hers, his = queued(OLD), queued(OTHER)
        with (
            crowd_of(server, 3, request_of(f"{hers}/events", OLD)) as old,
            crowd_of(server, 1, request_of(f"{his}/events", OTHER)) as other,
        ):
            for one in (*old, *other):
                read_until(one, b"event: job")
            listed(keys, f"ann:{OLD}", f"ann:{NEW}")
            wait_until(lambda: status(NEW) == 200)
            assert status(OLD) == status(OTHER) == 200
            with crowd_of(server, 1, request_of(f"{hers}/events", NEW)) as new:
                read_until(new[0], b"event: job")
                listed(keys, f"ann:{NEW}")
                for one in old:
                    assert read_until(one, b"0\r\n\r\n").endswith(b"0\r\n\r\n")
                assert status(OLD) == 401
                assert status(NEW) == status(OTHER) == 200
                # the streams of other keys go on
                for job, key, stream in ((hers, NEW, new), (his, OTHER, other)):
                    headers = {"authorization": f"Bearer {key}"}
                    http.post(f"{job}/cancel", headers=headers).raise_for_status()
                    assert b"cancelled" in read_until(stream[0], b"cancelled")
        # nobody is locked out by a slip of the pen
        listed(keys, "ann")
        wait_until(lambda: status(NEW) == 200 and "the keys of before stay" in log())
        assert NEW not in log()
