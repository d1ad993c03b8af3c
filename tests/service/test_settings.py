"""Settings: defaults, the environment, what is refused and how it is reported."""

import os
from pathlib import Path

import pytest
from pydantic import ValidationError
from sqlalchemy.engine import make_url

from api.settings import Settings, load_settings
from syncplan.errors import InputError
from syncplan.runtime.machine import usable_cores

KEY = "0123456789abcdef"
OTHER = "fedcba9876543210"


@pytest.fixture(autouse=True)
def _clean(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in list(os.environ):
        if name.startswith("SYNCPLAN_"):
            monkeypatch.delenv(name)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))


def _fault(**overrides: object) -> str:
    with pytest.raises(InputError) as caught:
        load_settings(**overrides)
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_defaults_listen_here_and_keep_data_in_the_users_folder(tmp_path: Path) -> None:
    settings = load_settings()
    assert (settings.host, settings.port) == ("127.0.0.1", 8000)
    assert settings.data_dir == tmp_path / "syncplan"
    assert settings.api_keys == ()
    assert settings.process_count == usable_cores()
    assert settings.job_niceness == 10
    assert not settings.insecure
    assert not settings.telemetry


def test_a_relative_data_home_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", "relative")
    monkeypatch.setenv("HOME", "/home/pilot")
    assert load_settings().data_dir == Path("/home/pilot/.local/share/syncplan")


def test_every_field_is_described_and_settings_are_frozen() -> None:
    for name, field in Settings.model_fields.items():
        assert field.description, name
    with pytest.raises(ValidationError):
        load_settings().port = 1


def test_the_environment_sets_and_overrides_come_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SYNCPLAN_PORT", "9000")
    monkeypatch.setenv("SYNCPLAN_PROCESSES", "3")
    monkeypatch.setenv("SYNCPLAN_LOG_LEVEL", "WARNING")
    # empty, it counts as not set
    monkeypatch.setenv("SYNCPLAN_DATABASE_URL", "")
    assert load_settings().database_url is None
    assert load_settings(host=None).port == 9000
    assert load_settings().process_count == 3
    assert load_settings().log_level == "warning"
    assert load_settings(port=9001).port == 9001


FAULTS = {
    "TILES": [
        ("tiles.example.org/{z}/{x}/{y}.png", "must be an address with {z}, {x} and {y}"),
        ("https://tiles.example.org/{z}/{x}.png", "must be an address with {z}, {x} and {y}"),
        ("https://a.org; script-src */{z}/{x}/{y}", "must be an address with {z}, {x} and {y}"),
    ],
    "PORT": [
        ("99999", "'99999': must be at most 65535"),
        ("1\n2", "'1\\n2': must be a valid integer"),
    ],
    "INSECURE": [("perhaps", "'perhaps': must be a valid boolean")],
    "LOG_LEVEL": [("loud", "'debug', 'info', 'warning' or 'error'")],
    "PLAN_TIMEOUT_S": [("inf", "'inf': must be a finite number")],
    "MAX_VEHICLES": [("0", "'0': must be at least 1")],
    "DATA_DIR": [("~nobody-at-all/x", "'~nobody-at-all/x': has no home")],
    "ALLOWED_HOSTS": [
        ("plans.example:8000", "must be a name or an address"),
        ("a b", "must be a name or an address"),
    ],
    "API_KEYS": [
        (f"ops:{KEY},hush-hush", "the key of entry 2 must be 16 or more printable ASCII charact"),
        (f"ops:{KEY},lab:{OTHER},{KEY}", "entry 1 and entry 3 have the same key and other names"),
        (f":{KEY}", "the name of entry 1 must be"),
        (f"o p:{KEY}", "the name of entry 1 must be"),
        (f"{KEY}:ops", "the key of entry 1 must be 16 or more"),
        (f"ops:{KEY}\u00e9", "the key of entry 1 must be 16 or more"),
        (f"ops:{KEY} {KEY}", "the key of entry 1 must be 16 or more"),
    ],
    "DATABASE_URL": [
        ("postgresql+psycopg2://u:hush-hush@h/x", "is neither SQLite nor PostgreSQL"),
        ("postgresql://u:hush-hush/@@h:port/x", "can't be read as an address"),
        ("hush-hush@h", "can't be read as an address"),
        ("postgresql://h?password=hush-hush", "names no database"),
        ("sqlite://", "names no file"),
        ("sqlite:///:memory:", "names no file"),
        ("sqlite:///x?mode=memory", "names no file, or more than a file"),
    ],
}


@pytest.mark.parametrize(
    ("name", "value", "reported"), [(name, *one) for name, rows in FAULTS.items() for one in rows]
)
def test_a_bad_value_is_reported_in_one_line_without_its_secrets(
    monkeypatch: pytest.MonkeyPatch, name: str, value: str, reported: str
) -> None:
    monkeypatch.setenv(f"SYNCPLAN_{name}", value)
    text = _fault()
    assert text.startswith(f"SYNCPLAN_{name}: ")
    assert reported in text
    assert KEY not in text
    assert "hush-hush" not in text


def test_what_spans_two_settings_names_one_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SYNCPLAN_HEARTBEAT_S", "5")
    assert _fault().startswith("SYNCPLAN_DEAD_AFTER_S: '8.0': must be at least two heartbeats")


def test_all_faults_are_reported_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SYNCPLAN_PORT", "x")
    monkeypatch.setenv("SYNCPLAN_BATCH_S", "-1")
    text = _fault()
    assert text.startswith("SYNCPLAN_PORT: ")
    assert "; SYNCPLAN_BATCH_S: '-1': must be greater than 0" in text


def test_a_bad_override_goes_by_its_own_name() -> None:
    assert _fault(port=-1).startswith("port: '-1': ")
    assert _fault(colour="red") == "colour: is no setting"


def test_a_long_value_is_shortened(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SYNCPLAN_PORT", "9" * 5000)
    assert len(_fault()) < 300


def test_keys_have_names_and_a_bare_key_keeps_its_name_for_good(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("SYNCPLAN_API_KEYS", f" ops:{KEY}, {OTHER},")
    first, second = load_settings().api_keys
    assert (first.name, first.key.get_secret_value()) == ("ops", KEY)
    assert second.key.get_secret_value() == OTHER
    monkeypatch.setenv("SYNCPLAN_API_KEYS", OTHER)
    assert load_settings().api_keys == (second,)


def test_nothing_secret_is_in_the_representation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SYNCPLAN_API_KEYS", f"ops:{KEY}")
    monkeypatch.setenv("SYNCPLAN_DATABASE_URL", "postgresql://u:hush-hush@db/plans")
    settings = load_settings()
    for text in (repr(settings), str(settings)):
        assert KEY not in text
        assert "hush-hush" not in text


def test_the_embedded_database_lies_in_the_data_folder(tmp_path: Path) -> None:
    folder = tmp_path / "odd #?% name"
    url = make_url(load_settings(data_dir=folder).database)
    assert url.drivername == "sqlite"
    assert url.database == str(folder / "syncplan.db")


@pytest.mark.parametrize("scheme", ["postgres", "postgresql", "postgresql+psycopg"])
def test_postgresql_goes_through_psycopg_3_with_its_password(scheme: str) -> None:
    settings = load_settings(database_url=f"{scheme}://u:p%40ss@db:5433/plans?sslmode=require")
    assert settings.database == "postgresql+psycopg://u:p%40ss@db:5433/plans?sslmode=require"


def test_a_relative_sqlite_file_is_made_absolute(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert load_settings(database_url="sqlite:///plans.db").database == (
        f"sqlite:///{tmp_path}/plans.db"
    )


@pytest.mark.parametrize(
    ("given", "hosts"),
    [
        ("", ()),
        ("plans.example", ("plans.example",)),
        (" Plans.Example , 192.0.2.7,::1,", ("plans.example", "192.0.2.7", "::1")),
    ],
)
def test_further_hosts_are_names_separated_by_commas(
    monkeypatch: pytest.MonkeyPatch, given: str, hosts: tuple[str, ...]
) -> None:
    monkeypatch.setenv("SYNCPLAN_ALLOWED_HOSTS", given)
    assert load_settings().allowed_hosts == hosts
