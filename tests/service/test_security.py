"""Keys and owners: who is let in, what the document says of it, where the service may listen."""

import contextlib
import hashlib
import hmac
import re
import socket
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import httpx2
import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from api import keys
from api.keys import ApiKey, keys_of_lines
from api.problems import Unauthorized
from api.security import CurrentOwner, Keyring, KeyThrottle, refuse_exposure
from api.settings import Settings, load_settings
from syncplan.errors import InputError
from tests.tools.api_apps import bare_app

OPS, LAB = "ops-key-0123456789", "lab-key-0123456789"


def _settings(**overrides: Any) -> Settings:
    return load_settings(**{"api_keys": f"ops:{OPS},lab:{LAB}", **overrides})


def _client(settings: Settings) -> TestClient:
    app: FastAPI = bare_app()
    app.state.settings = settings
    app.state.keyring = Keyring(settings)
    app.state.key_throttle = KeyThrottle(settings.max_refused_keys)

    @app.get("/me")
    def me(owner: CurrentOwner) -> str:
        return owner

    return TestClient(app)


def test_keys_stand_for_their_owners_and_anything_else_is_refused() -> None:
    keyring = Keyring(_settings())
    assert (keyring.owner_of(OPS), keyring.owner_of(LAB)) == ("ops", "lab")
    for presented in (None, "", "ops", OPS[:-1], OPS + "x", "\udcff", "é"):
        with pytest.raises(Unauthorized):
            keyring.owner_of(presented)
    held = repr(vars(keyring))
    assert OPS not in held
    assert LAB not in held
    # an owner may have several keys, and without keys everybody is the local owner
    keyring = Keyring(_settings(api_keys=f"ops:{OPS},ops:{LAB}"))
    assert keyring.owner_of(OPS) == keyring.owner_of(LAB) == "ops"
    assert Keyring(load_settings()).owner_of(None) == "local"
    assert Keyring(load_settings()).owner_of("whatever") == "local"


# --- a file of keys -----------------------------------------------------------------------------


@pytest.fixture
def listed(tmp_path: Path) -> Path:
    """A file with one key."""
    path = tmp_path / "keys"
    path.write_text(f"# who may ask\n\n  ops:{OPS}\n")
    path.chmod(0o600)
    return path


def test_a_file_is_read_again_when_it_changes_and_at_most_once_a_second(listed: Path) -> None:
    clock = Mock(return_value=0.0)
    keyring = Keyring(load_settings(api_keys_file=listed), clock)
    assert keyring.owner_of(OPS) == "ops"
    before = keyring.version
    listed.write_text(f"ops:{LAB}\n")
    clock.return_value = 0.9
    assert keyring.owner_of(OPS) == "ops"
    clock.return_value = 1.1
    assert keyring.owner_of(LAB) == "ops"
    with pytest.raises(Unauthorized):
        keyring.owner_of(OPS)
    assert keyring.version == before + 1
    assert keyring.admits("ops", hashlib.sha256(LAB.encode()).digest())
    for owner, key in (("ops", OPS), ("lab", LAB)):
        assert not keyring.admits(owner, hashlib.sha256(key.encode()).digest())


@pytest.mark.parametrize(
    ("content", "reported"),
    [
        ("# none\n", "has no key; give NAME:KEY"),
        (f"ops:{OPS}\n{LAB}\n", "line 2 has no colon"),
        (f"# keys\no ps:{OPS}", "the name of line 2 must be"),
        ("ops:short-secre", "the key of line 1 must be 16 or more"),
        (f"ops:{OPS}\nlab:{OPS}", "line 1 and line 2 have the same key and other names"),
        (f"mine:{LAB}", "has a key of SYNCPLAN_API_KEYS under another name"),
        (b"\xff\xfe", "is not UTF-8"),
        (b"#" * (2**20 + 1), "is larger than 1048576 bytes"),
        (None, "can't be read: No such file or directory"),
    ],
)
def test_a_file_that_can_not_serve_keeps_the_keys_of_before_and_is_logged_once(
    listed: Path, content: str | bytes | None, reported: str, caplog: pytest.LogCaptureFixture
) -> None:
    clock = Mock(return_value=0.0)
    given = f"lab:{LAB}" if "SYNCPLAN_API_KEYS" in reported else None
    keyring = Keyring(load_settings(api_keys=given, api_keys_file=listed), clock)
    if content is None:
        listed.unlink()
    else:
        listed.write_bytes(content if isinstance(content, bytes) else content.encode())
    for _ in range(3):
        clock.return_value += 2.0
        assert keyring.owner_of(OPS) == "ops"
    (entry,) = [one.getMessage() for one in caplog.records if one.levelname == "ERROR"]
    assert entry.startswith(f"the keys of before stay: {listed}: {reported}")
    assert OPS not in caplog.text
    assert "short-secre" not in caplog.text
    # at the start there are no keys of before
    with pytest.raises(InputError, match=re.escape(reported)) as caught:
        Keyring(load_settings(api_keys=given, api_keys_file=listed))
    assert "\n" not in str(caught.value)
    # and once it is mended it counts again
    listed.write_text(f"ops:{OPS}9")
    clock.return_value += 2.0
    assert keyring.owner_of(f"{OPS}9") == "ops"


@pytest.mark.parametrize(("mode", "warned"), [(0o600, False), (0o640, False), (0o644, True)])
def test_a_file_that_everybody_may_read_is_warned_of(
    listed: Path, mode: int, warned: bool, caplog: pytest.LogCaptureFixture
) -> None:
    listed.chmod(mode)
    Keyring(load_settings(api_keys_file=listed))
    assert ("chmod 600" in caplog.text) is warned


def test_a_file_that_goes_while_it_is_read_serves_until_the_next_look(
    listed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_last(text: str) -> tuple[ApiKey, ...]:
        listed.unlink()
        return keys_of_lines(text)

    monkeypatch.setattr(keys, "keys_of_lines", read_last)
    assert Keyring(load_settings(api_keys_file=listed)).owner_of(OPS) == "ops"


def test_a_file_and_the_variable_hold_good_together(listed: Path) -> None:
    keyring = Keyring(load_settings(api_keys=f"lab:{LAB},ops:{OPS}", api_keys_file=listed))
    assert (keyring.owner_of(OPS), keyring.owner_of(LAB)) == ("ops", "lab")
    refuse_exposure(load_settings(host="0.0.0.0", api_keys_file=listed))


def test_every_key_is_compared_in_constant_time_whichever_fits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    compare = Mock(wraps=hmac.compare_digest)
    keyring = Keyring(_settings())
    monkeypatch.setattr(hmac, "compare_digest", compare)
    assert keyring.owner_of(OPS) == "ops"
    assert [list(map(len, called.args)) for called in compare.call_args_list] == [[32, 32]] * 2


def test_a_request_with_a_key_is_its_owners_and_any_other_a_401_problem() -> None:
    client = _client(_settings())
    for header in (None, "Bearer", f"Basic {OPS}", f"Bearer {OPS}x", f"Bearer {OPS} {OPS}", OPS):
        response = client.get("/me", headers={"Authorization": header} if header else {})
        assert response.status_code == 401
        assert response.headers["content-type"] == "application/problem+json"
        assert response.headers["www-authenticate"] == "Bearer"
    assert client.get("/me", headers={"Authorization": f"Bearer {LAB}"}).json() == "lab"
    assert client.get("/me", headers={"Authorization": f"bearer {OPS}"}).json() == "ops"
    assert _client(load_settings()).get("/me").json() == "local"


def test_wrong_keys_are_throttled_and_logged_with_their_address(
    caplog: pytest.LogCaptureFixture,
) -> None:
    client = _client(_settings(max_refused_keys=5))

    def answer(key: str) -> httpx2.Response:
        return client.get("/me", headers={"Authorization": f"Bearer {key}"})

    assert answer(OPS).status_code == 200
    answers = [answer(f"guess-{number:020d}") for number in range(7)]
    assert [one.status_code for one in answers] == [401] * 5 + [429] * 2
    assert int(answers[-1].headers["retry-after"]) >= 1
    # who was at work here before is not stopped by that, and who is new has to wait
    assert (answer(OPS).status_code, answer(LAB).status_code) == (200, 429)
    refused = [one for one in caplog.records if one.getMessage() == "key refused"]
    assert [vars(one)["address"] for one in refused] == ["testclient"] * 5


def test_this_machine_needs_no_key() -> None:
    for host in ("127.0.0.1", "127.9.9.9", "::1", "[::1]", "::ffff:127.0.0.1", "localhost"):
        refuse_exposure(load_settings(host=host))


@pytest.mark.parametrize(
    "host", ["", "0.0.0.0", "::", "[::]", "192.0.2.7", "2001:db8::1", "fe80::1%1", "no.invalid"]
)
def test_elsewhere_keys_or_a_word_are_needed(monkeypatch: pytest.MonkeyPatch, host: str) -> None:
    monkeypatch.setattr(socket, "getaddrinfo", Mock(side_effect=OSError("no such name")))
    with pytest.raises(InputError) as caught:
        refuse_exposure(load_settings(host=host))
    text = str(caught.value)
    assert text.startswith(f"SYNCPLAN_HOST: {host!r}: ")
    assert "SYNCPLAN_API_KEYS" in text
    assert "--insecure" in text
    assert "\n" not in text
    refuse_exposure(load_settings(host=host, insecure=True))
    refuse_exposure(_settings(host=host))


@pytest.mark.parametrize(
    ("found", "refused"),
    [(["127.0.1.1"], False), (["127.0.1.1", "192.0.2.7"], True), (["192.0.2.7"], True)],
)
def test_a_name_counts_by_all_its_addresses(
    monkeypatch: pytest.MonkeyPatch, found: list[str], refused: bool
) -> None:
    entries = [(socket.AF_INET, socket.SOCK_STREAM, 0, "", (address, 0)) for address in found]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: entries)
    with pytest.raises(InputError) if refused else contextlib.nullcontext():
        refuse_exposure(load_settings(host="rover"))
