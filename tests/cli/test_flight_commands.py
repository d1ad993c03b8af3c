"""syncplan fly and what-if: flights and losses at the command line."""

import json
from pathlib import Path
from typing import Any

from syncplan.cli.document_table import DOCUMENTS
from syncplan.flight.flying import fly
from syncplan.planning.pilot_flight import PILOT_SEED
from syncplan.planning.plan_records import MeetingsFlown
from syncplan.reports.flight_report import flight_document
from tests.tools.scenarios import FILES
from tests.tools.stories import shown

WINDY = str(FILES / "windy-grid.yaml")
QUICK = ("--trials", "2", "--duration", "40", "--threads", "1")


def test_a_flight_is_reported_as_the_library_reports_it(run: Any, tmp_path: Path) -> None:
    target = tmp_path / "flight.json"
    events = ("--lose", "v3@20", "--lose", "sensor:v1@5", "--hold", "v2@10:5")
    wrong = ("--dropout", "0.1", "--outliers", "0.05", "--mistaken", "0.01", "--late", "3")
    status, _, err = run(
        "fly", WINDY, *QUICK, "--seed", "4", "--wind", "1.5,0", *events, *wrong, "-o", str(target)
    )
    assert status == 0
    assert f"wrote {target}" in err
    flight = fly(
        WINDY,
        trials=2,
        duration=40.0,
        seed=4,
        wind=(1.5, 0.0),
        lose=("v3@20", "sensor:v1@5"),
        hold=("v2@10:5",),
        dropout=0.1,
        outliers=0.05,
        mistaken=0.01,
        late=3,
        threads=1,
    )
    own = tmp_path / "own.json"
    flight.save(own)
    assert own.read_bytes() == target.read_bytes()
    assert json.loads(target.read_text())["vehicles"][2]["errors"] is None


def test_a_terminal_shows_vehicles_what_happened_and_what_went_wrong(printed: Any) -> None:
    events = ("--lose", "v3@20", "--hold", "v2@10:5")
    wrong = ("--outliers", "0.1", "--late", "2", "--wind", "0.5,0")
    out = " ".join(printed("fly", WINDY, *QUICK, *events, *wrong, "--format", "table").split())
    for words in (
        "guidance track, filter robust",
        "filter lost in",
        "least separation: ",
        "wind known to",
        "v3 is lost at 20 s",
        "v2 is held from 10 s for 5 s; not seen in phase for a period after it",
        "less than a period, 31.4 s, is left",
        "in every trial 10 % of the bearings are false, sightings arrive 2 samples late, the wind "
        "is 0.5, 0 m/s",
        "gate at 0.9999: ",
        "sightings rejected",
    ):
        assert words in out


def test_links_are_distinguished_from_others_only_where_there_are_others() -> None:
    flown = flight_document(fly(FILES / "paper-grid-same.yaml", trials=1))

    def said(shares: list[float]) -> str:
        links = [
            MeetingsFlown(between=("v1", f"v{k + 2}"), meetings=4, kept_share=share)
            for k, share in enumerate(shares)
        ]
        text = shown(flown.model_copy(update={"links": links}), 200)
        return "".join(line for line in text.splitlines() if line.startswith("meetings kept"))

    assert said([1.0, 1.0]) == ""
    assert said([0.0] * 9).endswith("v1-v7 0 % and 3 more")
    assert said([0.0, 1.0, 0.5]) == "meetings kept: v1-v2 0 %, v1-v4 50 %; of all others all"


def test_a_plan_file_is_flown_as_it_is(printed: Any, plan_file: Path) -> None:
    assert json.loads(printed("fly", str(plan_file), *QUICK))["name"] == "paper-grid-same"


def test_a_plan_that_was_flown_says_what_was_found_in_a_line(run: Any) -> None:
    quick = str(FILES / "five-ring.yaml")
    status, out, _ = run("plan", quick, "--fly", "1", "--format", "table")
    assert (status, out.splitlines()[0]) == (0, "GO in 1 simulated flight")
    flown = fly(quick, trials=1, threads=1, filter="ekf", seed=PILOT_SEED).record
    worst = max(flown.vehicles, key=lambda one: one.phase_rms_s)
    assert flown.least_separation_m is not None
    words = " ".join(out.split())
    for found in (
        "flown, 1 flight of 200 s: guidance track, ",
        f"phase at most {worst.phase_rms_s:.3g} s off (RMS, {worst.name})",
        "each pair keeps at least 100 % of its meetings",
        f"least separation {flown.least_separation_m[1]:.3g} m",
        "filter ekf lost in 0 %",
    ):
        assert found in words
    _, out, _ = run("plan", quick, "--paper", "--format", "table")
    assert out.splitlines()[0] == "GO on paper: not flown"
    assert "flown, " not in out


def test_a_team_that_drifts_away_is_stopped_by_its_phases_and_by_its_meetings(run: Any) -> None:
    target = (WINDY, "--guidance", "none", "--trials", "3", "--threads", "1", "--require-go")
    status, out, _ = run("fly", *target, "--format", "json")
    assert status == 3
    levels = {one["code"]: one["level"] for one in json.loads(out)["verdict"]["findings"]}
    assert levels["phase-not-kept"] == levels["meetings-missed"] == "stop"


# --- losses ---------------------------------------------------------------------------------------


GRID = str(FILES / "paper-grid-same.yaml")
UNBOUNDED = ("--bound", "never")


def test_every_single_loss_is_judged_and_the_most_harmful_come_first(run: Any) -> None:
    status, out, err = run("what-if", GRID, *UNBOUNDED)
    assert (status, err) == (0, "")
    document = json.loads(out)
    assert len(document["losses"]) == 14
    first, last = document["losses"][0], document["losses"][-1]
    assert (first["observable"], last["observable"]) == (False, True)
    assert first["verdict"]["go"] is False
    assert first["unobservable"]
    assert run("what-if", GRID, "--losses", "3")[0] == 2


def test_a_plan_file_keeps_its_orbits(
    run: Any, refused: Any, plan_file: Path, tmp_path: Path
) -> None:
    losses = tmp_path / "losses.json"
    document = json.loads(plan_file.read_text())
    for vehicle in document["vehicles"]:
        vehicle.pop("position_m"), vehicle.pop("heading_rad")
        vehicle["phase_rad"] = 0.0
    plan_file.write_text(json.dumps(document))
    assert run("what-if", str(plan_file), "-o", str(losses), *UNBOUNDED)[0] == 0
    found = json.loads(losses.read_text())
    assert found["baseline"]["observable"] is False
    assert found["critical"] == []
    assert "losses.json" in refused("what-if", str(losses))


def test_losses_of_two_are_judged_on_request(printed: Any, written: Any) -> None:
    document = json.loads(printed("what-if", written(), "--losses", "2", *UNBOUNDED))
    assert len(document["losses"]) == 4 + 3
    assert ["sensor:v1", "sensor:v2"] in [one["lost"] for one in document["losses"]]


def test_what_is_named_is_lost_together(printed: Any) -> None:
    document = json.loads(printed("what-if", GRID, "--lose", "v1, v5", *UNBOUNDED))
    assert [one["lost"] for one in document["losses"]] == document["critical"] == [["v1", "v5"]]
    out = printed("what-if", GRID, "--lose", "sensor:v3", "--format", "table", *UNBOUNDED)
    assert "1 critical of 1: the sensor of v3" in out
    assert "turn of everything" in out
    assert "was not asked for" in out


def test_losses_are_drawn_and_have_a_schema(run: Any, tmp_path: Path) -> None:
    losses, page = tmp_path / "losses.json", tmp_path / "losses.html"
    assert run("what-if", GRID, "-o", str(losses))[0] == 0
    assert run("plot", str(losses), "-o", str(page))[0] == 0
    assert "predicted error after each loss" in page.read_text()
    schema = json.loads(run("schema", "what-if")[1])
    assert set(schema["properties"]) == set(json.loads(losses.read_text()))
    assert DOCUMENTS["what-if"].model.model_validate_json(losses.read_text())
