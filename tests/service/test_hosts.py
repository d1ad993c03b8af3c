"""Whose pages may ask a service without keys: names, addresses, and what reads like them."""

import asyncio
import socket
import tracemalloc
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api.problems import ForeignPage, WrongHost
from api.security import LocalOnly, names_here
from tests.tools.api_apps import bare_app

SERVER = "192.0.2.7"


def _status(*names: str, host: str, origin: str | None = None) -> int:
    app = bare_app(LocalOnly, names=names)

    @app.get("/")
    def nothing() -> None: ...

    headers = {"host": host, **({} if origin is None else {"origin": origin})}
    return TestClient(app, base_url=f"http://{SERVER}").get("/", headers=headers).status_code


@pytest.mark.parametrize(
    ("status", "hosts"),
    [
        (200, ["localhost", "LocalHost:8000", "localhost.", "127.0.0.1:80", "127.1.2.3:9"]),
        (200, ["[::1]", "[::1]:9", "[::ffff:127.0.0.1]", SERVER, f"{SERVER}:80"]),
        (421, ["", ":8000", "plans.example", "localhost.plans.example", "127.0.0.1.example"]),
        (421, ["192.0.2.8", "[::2]"]),
    ],
)
def test_hosts_are_this_machine_or_the_address_that_was_reached(
    status: int, hosts: list[str]
) -> None:
    for host in hosts:
        assert _status(host=host) == status, host
        if status == 200:
            assert _status(host=host, origin=f"http://{host}") == 200, host


def test_names_that_are_given_are_accepted_and_no_others() -> None:
    assert _status("Plans.Example", host="plans.example:443", origin="https://plans.example") == 200
    assert _status("plans.example", host="plans.example", origin="https://evil.example") == 403
    assert _status("plans.example", host="x.plans.example") == 421


def test_an_origin_that_names_no_host_of_here_is_refused() -> None:
    for origin in ("null", "", "evil.example", "http://", "://localhost"):
        assert _status(host="localhost", origin=origin) == 403, origin
    assert _status(host="localhost", origin="https://localhost.evil.example") == 403


@pytest.mark.parametrize("header", [b"host", b"origin"])
def test_large_hosts_leave_no_memory(header: bytes) -> None:
    async def untouched(*_: Any) -> Any: ...

    guard = LocalOnly(untouched, ())

    async def ask() -> None:
        for number in range(500):
            value = b"http://%d." % number + b"x" * 10_000
            scope = {"type": "http", "headers": [(header, value)]}
            with pytest.raises((WrongHost, ForeignPage)):
                await guard(scope, untouched, untouched)

    tracemalloc.start()
    try:
        asyncio.run(ask())
        assert tracemalloc.get_traced_memory()[0] < 500 * 2000
    finally:
        tracemalloc.stop()


def test_beyond_loopback_the_name_of_the_machine_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket, "gethostname", lambda: "Rover")
    assert names_here(["127.0.0.1", "[::1]"], []) == {"127.0.0.1", "::1"}
    assert names_here(["localhost"], ["a.example"]) == {"localhost", "a.example"}
    assert names_here(["0.0.0.0"], []) == {"rover"}
    assert names_here(["192.0.2.7"], []) == {"rover", "192.0.2.7"}
    assert names_here(["plans.example"], []) == {"rover", "plans.example"}
    assert names_here([""], []) == {"rover"}
