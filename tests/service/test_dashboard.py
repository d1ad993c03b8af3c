"""What is said of the metrics: dashboard and alerts query what servers and workers expose."""

import contextlib
import json
import re
from collections.abc import Iterator
from functools import partial
from typing import Any

import httpx2
import pytest
from sqlalchemy import update

from api.jobs.queue import JobQueue
from api.metrics import METRICS, MetricEntry
from api.readings import job_readings
from api.storage import executors
from api.storage.database import Database
from api.storage.job_records import NewJob, add_job
from api.storage.tables import earlier, jobs
from tests.tools.processes import PATIENCE_S
from tests.tools.serving import ROOT

DASHBOARD: dict[str, Any] = json.loads((ROOT / "docker" / "grafana" / "syncplan.json").read_text())
ALERTS = (ROOT / "docs" / "how-to" / "watch-the-service.md").read_text()

OF_ALL_METRICS = {"job", "instance", "le"}
"""Labels that Prometheus adds, and those of a histogram's buckets."""


def queries() -> Iterator[str]:
    """Every expression of the dashboard and of the table of alerts."""
    for panel in DASHBOARD["panels"]:
        for target in panel.get("targets", ()):
            yield target["expr"]
    rows = ALERTS.partition("## Alerts")[2].partition("## Logs")[0]
    yield from re.findall(r"^\| [^|]+ \| `(.+?)` \|", rows, re.MULTILINE)


def names_in(query: str) -> set[str]:
    """The metrics of an expression."""
    return set(re.findall(r"\b(?:syncplan|process)_\w+", query))


def entry_of(name: str) -> MetricEntry:
    """The entry of a name that a query uses; a KeyError if there is none."""
    for entry in METRICS.values():
        if name == entry.exposed or (
            entry.type == "histogram" and re.fullmatch(rf"{entry.name}_(bucket|sum|count)", name)
        ):
            return entry
    raise KeyError(name)


def test_the_dashboard_can_be_imported() -> None:
    assert DASHBOARD["schemaVersion"] >= 36
    assert re.fullmatch(r"[a-z-]{1,40}", DASHBOARD["uid"])
    assert "id" not in DASHBOARD
    sources = [one for one in DASHBOARD["templating"]["list"] if one["type"] == "datasource"]
    assert [(one["name"], one["query"]) for one in sources] == [("datasource", "prometheus")]
    numbers = [panel["id"] for panel in DASHBOARD["panels"]]
    assert len(set(numbers)) == len(numbers)
    for panel in DASHBOARD["panels"]:
        place = panel["gridPos"]
        assert 0 <= place["x"] <= place["x"] + place["w"] <= 24
        if panel["type"] != "row":
            assert panel["targets"]
            assert panel["title"]
            assert panel["description"]
            for one in (panel, *panel["targets"]):
                assert one["datasource"] == {"type": "prometheus", "uid": "${datasource}"}


@pytest.mark.parametrize("query", list(queries()))
def test_a_query_names_metrics_and_labels_that_there_are_and_sums_no_figure_of_the_service(
    query: str,
) -> None:
    assert query.count("(") == query.count(")")
    assert query.count("{") == query.count("}")
    labels = set(OF_ALL_METRICS)
    for name in names_in(query):
        if name.startswith("syncplan_"):
            entry = entry_of(name)
            labels |= set(entry.labels)
            # each process reads these from the database; `sum` would count them once for each
            if entry.of == "service":
                assert not re.search(rf"\bsum\b[^(]*(by \([^)]*\) )?\({name}", query)
    used = {
        label.strip()
        for found in re.findall(r"\bby \(([^)]*)\)", query)
        for label in found.split(",")
    }
    used |= set(re.findall(r"(\w+)\s*(?:=~|!=|!~|=)\s*\"", query))
    assert used <= labels, query


@pytest.mark.long
def test_a_running_server_exposes_all_of_it(ann: httpx2.Client) -> None:
    text = ann.get("/metrics").text
    types = dict(re.findall(r"^# TYPE (\S+) (\S+)$", text, re.MULTILINE))
    for entry in METRICS.values():
        exposed = entry.exposed if entry.type == "counter" else entry.name
        assert types.get(exposed) == entry.type, entry.name
    every = {name for query in queries() for name in names_in(query)}
    assert len(every) > 15
    for name in every:
        assert re.sub(r"_(bucket|sum|count)$", "", name) in types or name in types, name


def test_what_waits_is_counted_with_its_age(database: Database) -> None:
    with contextlib.closing(JobQueue(str(database.engine.url))) as queue:
        readings = partial(job_readings, database, queue)
        assert readings()["syncplan_jobs_oldest_queued_seconds"] == {(): 0.0}
        assert readings()["syncplan_parts_oldest_queued_seconds"] == {(): 0.0}
        with database.writing() as connection:
            executors.beat(connection, "one", "1+2")
            for kind in ("sweep", "validation"):
                row = add_job(connection, "ann", NewJob(kind, "{}", 1, None, None))
                queue.add_job(connection, row.id, "ann")
                # an hour ago, by its row and as a worker finds it
                change = update(jobs).where(jobs.c.id == row.id)
                connection.execute(change.values(created_at=earlier(row.created_at, 3600.0)))
        found = readings()
    assert found["syncplan_jobs"]["queued",] == 2
    assert found["syncplan_jobs"]["running",] == 0
    assert found["syncplan_jobs_unfinished"]["sweep", "queued"] == 1
    assert found["syncplan_jobs_unfinished"]["refinement", "queued"] == 0
    assert 3600.0 <= found["syncplan_jobs_oldest_queued_seconds"][()] < 3600.0 + PATIENCE_S
    assert 0.0 < found["syncplan_parts_oldest_queued_seconds"][()] < PATIENCE_S
    assert found["syncplan_workers"] == {("1+2",): 1}
    assert 0.0 <= found["syncplan_heartbeat_age_seconds"]["one",] < PATIENCE_S
