"""Designs: winners hold their brief, whatever the number of processes; the rest says why not."""

import os
import signal
from collections.abc import Iterator
from dataclasses import replace

import pytest

from syncplan.designs import designer, judgement, ladder
from syncplan.designs.candidates import Cell, Space
from syncplan.designs.designer import Design, design
from syncplan.designs.ladder import DesignState
from syncplan.designs.purchases import offers_for
from syncplan.errors import InputError
from syncplan.planning.plan_files import loaded_from, plan_of
from syncplan.refinement import exact_search
from syncplan.reports.design_report import design_document
from syncplan.runtime.files import as_text
from syncplan.runtime.task_crew import EarlierSearch
from syncplan.scenario.brief import Brief
from tests.tools.briefs import brief, broken


@pytest.fixture(scope="module", autouse=True)
def _short() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ladder, "EVALUATIONS", {"quick": 120})
        patch.setattr(judgement, "TRIALS", 10)
        patch.setattr(exact_search, "_MOST_LOOKS", 10)
        patch.setattr(designer, "offers_for", lambda *given: offers_for(*given)[:2])
        yield


Kept = dict[int, bytes]
Searched = tuple[Design, list[DesignState], Kept]


def _searched(given: Brief, workers: int, known: Kept) -> Searched:
    """A design, the states that it reported, and the searches that it kept."""
    states, kept = list[DesignState](), Kept()
    earlier = EarlierSearch(known, keep=kept.__setitem__)
    return design(given, workers=workers, progress=states.append, earlier=earlier), states, kept


@pytest.fixture(scope="module")
def met() -> Searched:
    return _searched(brief(), 1, {})


def test_a_winner_holds_its_brief(met: Searched) -> None:
    found, seen, _ = met
    # two cells, searched alone five and three times, and then on from the best
    states = [(state.doing, state.done, state.total, len(state.front)) for state in seen]
    cells = (0, *[1] * 5, *[2] * 5)
    assert states[:11] == [("searching teams", done, 10, many) for done, many in enumerate(cells)]
    doings = [state.doing.partition(" ")[0] for state in seen[11:]]
    assert doings[-3:] == ["refining", "flying", "validating"]
    assert (found.status, found.binding, found.purchases) == ("met", "", ())
    best = found.best
    assert best is not None
    assert broken(found.brief, best.plan) == []
    assert best.plan.verdict.go
    assert best.worst <= 2.0 * 0.95
    assert best.validation is not None
    assert best.flight is not None
    assert best.plan.flight == best.flight.record
    assert best.validation.filter == best.flight.record.filter
    for run in (best.validation, best.flight):
        assert run.accuracy.late_position.max() <= 2.0
    # no cheaper cell nearly met the need and was passed over
    costs = {team.cell: team.cell.cost(found.brief.prefer) for team in found.front}
    cheaper = [team for team in found.front if costs[team.cell] < costs[best.start.cell]]
    assert all(team.value > designer.NEARLY * 1.9 for team in cheaper)


def test_a_winner_that_its_validation_stops_does_not_meet_the_brief(
    met: Searched, monkeypatch: pytest.MonkeyPatch
) -> None:
    best = met[0].best
    assert best is not None
    assert best.validation is not None
    for anees, binding in ((1.0, ""), (3.0, "error-above-prediction")):
        figure = replace(best.validation.anees, value=anees, band=(0.9 * anees, 1.1 * anees))
        unflown = replace(best.plan, flight=None)
        validation = replace(best.validation, plan=unflown, anees=figure)
        monkeypatch.setattr(judgement, "refined", lambda *_, plan=unflown: plan)
        monkeypatch.setattr(judgement, "pilot_flight", lambda *_: best.flight)
        monkeypatch.setattr(judgement, "validate", lambda *_, result=validation, **__: result)
        again = judgement.judged(met[0].brief, best.start, lambda: False, lambda _: None)
        assert again.binding == binding


def test_a_winner_that_cannot_be_flown_does_not_meet_the_brief(
    met: Searched, monkeypatch: pytest.MonkeyPatch
) -> None:
    best = met[0].best
    assert best is not None
    monkeypatch.setattr(judgement, "refined", lambda *_: replace(best.plan, flight=None))
    reason = "no filter can fly"
    monkeypatch.setattr(judgement, "pilot_flight", lambda *_: reason)
    again = judgement.judged(met[0].brief, best.start, lambda: False, lambda _: None)
    assert (again.binding, again.flight, again.plan.unflown) == (
        "flight",
        None,
        "no filter can fly",
    )


def test_a_loss_that_leaves_the_team_unobservable_decides_however_small_its_errors(
    met: Searched, monkeypatch: pytest.MonkeyPatch
) -> None:
    best = met[0].best
    assert best is not None
    monkeypatch.setattr(judgement, "refined", lambda *_: replace(best.plan, flight=None))
    # about the landmark that is left, the team turns little in ten periods
    given = brief(need={"worst_rms_m": 1e3, "losses": 1})
    again = judgement.judged(given, best.start, lambda: False, lambda _: None)
    assert (again.binding, again.flight) == ("losses", None)


def test_kept_searches_are_not_repeated_and_give_the_same_design_on_two_processes(
    met: Searched,
) -> None:
    whole, _, kept = met
    assert sorted(kept) == list(range(10))
    resumed, _, made = _searched(brief(), 2, {k: kept[k] for k in range(5)})
    texts = [as_text(design_document(found).as_json()) for found in (whole, resumed)]
    assert texts[0] == texts[1]
    assert made == {k: kept[k] for k in range(5, 10)}


@pytest.mark.parametrize("moment", ["searching", "refining", "flying"])
def test_ctrl_c_ends_a_design_with_the_best_so_far(moment: str, met: Searched) -> None:
    told: list[str] = []
    _, _, kept = met

    def progress(state: DesignState) -> None:
        if told or state.doing.startswith(moment):
            told.append(state.doing)
        if len(told) == 1:
            os.kill(os.getpid(), signal.SIGINT)

    earlier = EarlierSearch({k: kept[k] for k in range(5)})
    found = design(brief(), workers=1, progress=progress, earlier=earlier)
    assert (found.status, found.binding, found.cut_short) == ("not_found", "time", True)
    assert found.best is not None
    assert found.best.plan.verdict.go
    # nothing further was begun
    assert len(told) == 1


def test_a_time_limit_ends_the_searches_and_the_best_is_judged(
    met: Searched, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ladder, "EVALUATIONS", {"quick": 10**6})
    designed = design(brief(time_limit_s=2.0), workers=2)
    assert designed.cut_short
    assert [finding.code for finding in design_document(designed).findings] == ["search-cut-short"]
    assert designed.best is not None
    assert designed.best.flight is not None
    # what was kept is not searched again, though no time is left
    monkeypatch.setattr(ladder, "EVALUATIONS", {"quick": 120})
    earlier = EarlierSearch(met[2], spent_s=10.0)
    resumed = design(brief(time_limit_s=2.0), workers=1, earlier=earlier)
    assert not resumed.cut_short
    assert (resumed.status, resumed.evaluations) == (met[0].status, met[0].evaluations)


def test_results_that_an_earlier_version_kept_are_searched_anew(met: Searched) -> None:
    _, _, kept = met
    older = {
        0: b"[[0.5, 0.5], 0.1, 7]",
        5: b"[1, 2",
        1: kept[1],
        **{k: kept[k] for k in (2, 3, 4, 6, 7, 8)},
    }
    designed, _, made = _searched(brief(), 1, older)
    assert sorted(made) == [0, 5, 9]
    assert made[0] == kept[0]
    assert designed.evaluations == met[0].evaluations


def test_a_formation_is_judged_where_its_refinement_fails_in_flight(
    met: Searched, monkeypatch: pytest.MonkeyPatch
) -> None:
    best = met[0].best
    assert best is not None
    refined = judgement.refined(Space(met[0].brief, best.start.cell), best.plan)
    monkeypatch.setattr(judgement, "refined", lambda *_: replace(refined, flight=None))
    flights = iter(["no filter can fly", best.flight])
    monkeypatch.setattr(judgement, "pilot_flight", lambda *_: next(flights))
    monkeypatch.setattr(judgement, "validate", lambda *_, **__: best.validation)
    again = judgement.judged(met[0].brief, best.start, lambda: False, lambda _: None)
    assert (again.binding, again.flight) == ("", best.flight)


def test_a_need_that_no_team_meets_names_the_error_and_what_would_help() -> None:
    purpose = {"keep": {"count": 2, "spread_m": 60.0}}
    need = {"worst_rms_m": 0.02}
    given = brief(need=need, team={"min": 2, "max": 2}, purpose=purpose)
    found = design(given, workers=1)
    assert (found.status, found.binding) == ("not_found", "error")
    assert found.best is not None
    assert found.best.validation is None
    worst = [one.worst for one in found.purchases]
    assert worst == sorted(worst)
    assert worst[-1] < found.best.worst
    assert not any(one.met for one in found.purchases)
    # what is bought is a plan of the changed brief, with the error stated
    for one in design_document(found).purchases:
        again = plan_of(loaded_from(one.formation)).prediction.rms
        assert again is not None
        assert again.max() == pytest.approx(one.worst_rms_m, rel=1e-9)


def test_offers_change_one_thing_each_and_state_its_cost() -> None:
    given = brief(landmarks={"candidates_m": [[0.0, 0.0], [9.0, 0.0], [0.0, 9.0]], "max": 2})
    offers = {one.words: one for one in offers_for(given, Cell(3, 2))}
    assert list(offers) == [
        "bearing_sigma_rad 0.015 instead of 0.03",
        "range_m 135 instead of 90",
        "position_random_walk_m_sqrt_s 0.015 instead of 0.03",
        "angle_random_walk_rad_sqrt_s 0.0015 instead of 0.003",
        "one more vehicle",
        "one more landmark",
    ]
    sharper, further, *_, vehicle, landmark = offers.values()
    assert (sharper.brief.sensor.bearing_sigma_rad, sharper.cost) == (0.015, None)
    assert sharper.brief.need == given.need
    # three vehicles, 45 m more of range each, 0.01 a metre
    assert further.cost == pytest.approx(1.35)
    assert (vehicle.cell, vehicle.cost, vehicle.brief.team.max) == (Cell(4, 2), 1.0, 4)
    assert (landmark.cell, landmark.cost, landmark.brief.landmarks.most) == (Cell(3, 3), 0.3, 3)
    words = [one.words for one in offers_for(landmark.brief, landmark.cell)]
    assert "one more landmark" not in words


def test_an_impossible_brief_is_not_searched() -> None:
    found = design(brief(landmarks={"max": 1}))
    assert (found.status, found.binding, found.evaluations) == ("impossible", "rank", 0)
    assert found.best is None
    document = design_document(found)
    assert document.proof is not None
    assert "turn about it" in document.proof.reason
    assert document.plan is None


def test_a_purpose_that_no_formation_serves_binds() -> None:
    # not enough vehicles, though not provably
    cover = {"share": 0.95, "swath_m": 40.0}
    found = design(brief(team={"max": 2}, purpose={"cover": cover}), workers=1)
    assert (found.status, found.binding) == ("not_found", "area")
    assert found.best is None
    assert all(not team.fits for team in found.front)


def test_a_sample_time_too_short_for_the_largest_circle_is_refused_before_the_search() -> None:
    sensor = {"range_m": 90.0, "bearing_sigma_rad": 0.03, "sample_time_s": 0.002}
    words = "10 periods of the largest circle: 75"
    with pytest.raises(InputError, match=rf"^sensor\.sample_time_s: .*{words}"):
        design(brief(sensor=sensor))


@pytest.mark.parametrize("workers", [0, -1])
def test_no_process_is_refused(workers: int) -> None:
    with pytest.raises(InputError, match=f"workers: {workers} given"):
        design(brief(), workers=workers)


def test_a_purpose_of_a_single_vehicle_is_refined() -> None:
    purpose = {"keep": {"count": 1, "spread_m": 1.0}}
    assert design(brief(purpose=purpose, team={"max": 2}), workers=1).status == "met"
