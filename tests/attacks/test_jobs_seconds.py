"""What one owner may have computed in a day has an end."""

from pathlib import Path

from tests.tools.api_servers import done, problem, serving, speaking
from tests.tools.scenarios import document


def test_an_owner_whose_seconds_are_spent_is_refused_and_others_are_not(tmp_path: Path) -> None:
    with (
        serving(tmp_path, "ann bob", SYNCPLAN_MAX_JOB_SECONDS="0.001") as server,
        speaking(server, "ann") as ann,
        speaking(server, "bob") as bob,
    ):
        plans = {one: one.post("/v1/plans", json=document()).json()["id"] for one in (ann, bob)}
        path = f"/v1/plans/{plans[ann]}/validations"
        first = ann.post(path, json={"trials": 40})
        assert first.status_code == 202
        done(ann, first.headers["location"])
        refused = ann.post(path, json={"trials": 10})
        problem(refused, 429)
        assert "the most allowed is 0.001 s" in refused.json()["detail"]
        assert int(refused.headers["retry-after"]) > 0
        taken = bob.post(f"/v1/plans/{plans[bob]}/validations", json={"trials": 10})
        assert taken.status_code == 202
