"""Record the worked examples of the OpenAPI document from the real service.

    python -m tests.tools.record_examples

Writes api/examples/<operation>.json: requests, and the answers they got, those of the smallest team
that shows everything. Problems are recorded where the general example of their status says too
little; figures keep the first numbers of each list. Run it when an answer has changed, and look at
the difference.
"""

import json
import re
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import httpx2

from api.job_kinds.job_table import JOB_KINDS
from syncplan.planning.plan_files import StatedOrbit
from syncplan.studies.job_contract import has_ended
from tests.tools.briefs import FIELD
from tests.tools.recordings import zipped
from tests.tools.serving import ROOT, Server, running

__all__ = ["FOLDER", "KEY", "SCENARIO", "main"]

FOLDER = ROOT / "api" / "examples"
KEY = "example-key-0123456789"
REQUEST_ID = "5b1f0c52a7c14f7e9d4b8a1a6f0b6f0e"
LINES = 3
"""What is kept of a text."""
TRACES, NUMBERS, ASPECTS = 2, 3, 3
"""What is kept of a figure: traces, numbers of each list, aspects of the layout."""

_SCALARS = re.compile(r"\[\n\s+([^\[\]{}]*?)\n\s+\]")

BINARY = ("application/octet-stream", "application/zip")

SCENARIO: dict[str, Any] = {
    "name": "survey",
    "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "direction": "ccw"},
    "formation": {"shape": "line", "count": 2, "spacing_m": 70.0},
    "landmarks_m": [[0.0, 40.0], [70.0, -40.0]],
    "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.2},
    "duration_s": 60.0,
}

RECORDED = {
    "odometry.csv": "robot,time_s,speed_mps,turn_rate_rad_s\nrover,0,0.8,0.1\nrover,60,0.8,0.1\n",
    "sightings.csv": "robot,time_s,target,bearing_rad,range_m\nrover,0.5,pole,0.25,8\n",
    "landmarks.csv": "name,x_m,y_m\npole,8,2\n",
    "truth.csv": "robot,time_s,x_m,y_m,heading_rad\nrover,0,0,0,0\nrover,60,-2.2,16,6\n",
}

Tree = dict[str, Any]


class _Recorder:
    """A client that keeps what it sends and gets, by operation."""

    def __init__(self, url: str) -> None:
        headers = {"authorization": f"Bearer {KEY}", "x-request-id": REQUEST_ID}
        self.client = httpx2.Client(base_url=url, headers=headers, timeout=60.0)
        self.kept: dict[str, Tree] = defaultdict(lambda: {"request": {}, "responses": {}})

    def request(self, operation: str, name: str, summary: str, value: Tree) -> Tree:
        self.kept[operation]["request"][name] = {"summary": summary, "value": value}
        return value

    def ask(
        self, operation: str, name: str, summary: str, method: str, path: str, **options: Any
    ) -> Any:
        """Send a request and keep its answer as an example."""
        response = self.client.request(method, path, **options)
        medium = response.headers.get("content-type", "")
        value: Any = response.json() if "json" in medium else response.text
        if medium.startswith("text/event-stream"):
            value = _last_event(value)
        if operation in ("readMetrics", "printPlan"):
            value = "".join(value.splitlines(keepends=True)[:LINES])
        if operation.endswith("Schema"):
            # the document has them in full
            value = {k: v for k, v in value.items() if k not in ("$defs", "properties")}
        if "Figure" in operation and "data" in value:
            value = _shortened(value)
        if operation == "readPlanCovariances":
            each = {name: one[:NUMBERS] for name, one in value["vehicles"].items()}
            value = {"time_s": value["time_s"][:NUMBERS], "vehicles": each}
        if operation == "previewScenario" and "figures" in value:
            figures = {name: _shortened(one) for name, one in value["figures"].items()}
            value = {**value, "figures": figures}
        if operation == "listStudies":
            value = {"studies": [_first_of(study) for study in value["studies"]]}
        kept = self.kept[operation]["responses"].setdefault(str(response.status_code), {})
        if response.content and medium not in BINARY:
            kept[name] = {"summary": summary, "value": value}
        return value

    def job(self, operation: str, name: str, summary: str, path: str, body: Tree) -> str:
        """Hand in a job, wait for its end and return its path."""
        job = self.ask(operation, name, summary, "POST", path, json=body)
        found = f"/v1/jobs/{job['id']}"
        while not has_ended(self.client.get(found).json()["state"]):
            time.sleep(0.1)
        return found

    def write(self) -> None:
        FOLDER.mkdir(exist_ok=True)
        for operation, kept in sorted(self.kept.items()):
            kept["responses"] = {k: v for k, v in sorted(kept["responses"].items()) if v}
            text = json.dumps({k: v for k, v in kept.items() if v}, indent=1)
            # numbers side by side
            text = _SCALARS.sub(lambda found: f"[{' '.join(found[1].split())}]", text)
            (FOLDER / f"{operation}.json").write_text(text + "\n", encoding="utf-8")


def _shortened(figure: Tree) -> Tree:
    """A figure with the first of its traces, and of their numbers."""
    traces = [
        {key: one[:NUMBERS] if isinstance(one, list) else one for key, one in trace.items()}
        for trace in figure["data"][:TRACES]
    ]
    return {**figure, "data": traces, "layout": dict(list(figure["layout"].items())[:ASPECTS])}


def _first_of(study: Tree) -> Tree:
    """A study with the first of its options, fields and figures."""
    return {key: each[:1] if isinstance(each, list) else each for key, each in study.items()}


def _last_event(stream: str) -> Tree:
    """The last event of a stream, as its schema describes one."""
    lines = stream.strip().split("\n\n")[-1].splitlines()
    return {name: value for name, _, value in (line.partition(": ") for line in lines)}


def main() -> None:
    """Run a service, ask it everything once, and write the examples."""
    with tempfile.TemporaryDirectory() as folder:
        server = Server(
            Path(folder) / "log", SYNCPLAN_DATA_DIR=folder, SYNCPLAN_API_KEYS=f"planner:{KEY}"
        )
        with running(server):
            recorder = _Recorder(server.url)
            plan, recording = _plans(recorder), _recordings(recorder)
            _jobs(recorder, plan, recording)
            _refused(recorder, f"/v1/plans/{plan}", f"/v1/recordings/{recording}")
            _others(recorder)
            recorder.write()


def _plans(recorder: _Recorder) -> str:
    scenario = recorder.request(
        "createPlan", "survey", "Two vehicles in a line, two landmarks", SCENARIO
    )
    plan = recorder.ask("createPlan", "survey", "The plan", "POST", "/v1/plans", json=scenario)
    wrong = {**SCENARIO, "sensor": {**SCENARIO["sensor"], "range_m": -5}, "radius": 3}
    recorder.ask("createPlan", "faults", "Faults of a scenario", "POST", "/v1/plans", json=wrong)
    given = {"scenario": SCENARIO, "vehicles": [_stated(one) for one in plan["vehicles"]]}
    recorder.request("createPlan", "given", "A plan: its own orbits are judged", given)
    recorder.request("previewScenario", "survey", "The same two vehicles", SCENARIO)
    previews = "/v1/previews?figure=prediction"
    recorder.ask(
        "previewScenario", "survey", "The plan and a figure", "POST", previews, json=SCENARIO
    )
    mast = {
        "content": "name,lat,lon\nmast,47.3977,8.5456\n",
        "headers": {"content-type": "text/csv"},
    }
    imports = "/v1/imports?file=marks.csv"
    recorder.ask("importPlaces", "marks", "A survey mark", "POST", imports, **mast)
    path = f"/v1/plans/{plan['id']}"
    recorder.ask("readPlanFigure", "prediction", "A figure", "GET", f"{path}/figures/prediction")
    recorder.ask("readPlanFigure", "parent", "Not refined", "GET", f"{path}/figures/comparison")
    covariances = f"{path}/covariances"
    recorder.ask("readPlanCovariances", "survey", "Over a period", "GET", covariances)
    recorder.ask("printPlan", "survey", "Its first lines", "GET", f"{path}/report")
    losses = f"{path}/what-if"
    recorder.ask("judgeLosses", "landmark", "A lost landmark", "GET", f"{losses}?lose=L1")
    recorder.ask("judgeLosses", "unknown", "No such name", "GET", f"{losses}?lose=v9")
    choice = f"{path}/landmark-choice"
    recorder.ask(
        "chooseLandmarks", "one", "The best landmark", "GET", f"{choice}?candidate=L1&choose=1"
    )
    recorder.ask(
        "chooseLandmarks", "unknown", "No such name", "GET", f"{choice}?candidate=L9&choose=1"
    )
    recorder.ask("exportPlan", "origin", "No geo_origin", "GET", f"{path}/exports/qgc")
    # the same bytes as when it was made
    recorder.kept["readPlan"]["responses"]["200"] = {"survey": {"same": ["createPlan", "201"]}}
    recorder.ask("listPlans", "page", "The only page", "GET", "/v1/plans")
    renaming = recorder.request("renamePlan", "bay", "Another name", {"name": "survey of the bay"})
    recorder.ask("renamePlan", "bay", "The plan", "PATCH", path, json=renaming)
    recorder.client.patch(path, json={"name": SCENARIO["name"]})
    return str(plan["id"])


def _recordings(recorder: _Recorder) -> str:
    content = zipped({f"hall/{name}": text.encode() for name, text in RECORDED.items()})
    headers = {"content-type": "application/zip"}
    sent: Tree = {"content": content, "headers": headers}
    path = "/v1/recordings"
    kept = recorder.ask("createRecording", "hall", "In short", "POST", path, **sent)
    wrong = {**RECORDED, "odometry.csv": RECORDED["odometry.csv"].replace("0.8", "fast")}
    sent["content"] = zipped({f"hall/{name}": text.encode() for name, text in wrong.items()})
    recorder.ask("createRecording", "fault", "A fault of a file", "POST", path, **sent)
    recorder.ask("listRecordings", "page", "The only page", "GET", path)
    one = f"{path}/{kept['id']}"
    recorder.kept["readRecording"]["responses"]["200"] = {
        "hall": {"same": ["createRecording", "201"]}
    }
    renaming = recorder.request("renameRecording", "yard", "Another name", {"name": "yard"})
    recorder.ask("renameRecording", "yard", "In short", "PATCH", one, json=renaming)
    recorder.client.patch(one, json={"name": kept["name"]})
    return str(kept["id"])


def _stated(vehicle: Tree) -> Tree:
    """What is read of a vehicle of a plan."""
    return {key: vehicle[key] for key in StatedOrbit.model_fields}


ASKED: dict[str, tuple[str, Tree]] = {
    "refinement": (
        "Let the centres move by three metres",
        {"vary": ["phases", "centers"], "center_box_m": 3.0, "starts": 2, "time_limit_s": 30.0},
    ),
    "validation": ("Two hundred trials of a minute", {"trials": 200, "seed": 1}),
    "flight": (
        "A hundred flights in wind, without v2 after half a minute",
        {"trials": 100, "seed": 1, "wind_mps": [0.5, 0.0], "lose": ["v2@30"]},
    ),
    "sweep": (
        "Two angular rates",
        {"scenario": SCENARIO, "angular_rate_rad_s": [0.2, 0.4], "trials": 50},
    ),
    "replay": ("Bearings alone", {"distances": False, "sample_time_s": 0.5}),
    # the result of a team that there is holds its plan, validation and flight
    "design": ("A field that no team of this brief covers", {**FIELD, "landmarks": {"max": 1}}),
}
"""Requests for studies that are recorded, with their summaries; by default without any option."""


def _jobs(recorder: _Recorder, plan: str, recording: str) -> None:
    for name, kind in JOB_KINDS.items():
        operation, (summary, body) = kind.operation, ASKED.get(name, ("Defaults", {}))
        path = f"/v1{kind.study.path.format(plan_id=plan, recording_id=recording)}"
        asked = recorder.request(operation, "asked", summary, body)
        job = recorder.job(operation, "queued", "Queued", path, asked)
        recorder.ask("readJobResult", name, f"A {name}", "GET", f"{job}/result")
        if name == "validation":
            recorder.ask("readJob", name, "A validation that has ended", "GET", job)
            recorder.ask("followJob", name, "The last event", "GET", f"{job}/events")
            figures = f"{job}/figures"
            recorder.ask("readJobFigure", "accuracy", "A figure", "GET", f"{figures}/accuracy")
            recorder.ask("readJobFigure", "errors", "No series", "GET", f"{figures}/errors")
        if name == "refinement":
            recorder.ask("readJobTrials", name, "Not a validation", "GET", f"{job}/trials")
            recorder.ask("readJobFigure", name, "Not a report", "GET", f"{job}/figures/accuracy")
    long = recorder.client.post("/v1/designs", json={**FIELD, "effort": "thorough"}).json()["id"]
    recorder.ask("finishJob", "asked", "Asked to end", "POST", f"/v1/jobs/{long}/finish")


def _refused(recorder: _Recorder, plan: str, recording: str) -> None:
    """A job that is cancelled, and requests with faults."""
    long = recorder.client.post(f"{plan}/validations", json={"trials": 100_000}).json()["id"]
    job = f"/v1/jobs/{long}"
    recorder.ask("readJobResult", "running", "Not ended yet", "GET", f"{job}/result")
    recorder.ask("deleteJob", "running", "Not ended yet", "DELETE", job)
    recorder.ask("cancelJob", "cancelled", "Cancelled", "POST", f"{job}/cancel")
    for operation, path, body in (
        ("refinePlan", f"{plan}/refinements", {"vary": []}),
        ("validatePlan", f"{plan}/validations", {"trials": 0}),
        ("flyPlan", f"{plan}/flights", {"lose": ["v9@30"]}),
        ("sweepScenario", "/v1/sweeps", {"scenario": SCENARIO}),
        ("replayRecording", f"{recording}/replays", {"landmarks": ["gate"]}),
        ("designTeam", "/v1/designs", {**FIELD, "need": {}}),
    ):
        recorder.ask(operation, "faults", "Faults of a request", "POST", path, json=body)
    recorder.ask("listJobs", "page", "The first page", "GET", "/v1/jobs?limit=1")


def _others(recorder: _Recorder) -> None:
    recorder.ask("listStudies", "all", "All studies", "GET", "/v1/studies")
    recorder.ask("readUsage", "some", "Some of each", "GET", "/v1/usage")
    recorder.ask("readScenarioSchema", "schema", "The schema", "GET", "/v1/schemas/scenario")
    recorder.ask("readPlanSchema", "schema", "The schema", "GET", "/v1/schemas/plan")
    recorder.ask("checkHealth", "alive", "It is", "GET", "/healthz")
    recorder.ask("checkReadiness", "ready", "It is", "GET", "/readyz")
    recorder.ask("readMetrics", "some", "Some of them", "GET", "/metrics")


if __name__ == "__main__":
    main()
