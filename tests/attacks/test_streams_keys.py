"""A key that has leaked is withdrawn while the service runs, and its streams end."""

import asyncio
from pathlib import Path

import httpx2
import pytest

from tests.tools.followers import connected
from tests.tools.processes import PATIENCE_S, wait_until
from tests.tools.scenarios import document
from tests.tools.serving import Server, running, settings_of

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
    given = {
        **settings_of(tmp_path / "data"),
        "SYNCPLAN_API_KEYS_FILE": str(keys),
        "SYNCPLAN_API_KEYS": f"bob:{OTHER}",
    }
    server = Server(tmp_path / "log", "--no-worker", port=None, **given)
    with running(server), httpx2.Client(base_url=server.url, timeout=PATIENCE_S) as http:

        def status(key: str, path: str = "/v1/plans") -> int:
            return http.get(path, headers={"authorization": f"Bearer {key}"}).status_code

        def queued(key: str) -> str:
            headers = {"authorization": f"Bearer {key}"}
            plan = http.post("/v1/plans", json=document(), headers=headers).json()["id"]
            at = http.post(f"/v1/plans/{plan}/validations", json={}, headers=headers)
            return f"{at.headers['location']}/events"

        async def followed() -> None:
            hers, his = queued(OLD), queued(OTHER)
            async with (
                connected(server, hers, 3, OLD) as old,
                connected(server, his, 1, OTHER) as other,
            ):
                for one in (*old, *other):
                    await one.read_until(b"event: job")
                listed(keys, f"ann:{OLD}", f"ann:{NEW}")
                await asyncio.to_thread(wait_until, lambda: status(NEW) == 200)
                assert status(OLD) == status(OTHER) == 200
                async with connected(server, hers, 1, NEW) as new:
                    await new[0].read_until(b"event: job")
                    listed(keys, f"ann:{NEW}")
                    for one in old:
                        assert (await one.read_until(b"\r\n0\r\n\r\n")).endswith(b"0\r\n\r\n")
                    assert status(OLD) == 401
                    assert status(NEW) == status(OTHER) == 200
                    assert not new[0].text.endswith(b"0\r\n\r\n")
                    assert not other[0].text.endswith(b"0\r\n\r\n")
                # nobody is locked out by a slip of the pen
                listed(keys, "ann")
                wait_until(lambda: status(NEW) == 200 and "the keys of before stay" in log())
                assert NEW not in log()

        def log() -> str:
            return server.log.read_text()

        asyncio.run(followed())
