"""The container's files: what can be said of them where no container engine runs."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.responses import JSONResponse
from ruamel.yaml import YAML

from api.settings import PREFIX, Settings
from tests.tools.api_apps import served
from tests.tools.serving import ROOT

DOCKERFILE = (ROOT / "Dockerfile").read_text()
INSTRUCTIONS = [
    (line.split()[0], line.partition(" ")[2].strip())
    for line in re.sub(r"\\\n\s*", "", DOCKERFILE).splitlines()
    if line and not line.startswith("#")
]
LAST_STAGE = INSTRUCTIONS[max(k for k, (name, _) in enumerate(INSTRUCTIONS) if name == "FROM") :]
ENVIRONMENT = dict(pair.split("=", 1) for pair in dict(LAST_STAGE)["ENV"].split())


@pytest.fixture(scope="module")
def services() -> Any:
    """What compose.yaml says, its anchors resolved."""
    return YAML(typ="safe").load(ROOT / "compose.yaml")["services"]


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


def _pins(lock: str) -> dict[str, str]:
    """Each pin of a lock with the text of its hashes; nothing else may be in it."""
    entries = re.findall(
        r"^([a-z0-9.-]+==\S+)((?: \\\n    --hash=sha256:[0-9a-f]{64})*)\n", lock, re.M
    )
    assert sum(len(pin) + len(hashes) + 1 for pin, hashes in entries) == len(lock)
    return dict(entries)


def test_the_image_has_the_versions_that_are_tested_all_with_their_hashes() -> None:
    everything, served = (
        _pins((ROOT / name).read_text()) for name in ("requirements.lock", "docker/service.lock")
    )
    assert all(everything.values())
    assert served.items() <= everything.items()
    assert {"fastapi", "hatchling"} <= {pin.partition("==")[0] for pin in served}
    assert len(served) < len(everything)


def test_the_image_serves_as_a_user_without_rights() -> None:
    steps = dict(LAST_STAGE)
    assert [rest for name, rest in LAST_STAGE if name == "USER"] == ["syncplan"]
    assert (steps["ENTRYPOINT"], steps["CMD"]) == ('["syncplan"]', '["serve"]')
    assert steps["VOLUME"] == "/var/lib/syncplan"
    assert "healthcheck.py" in steps["HEALTHCHECK"]


def test_variables_of_the_image_are_settings_and_none_is_a_secret() -> None:
    given = {one.removeprefix(PREFIX) for one in ENVIRONMENT if one.startswith(PREFIX)}
    assert given == {"DATA_DIR", "HOST", "PORT"}
    assert [one for one in ENVIRONMENT if one.startswith("OTEL_")] == ["OTEL_SERVICE_NAME"]
    assert {name.lower() for name in given} <= set(Settings.model_fields)


def test_the_parts_of_the_composition(services: Any) -> None:
    assert set(services) == {"database", "serve", "worker"}
    assert services["serve"]["command"] == ["serve", "--no-worker"]
    assert services["worker"]["command"] == ["worker"]
    assert services["worker"]["deploy"]["replicas"] == 2
    assert "ports" not in services["database"]
    assert "pg_isready" in services["database"]["healthcheck"]["test"]
    assert services["database"]["volumes"] == [
        "database:/var/lib/postgresql/data",
        "./docker/database.sql:/docker-entrypoint-initdb.d/database.sql:ro",
    ]
    for name in ("serve", "worker"):
        assert services[name]["depends_on"] == {"database": {"condition": "service_healthy"}}
        names = {key.removeprefix(PREFIX) for key in services[name]["environment"]}
        others = {"PGPASSWORD", "OTEL_EXPORTER_OTLP_ENDPOINT"}
        assert {one.lower() for one in names - others} <= set(Settings.model_fields)


def test_every_container_is_confined(services: Any) -> None:
    for name, one in services.items():
        assert one["cap_drop"] == ["ALL"], name
        assert "cap_add" not in one
        assert "privileged" not in one
        assert one["security_opt"] == ["no-new-privileges:true"]
        assert one["read_only"] is True
        assert "/tmp" in one["tmpfs"]
        assert one["mem_limit"]
        assert 0 < one["pids_limit"] <= 512
        options = one["logging"]["options"]
        assert (one["logging"]["driver"], set(options)) == ("json-file", {"max-size", "max-file"})
    assert services["database"]["user"] == "postgres"


def test_what_a_container_writes_to_is_no_part_of_its_image(services: Any) -> None:
    """The root of each file system can't be written to."""
    for name in ("serve", "worker"):
        written = {one.partition(":")[2] for one in services[name]["volumes"]}
        # where the kernels of the image are, and an anonymous volume for the data
        assert written == {ENVIRONMENT["NUMBA_CACHE_DIR"]}
    assert "/var/run/postgresql" in services["database"]["tmpfs"]
    compose = YAML(typ="safe").load(ROOT / "compose.yaml")
    named = {
        one.partition(":")[0]
        for service in services.values()
        for one in service["volumes"]
        if not one.startswith(".")
    }
    assert named == set(compose["volumes"])


def test_health_is_readiness_at_the_port_of_each(services: Any) -> None:
    for name, port in (("serve", []), ("worker", ["8001"])):
        check = services[name]["healthcheck"]
        program, *arguments = check["test"][2:]
        assert check["test"][:2] == ["CMD", "python"]
        assert arguments == port
        assert Path(program).name == "healthcheck.py"
        assert "disable" not in check
    assert services["worker"]["environment"]["SYNCPLAN_WORKER_PORT"] == "8001"


@pytest.mark.parametrize("status", [200, 503])
def test_the_health_check_asks_for_readiness(status: int) -> None:
    app = FastAPI()

    @app.get("/readyz")
    def ready() -> JSONResponse:
        return JSONResponse({"detail": "no heartbeat"}, status)

    with served(app) as port:
        for given, setting in (([str(port)], "1"), ([], str(port))):
            done = subprocess.run(
                [sys.executable, ROOT / "docker" / "healthcheck.py", *given],
                env={**os.environ, "SYNCPLAN_PORT": setting},
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == (status != 200)
            assert ("no heartbeat" in done.stderr) == (status != 200)


def test_no_secret_has_a_default_and_a_missing_one_is_reported(services: Any) -> None:
    secrets = [
        services["database"]["environment"]["POSTGRES_PASSWORD"],
        services["serve"]["environment"]["SYNCPLAN_API_KEYS"],
        services["serve"]["environment"]["PGPASSWORD"],
        services["worker"]["environment"]["PGPASSWORD"],
        services["worker"]["environment"]["SYNCPLAN_API_KEYS"],
    ]
    assert all(re.fullmatch(r"\$\{\w+:\?[^}]{10,}\}", one) for one in secrets)
    for name in ("serve", "worker"):
        assert services[name]["environment"]["SYNCPLAN_DATABASE_URL"] == (
            "postgresql://syncplan@database/syncplan"
        )
    # the only default that lets anybody in lets this machine in
    (port,) = services["serve"]["ports"]
    assert port == "${SYNCPLAN_PUBLISH:-127.0.0.1:8000}:8000"
