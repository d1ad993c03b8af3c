"""Pilot flights: the sequential test, the choice of the filter, and plans that do not fly well."""

from dataclasses import replace
from math import log
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import beta, binom

import syncplan
from syncplan.guidance.flown_team import FlownTeam
from syncplan.planning.expected_work import FLIGHT_WORK_LIMIT, work_of
from syncplan.planning.pilot_flight import FIRST_LOOK, PILOT_SEED, piloted
from syncplan.planning.pilot_options import PilotOptions
from syncplan.planning.plans import Plan
from syncplan.planning.share_test import (
    BAD_SHARE,
    FEWEST_FLIGHTS,
    GOOD_SHARE,
    MOST_FLIGHTS,
    Standing,
    deciding_flights,
    share_interval,
    standing,
)
from tests.tools import on_paper
from tests.tools.scenarios import changed, circling, example, findings_of, small

HARD = Path(__file__).parents[1] / "data" / "hard"

# --- the sequential test --------------------------------------------------------------------------


def test_31_flights_without_a_failure_decide_and_3_failures_in_a_row() -> None:
    assert FEWEST_FLIGHTS == 31
    assert standing(0, 30) == "undecided"
    assert standing(0, 31) == "good"
    assert standing(2, 2) == "undecided"
    assert standing(3, 3) == "bad"


@pytest.mark.parametrize(("failures", "flights"), [(0, 5), (1, 60), (3, 40), (7, 96), (12, 12)])
def test_a_standing_follows_from_the_likelihood_ratio(failures: int, flights: int) -> None:
    good, bad = (binom.logpmf(failures, flights, share) for share in (GOOD_SHARE, BAD_SHARE))
    expected = "bad" if bad - good >= log(19.0) else "good" if good - bad >= log(19.0) else None
    assert standing(failures, flights) == (expected or "undecided")


def outcomes(failing: list[tuple[int, int]], flights: int = MOST_FLIGHTS) -> np.ndarray:
    failed = np.zeros((flights, 3), dtype=bool)
    for flight, share in failing:
        failed[flight, share] = True
    return failed


def test_a_bad_share_ends_the_flights_and_good_ones_only_together() -> None:
    assert deciding_flights(outcomes([])) == 31
    assert deciding_flights(outcomes([(0, 1), (1, 1), (2, 1)])) == 3
    # three ways to fail, each of which happens once
    assert (deciding_flights(outcomes([(0, 0), (1, 1), (2, 2)])) or 0) > 31
    later = deciding_flights(outcomes([(5, 2)]))
    assert later is not None
    assert standing(1, later) == "good"
    assert standing(1, later - 1) == "undecided"
    assert deciding_flights(outcomes([(k, 0) for k in range(0, 96, 16)])) is None


def test_the_sequential_test_errs_as_seldom_as_it_says() -> None:
    generator = np.random.default_rng(26112901)
    wrongs: dict[float, Standing] = {GOOD_SHARE: "bad", BAD_SHARE: "good"}
    for share, wrong in wrongs.items():
        failed = generator.random((4000, MOST_FLIGHTS, 1)) < share
        ends = [deciding_flights(flights) or MOST_FLIGHTS for flights in failed]
        standings = [
            standing(int(flights[:end].sum()), end)
            for flights, end in zip(failed, ends, strict=True)
        ]
        assert standings.count(wrong) / len(standings) < 0.05
        assert standings.count("undecided") / len(standings) < 0.25


@pytest.mark.parametrize(("failures", "flights"), [(0, 31), (1, 31), (7, 96), (31, 31)])
def test_the_interval_of_a_share_is_clopper_and_pearsons(failures: int, flights: int) -> None:
    low, high = share_interval(failures, flights)
    passes = flights - failures
    assert low == pytest.approx(beta.ppf(0.025, failures, passes + 1) if failures else 0.0)
    assert high == pytest.approx(beta.ppf(0.975, failures + 1, passes) if passes else 1.0)


# --- plans that are flown -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def grid() -> Plan:
    return syncplan.plan(example("paper-grid-same"))


def test_a_plan_that_flies_well_is_a_go_that_was_flown(grid: Plan) -> None:
    verdict, flight = grid.verdict, grid.flight
    assert verdict.headline == "GO in 31 simulated flights"
    assert verdict.basis is not None
    assert flight is not None
    basis = verdict.basis
    assert (basis.kind, basis.flights, basis.seed) == ("flown", 31, flight.seed)
    assert basis.digest == flight.digest
    assert flight.filter == "ekf"
    for vehicle, predicted in zip(flight.vehicles, np.asarray(grid.prediction.rms), strict=True):
        assert vehicle.rms_interval_m is not None
        assert vehicle.rms_interval_m[0] < predicted < vehicle.rms_interval_m[1]


def test_the_record_does_not_depend_on_threads(grid: Plan) -> None:
    paper = replace(grid, flight=None)
    for threads in (1, 3):
        assert piloted(paper, PilotOptions(threads=threads)).flight == grid.flight


def test_the_judging_flights_are_those_of_fly_with_their_seed(grid: Plan) -> None:
    assert grid.flight is not None
    flown = syncplan.fly(grid, trials=31, seed=grid.flight.seed).record
    assert flown.vehicles[0].rms_m == pytest.approx(grid.flight.vehicles[0].rms_m, rel=1e-9)
    assert flown.filter == grid.flight.filter


def test_flights_are_counted_as_they_are_flown() -> None:
    counts: list[tuple[int, int]] = []
    teams: list[FlownTeam] = []
    options = PilotOptions(
        progress=lambda done, total: counts.append((done, total)), compile_kernels=teams.append
    )
    piloted(on_paper.plan(changed("paper-grid-same", duration_s=40.0)), options)
    assert [team.options.filter for team in teams] == ["ekf", "ekf"]
    assert all(0 < done <= total for done, total in counts)
    assert counts == sorted(counts)


def test_a_plan_that_is_stopped_on_paper_is_not_flown() -> None:
    stopped = syncplan.plan(example("paper-grid-alternate"))
    assert stopped.flight is None
    assert stopped.verdict.headline.startswith("NO-GO")
    assert findings_of(stopped, "not-flown") == []


def test_a_large_team_stays_on_paper_and_the_note_says_what_flights_would_take() -> None:
    centers = [[70.0 * (k % 8), 70.0 * (k // 8)] for k in range(40)]
    landmarks = [[0.0, 40.0], [490.0, 40.0], [280.0, 320.0]]
    scenario = small(formation={"centers_m": centers}, landmarks_m=landmarks, duration_s=200.0)
    large = syncplan.plan(scenario, bound="never")
    work = work_of(large.scenario)
    assert work is not None
    assert work.pass_work > FLIGHT_WORK_LIMIT
    assert large.verdict.headline == "GO on paper: not flown"
    (finding,) = findings_of(large, "not-flown")
    assert "31 flights of 40 vehicles over 200 s take about" in finding.message


def test_a_filter_that_needs_the_truth_stays_on_paper() -> None:
    ideal = syncplan.plan(changed("paper-grid-same", filter={"kind": "ideal"}))
    (finding,) = findings_of(ideal, "not-flown")
    assert "needs the truth" in finding.message


def test_the_filter_that_the_scenario_names_flies() -> None:
    asked = syncplan.plan(changed("paper-grid-same", filter={"kind": "second-order"}))
    assert asked.flight is not None
    assert (asked.flight.filter, asked.flight.trials) == ("second-order", 31)


def test_vehicles_that_nearly_collide_are_stopped_though_no_separation_is_asked_for() -> None:
    near = small(
        orbit=circling(direction=["ccw", "cw"]),
        formation={"centers_m": [[0.0, 0.0], [43.0, 0.0]]},
        landmarks_m=[[0.0, 45.0], [43.0, 45.0], [21.0, -45.0]],
        duration_s=200.0,
    )
    plan = syncplan.plan(near)
    assert replace(plan, flight=None).verdict.go
    (finding,) = findings_of(plan, "too-close-in-flight")
    assert finding.level == "stop"
    assert "2 m, a tenth of the mean radius, as no min_separation_m is stated" in finding.message
    allowed = syncplan.plan(near.following(min_separation_m=0.0))
    assert findings_of(allowed, "too-close-in-flight") == []


def test_fewer_flights_are_the_first_of_more(grid: Plan) -> None:
    paper = replace(grid, flight=None)
    few = piloted(paper, PilotOptions(most_flights=20)).flight
    more = syncplan.fly(paper, trials=20, seed=PILOT_SEED, filter="ekf").record
    assert few is not None
    assert few.trials == 20
    assert few.vehicles[0].rms_m == pytest.approx(more.vehicles[0].rms_m, rel=1e-9)


# --- plans that an independent check found unsafe in flight ---------------------------------------


UNSAFE = {
    "go-not-estimated.json": "lost-in-flight",
    "go-lag-and-gusts.json": "too-close-in-flight",
    "go-turn-limit.json": "lost-in-flight",
}


@pytest.mark.parametrize("name", UNSAFE)
def test_a_plan_that_does_not_fly_well_is_stopped_after_a_few_flights(name: str) -> None:
    plan, code = syncplan.plan(HARD / name), UNSAFE[name]
    assert replace(plan, flight=None).verdict.go
    assert not plan.verdict.go
    assert code in [finding.code for finding in plan.verdict.stops]
    assert plan.flight is not None
    assert plan.flight.trials <= 3 * FIRST_LOOK
