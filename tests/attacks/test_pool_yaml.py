"""YAML that once kept a process busy for 20 s is refused as soon as anything else."""

import time

import httpx2
import pytest

from tests.tools.api_servers import problem
from tests.tools.processes import memory_given_back
from tests.tools.scenarios import FILES
from tests.tools.serving import Server

NESTED = "a0: &a0 {x: 1}\n" + "".join(
    f"a{level}: &a{level}\n  <<: [{', '.join([f'*a{level - 1}'] * 8)}]\n" for level in range(1, 9)
)
ATTACKS = {
    "merges of merges": NESTED,
    "aliases without end": "a: &a [" + "*a," * 300_000,
    "lists without end": "a: " + "[" * 500_000,
}


@pytest.mark.long
def test_yaml_that_would_take_long_is_refused_at_once(server: Server, ann: httpx2.Client) -> None:
    kind = {"content-type": "application/yaml"}
    assert len(NESTED) < 469
    plan = (FILES / "paper-grid-same.yaml").read_bytes()
    assert ann.post("/v1/plans", content=plan, headers=kind).status_code == 201
    began = time.monotonic()
    for _ in range(5):
        assert ann.post("/v1/plans", content=plan, headers=kind).status_code == 201
    usual = time.monotonic() - began
    for name, text in ATTACKS.items():
        with memory_given_back(server.popen.pid):
            began = time.monotonic()
            refused = problem(ann.post("/v1/plans", content=text, headers=kind), 422)
            assert time.monotonic() - began < usual + 0.2, name
        assert "line" in refused.detail
