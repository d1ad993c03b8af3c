"""The container's files: what can be said of them where no container engine runs."""

import re
from typing import Any

import pytest
from ruamel.yaml import YAML

from api.settings import PREFIX, Settings
from tests.tools.serving import ROOT

DOCKERFILE = (ROOT / "Dockerfile").read_text()
INSTRUCTIONS = [
    (line.split()[0], line.partition(" ")[2].strip())
    for line in re.sub(r"\\\n\s*", "", DOCKERFILE).splitlines()
    if line and not line.startswith("#")
]
LAST_STAGE = INSTRUCTIONS[max(k for k, (name, _) in enumerate(INSTRUCTIONS) if name == "FROM") :]


@pytest.fixture(scope="module")
def services() -> Any:
    """What compose.yaml says, its anchors resolved."""
    return YAML(typ="safe").load(ROOT / "compose.yaml")["services"]


def _variables(text: str) -> set[str]:
    return set(re.findall(rf"\b{PREFIX}(\w+)", text))


def test_all_that_is_copied_is_there_and_not_ignored() -> None:
    ignore = (ROOT / ".dockerignore").read_text().splitlines()
    assert ignore[0] == "*"
    for name, rest in INSTRUCTIONS:
        if name == "COPY" and "--from" not in rest:
            for source in rest.split()[:-1]:
                assert (ROOT / source).exists()
                assert f"!{source.partition('/')[0]}" in ignore
    packages = {rest.split()[0] for name, rest in INSTRUCTIONS if name == "COPY"}
    assert {"api", "syncplan"} <= packages


def test_the_image_serves_as_a_user_without_rights() -> None:
    told = dict(LAST_STAGE)
    assert told["USER"] == "syncplan"
    assert [rest for name, rest in LAST_STAGE if name == "USER"] == ["syncplan"]
    assert (told["ENTRYPOINT"], told["CMD"]) == ('["syncplan"]', '["serve"]')
    assert told["VOLUME"] == "/var/lib/syncplan"
    assert "healthcheck.py" in told["HEALTHCHECK"]


def test_variables_of_the_image_are_settings_and_none_is_a_secret() -> None:
    (environment,) = (rest for name, rest in LAST_STAGE if name == "ENV")
    given = _variables(environment)
    assert given == {"DATA_DIR", "HOST", "PORT"}
    assert {name.lower() for name in given} <= set(Settings.model_fields)


def test_the_parts_of_the_composition(services: Any) -> None:
    assert set(services) == {"database", "serve", "worker"}
    assert services["serve"]["command"] == ["serve", "--no-worker"]
    assert services["worker"]["command"] == ["worker"]
    assert services["worker"]["deploy"]["replicas"] == 2
    assert "ports" not in services["database"]
    assert "pg_isready" in services["database"]["healthcheck"]["test"]
    assert services["database"]["volumes"] == ["database:/var/lib/postgresql/data"]
    for name in ("serve", "worker"):
        assert services[name]["depends_on"] == {"database": {"condition": "service_healthy"}}
        names = {key.removeprefix(PREFIX) for key in services[name]["environment"]}
        assert {one.lower() for one in names - {"PGPASSWORD"}} <= set(Settings.model_fields)


def test_no_secret_has_a_default_and_a_missing_one_is_told(services: Any) -> None:
    secrets = [
        services["database"]["environment"]["POSTGRES_PASSWORD"],
        services["serve"]["environment"]["SYNCPLAN_API_KEYS"],
        services["serve"]["environment"]["PGPASSWORD"],
        services["worker"]["environment"]["PGPASSWORD"],
    ]
    assert all(re.fullmatch(r"\$\{\w+:\?[^}]{10,}\}", one) for one in secrets)
    for name in ("serve", "worker"):
        assert services[name]["environment"]["SYNCPLAN_DATABASE_URL"] == (
            "postgresql://syncplan@database/syncplan"
        )
    # the only default that lets anybody in lets this machine in
    (port,) = services["serve"]["ports"]
    assert port == "${SYNCPLAN_PUBLISH:-127.0.0.1:8000}:8000"
