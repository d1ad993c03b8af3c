"""Clients that leave while their recording is unpacked: nothing of it stays on the disk."""

import contextlib
from pathlib import Path

import pytest

from tests.tools.api_servers import key_of, serving, speaking
from tests.tools.processes import wait_until
from tests.tools.raw_connections import connected
from tests.tools.recordings import zipped

ROWS = 4_000_000
"""Rows that take much longer to read than a task may run once its client has gone."""


@pytest.mark.long
def test_a_client_that_leaves_during_an_upload_leaves_nothing_behind(tmp_path: Path) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    rows = b"robot,time_s,speed_mps,turn_rate_rad_s\n" + b"".join(
        b"r1,%d,1,0\n" % number for number in range(ROWS)
    )
    sightings = b"robot,time_s,target,bearing_rad,range_m\nr1,1,r2,0,1\n"
    archive = zipped({"odometry.csv": rows, "sightings.csv": sightings})
    request = (
        f"POST /v1/recordings HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/zip\r\n"
        f"Authorization: Bearer {key_of('eve')}\r\nContent-Length: {len(archive)}\r\n\r\n"
    )

    def unpacked() -> int:
        """Bytes of temporary files."""
        sizes = 0
        for file in scratch.rglob("*"):
            with contextlib.suppress(OSError):
                sizes += file.stat().st_size if file.is_file() else 0
        return sizes

    with (
        serving(tmp_path, "ann eve", "--no-worker", TMPDIR=str(scratch)) as server,
        speaking(server, "ann") as ann,
    ):
        with connected(server.port) as connection:
            connection.sendall(request.encode() + archive)
            wait_until(lambda: unpacked() >= len(rows))
        running = 'syncplan_pool_tasks{pool="requests",state="running"} 0.0'
        wait_until(lambda: running in ann.get("/metrics").text)
        # a process is killed a moment before what it left is removed
        wait_until(lambda: unpacked() == 0, seconds=10.0)
