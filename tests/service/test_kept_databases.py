"""Databases that earlier versions have left: all that was there is served, what waited is done."""

from pathlib import Path

import pytest

from tests.tools.kept_databases import answers_of, restore_postgresql, restore_sqlite
from tests.tools.record_database import ASKED, ENDED, HALF_DONE, IDEMPOTENCY, QUEUED, states_of
from tests.tools.survival import quick, refinement, sweep_of_ranges, validation

SETTINGS = {
    # what has ended was kept long ago
    "SYNCPLAN_KEEP_JOBS_S": "1e9",
    "SYNCPLAN_KEEP_ANSWERS_S": "1e9",
    # jobs of a version that nobody runs any more need not wait for it
    "SYNCPLAN_VERSION_GRACE_S": "0.5",
}


@pytest.mark.long
@pytest.mark.parametrize(
    ("address", "folder"),
    [("sqlite", "version-1"), ("postgresql", "version-1"), ("sqlite", "before-flights")],
    indirect=["address"],
)
def test_what_was_kept_is_served_as_it_was_and_what_waited_is_done(
    address: str | None, folder: str, tmp_path: Path
) -> None:
    said = answers_of(folder, "sqlite" if address is None else "postgresql")
    if address is None:
        restore_sqlite(folder, tmp_path / "data" / "syncplan.db")
    else:
        restore_postgresql(folder, address)
    with quick(tmp_path, address, **SETTINGS) as site:
        states = states_of(site.database)
        assert {state for state, _ in states.values()} == {"queued", "running", *ENDED}
        assert states[said["half_done"]][1] > 0
        site.serve("--no-worker")
        for path, answer in said["answers"].items():
            assert site.ask("GET", path, headers=ASKED).text == answer, path
        for row in site.ask("GET", "/v1/plans").json()["items"]:
            plan = site.ask("GET", f"/v1/plans/{row['id']}").json()
            assert row["go"] is plan["verdict"]["go"]
        repeated = said["repeated"]
        again = site.ask("POST", repeated["path"], json=repeated["body"], headers=IDEMPOTENCY)
        assert (again.status_code, again.text) == (202, repeated["answer"])
        assert site.count("plans") == len(said["plans"]) + 1
        site.work()
        # version 1 has named the filter in each job, in its own words
        named = "arc" if folder == "version-1" else None
        orders = [
            validation(**QUEUED, model=named, flown=False),
            refinement(0),
            sweep_of_ranges(20, 3),
        ]
        site.jobs = dict(zip(said["queued"], orders, strict=True))
        site.jobs[said["half_done"]] = validation(**HALF_DONE, model=named, flown=False)
        site.see_results()
        site.see_nothing_left()
