"""Files of the field over HTTP: as the library reads them, and nothing stored."""

import json
from pathlib import Path

import httpx2
import pytest

from syncplan.client.service_client import Client
from syncplan.errors import InputError
from syncplan.importing.imported_places import import_places
from tests.tools.api_servers import faults_of, key_of, problem
from tests.tools.serving import Server

FIELD = Path("tests/data/places/survey.kml")
BYTES = {"content-type": "application/octet-stream"}


def test_a_file_becomes_what_the_library_makes_of_it(server: Server) -> None:
    with Client(server.url, api_key=key_of("ann")) as client:
        places = client.import_places(FIELD, obstacle=("barn",), left_out=("mast",))
    expected = import_places(
        {FIELD.name: FIELD.read_bytes()}, obstacle=("barn",), left_out=("mast",)
    )
    assert places.as_json() == json.loads(json.dumps(expected.as_json()))
    assert len(places.scenario["obstacles_lat_lon_deg"]) == 1
    assert "landmarks_lat_lon_deg" not in places.scenario


def test_the_scenario_of_an_import_can_be_planned(ann: httpx2.Client) -> None:
    sent = ann.post("/v1/imports", content=FIELD.read_bytes(), headers=BYTES)
    assert sent.status_code == 200
    planned = ann.post("/v1/previews", json=sent.json()["scenario"], params={"quick": True})
    assert planned.status_code == 200
    assert planned.json()["plan"]["ground"]["places"].keys() >= {"area_lat_lon_deg"}


def test_what_cannot_be_read_is_refused_with_its_feature(
    ann: httpx2.Client, server: Server
) -> None:
    crossed = Path("tests/data/places/bad/crossed.kml")
    refused = ann.post(
        "/v1/imports", content=crossed.read_bytes(), headers=BYTES, params={"file": "x.kml"}
    )
    (entry,) = faults_of(refused)
    assert (entry.path, entry.message[:8]) == ("bow tie", "is not a")
    wrong = ann.post("/v1/imports", content=b"", headers={"content-type": "image/png"})
    assert "a file of the field" in problem(wrong, 415).detail
    with Client(server.url, api_key=key_of("ann")) as client:
        with pytest.raises(InputError, match="bow tie: is not a simple polygon"):
            client.import_places(crossed)
        with pytest.raises(InputError, match=r"^nowhere\.kml: no such file; check the path$"):
            client.import_places("nowhere.kml")
