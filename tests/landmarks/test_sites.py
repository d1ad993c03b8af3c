"""The choice of landmark sites: against exhaustive search, identities, errors."""

import json
from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.bounds import window_bound
from syncplan.landmarks.site_choice import SiteChoice, load_candidates, named_candidates
from syncplan.landmarks.site_information import candidate_information, evaluate
from syncplan.landmarks.site_search import relax
from syncplan.observability.rank import assess_team
from syncplan.planning.plans import Plan
from syncplan.reports.sites_report import sites_document
from syncplan.scenario.quantities import Point
from syncplan.scenario.specification import Scenario
from tests.tools.on_paper import choose_landmarks, plan
from tests.tools.scenarios import example, small
from tests.tools.stories import shown

TEAMS = ("paper-grid-same", "mixed-radii-camera", "five-ring", "triangle-lattice")


@cache
def _without_landmarks(name: str) -> Plan:
    return plan(example(name).model_copy(update={"landmarks_m": []}), bound="never")


def _scattered(made: Plan, count: int, seed: int) -> Array:
    """Sites (count, 2) m drawn over the team's area and 40 m around it."""
    centers = made.orbits.centers
    low, high = centers.min(axis=0) - 40.0, centers.max(axis=0) + 40.0
    return np.random.default_rng(seed).uniform(low, high, (count, 2))


def _surveyed(name: str, count: int, seed: int) -> tuple[Plan, Array]:
    """The plan of an example without landmarks, and sites for some."""
    made = _without_landmarks(name)
    return made, _scattered(made, count, seed)


def _worst(made: Plan, places: Array) -> float:
    """Worst vehicle's window bound in m by the code that judges plans; infinite if undetermined."""
    team = replace(made.team, landmarks=np.concatenate([made.landmarks, places]))
    bound = window_bound(assess_team(team, made.scenario.window).observability)
    return float("inf") if np.isnan(bound).any() else float(bound.max())


@pytest.mark.parametrize(("team", "seed"), [("mixed-radii-camera", 5), ("five-ring", 2)])
def test_rounding_and_swaps_equal_exhaustive_search_on_8_choose_3(team: str, seed: int) -> None:
    made, places = _surveyed(team, 8, seed)
    best = min(_worst(made, places[list(subset)]) for subset in combinations(range(8), 3))
    found = choose_landmarks(made, places, 3, exhaustive=False, bound="never")
    assert found.value == pytest.approx(best, rel=1e-7)
    assert found.bound <= best
    assert not found.proven
    proven = choose_landmarks(made, places, 3, bound="never")
    assert proven.value == pytest.approx(best, rel=1e-9)
    assert proven.proven


def test_the_value_is_the_judged_plans_own() -> None:
    made, places = _surveyed("paper-grid-same", 8, 4)
    found = choose_landmarks(made, places, 3, bound="never")
    assert found.value == pytest.approx(_worst(made, places[list(found.chosen)]), rel=1e-12)
    assert not made.observable
    assert np.isnan(found.before).all()
    assert found.plan.observable
    assert found.plan.scenario.landmark_names == [f"S{k + 1}" for k in found.chosen]
    np.testing.assert_array_equal(found.plan.orbits.phases, made.orbits.phases)
    assert found.gap == pytest.approx(found.value / found.bound - 1.0)


def test_landmarks_given_by_name_are_chosen_as_sites_at_their_places_are() -> None:
    bare, places = _surveyed("paper-grid-same", 6, 4)
    sites = {f"S{k + 1}": (float(x), float(y)) for k, (x, y) in enumerate(places)}
    everywhere = {**sites, "kept": (190.0, 0.0)}
    scenario = bare.scenario.model_copy(update={"landmarks_m": everywhere})
    found = choose_landmarks(scenario, ["S2", "S5", "S1"], 2, bound="never")
    rest = {name: at for name, at in everywhere.items() if name not in found.names}
    without = bare.scenario.model_copy(update={"landmarks_m": rest})
    named = {name: sites[name] for name in found.names}
    expected = choose_landmarks(without, named, 2, bound="never")
    assert found.names == ("S2", "S5", "S1")
    assert (found.chosen, found.value) == (expected.chosen, expected.value)
    chosen = [found.names[k] for k in found.chosen]
    assert sorted(found.plan.scenario.landmark_names) == sorted([*rest, *chosen])
    with pytest.raises(InputError, match="'S9': there is no such landmark; landmarks are S1, S2"):
        choose_landmarks(scenario, ["S1", "S9"], 1)


@pytest.mark.parametrize(("seed", "choose"), [(0, 1), (1, 3), (2, 5), (3, 3)])
def test_no_choice_lies_below_the_relaxations_bound(seed: int, choose: int) -> None:
    made = plan(example(TEAMS[seed]), bound="never")
    places = _scattered(made, 6, 10 + seed)
    information = candidate_information(made, places)
    bound = information.scale / np.sqrt(relax(information, choose).ceiling)
    for subset in combinations(range(6), choose):
        assert _worst(made, places[list(subset)]) >= bound * (1.0 - 1e-9)


def test_the_bound_holds_however_poor_the_solvers_multipliers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    information = candidate_information(*_surveyed("five-ring", 8, 1))
    good = relax(information, 3).ceiling
    generator = np.random.default_rng(0)

    def nonsense(cuts, choose, ceiling):  # type: ignore[no-untyped-def]
        weights = generator.random(len(cuts.heights))
        return generator.permutation([1.0] * 3 + [0.0] * 5), weights / weights.sum()

    monkeypatch.setattr("syncplan.landmarks.site_search._propose", nonsense)
    assert relax(information, 3).ceiling >= good * (1.0 - 1e-3)


def test_cutting_planes_reach_the_semidefinite_programs_optimum() -> None:
    """In coordinates that whiten the information: without, Clarabel is 15 % off."""
    cp: Any = pytest.importorskip("cvxpy")
    information = candidate_information(*_surveyed("paper-grid-same", 8, 1))
    everything = information.rows(np.ones(8))
    white = np.linalg.inv(np.linalg.cholesky(everything.T @ everything))
    grams = [rows.T @ rows for rows in map(information.rows, [np.zeros(8), *np.eye(8)])]
    fixed, *grown = [white @ gram @ white.T for gram in grams]
    shares, worst = cp.Variable(8), cp.Variable()
    total = fixed + sum(shares[k] * (one - fixed) for k, one in enumerate(grown))
    constraints = [cp.sum(shares) == 3, shares >= 0, shares <= 1]
    for at in range(0, len(white), 3):
        parts = [cp.matrix_frac(10.0 * white[:, at + axis], total) for axis in (0, 1)]
        constraints.append(cp.sum(parts) <= worst)
    cp.Problem(cp.Minimize(worst), constraints).solve(solver=cp.CLARABEL)
    found = relax(information, 3)
    assert evaluate(information, found.shares).least <= 100.0 / worst.value * (1.0 + 1e-6)
    assert found.ceiling == pytest.approx(100.0 / worst.value, rel=1e-4)


@pytest.mark.parametrize("team", TEAMS)
def test_cuts_are_tangent_to_the_window_bound_by_finite_differences(team: str) -> None:
    information = candidate_information(*_surveyed(team, 12, 3))
    shares = np.random.default_rng(5).uniform(0.3, 0.9, 12)
    at = evaluate(information, shares)
    worst = int(np.argmin(at.precision))

    def bound(x: Array) -> float:
        return float(information.scale / np.sqrt(evaluate(information, x).precision[worst]))

    assert at.cuts.heights[0] + at.cuts.slopes[0] @ shares == pytest.approx(at.least, rel=1e-9)
    slope = -0.5 * bound(shares) / at.least * at.cuts.slopes[0]
    step = 1e-5 * np.eye(12)
    measured = [(bound(shares + one) - bound(shares - one)) / 2e-5 for one in step]
    np.testing.assert_allclose(slope, measured, rtol=1e-4, atol=1e-6 * np.abs(slope).max())


def test_cuts_at_a_singular_choice_lie_above_every_other() -> None:
    information = candidate_information(*_surveyed("five-ring", 8, 1))
    at = evaluate(information, np.zeros(8))
    assert at.least == 0.0
    assert at.rank < 15
    generator = np.random.default_rng(2)
    for _ in range(50):
        x = generator.random(8)
        lines = at.cuts.heights + at.cuts.slopes @ x
        assert evaluate(information, x).least <= lines.min() * (1.0 + 1e-9)


def test_given_landmarks_stay_and_count() -> None:
    made = plan(example("paper-grid-same"), bound="never")
    found = choose_landmarks(made, {"mast": (-50.0, 0.0), "rock": (-50.0, 70.0)}, 1, bound="never")
    assert found.plan.scenario.landmark_names[:2] == ["L1", "L2"]
    assert found.plan.scenario.landmark_names[2] in ("mast", "rock")
    assert found.value < np.max(found.before)


def test_a_site_that_no_vehicle_sees_is_not_chosen_where_others_help() -> None:
    made = _without_landmarks("paper-grid-same")
    places = np.concatenate([[[5000.0, 0.0], [0.0, -5000.0]], _scattered(made, 6, 8)])
    found = choose_landmarks(made, places, 4, bound="never")
    assert found.seen_by[0] == found.seen_by[1] == 0
    assert not {0, 1} & set(found.chosen)


def test_choosing_all_candidates_closes_the_gap() -> None:
    found = choose_landmarks(*_surveyed("paper-grid-same", 6, 8), 6, bound="never")
    assert found.chosen == tuple(range(6))
    assert found.gap == pytest.approx(0.0, abs=1e-4)
    assert found.proven


def test_no_swap_of_one_site_improves_a_choice_too_large_to_prove(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("syncplan.landmarks.site_search.MOST_LISTED", 500)
    made, places = _surveyed("paper-grid-same", 40, 2)
    found = choose_landmarks(made, places, 8, bound="never")
    information = candidate_information(made, places)
    assert not found.proven
    assert found.value > found.bound
    for out in found.chosen:
        for into in set(range(40)) - set(found.chosen):
            swapped = np.zeros(40)
            swapped[[*(set(found.chosen) - {out}), into]] = 1.0
            reached = information.scale / np.sqrt(evaluate(information, swapped).least or 1e-300)
            assert reached >= found.value * (1.0 - 1e-8)


def test_sites_with_nothing_to_add_to_an_unseen_vehicle_are_refused_in_words() -> None:
    lonely = small(formation={"centers_m": [[0.0, 0.0]]})
    with pytest.raises(NoSolutionError, match="rank 0 of 3: shift of v1"):
        choose_landmarks(lonely, np.array([[5000.0, 0.0], [6000.0, 0.0]]), 1)


def test_the_same_seed_gives_the_same_choice_and_any_seed_the_same_proven_value() -> None:
    made, places = _surveyed("five-ring", 8, 9)
    first, again, other = (
        choose_landmarks(made, places, 3, seed=seed, bound="never") for seed in (3, 3, 4)
    )
    assert (first.chosen, first.value) == (again.chosen, again.value)
    assert first.bound == again.bound
    np.testing.assert_array_equal(first.shares, again.shares)
    assert first.proven
    assert other.value == pytest.approx(first.value, rel=1e-8)


def test_a_scenario_serves_as_well_as_its_plan() -> None:
    scenario = example("paper-grid-same")
    places = np.array([[-50.0, 0.0], [-50.0, 70.0], [70.0, 120.0]])
    by_scenario = choose_landmarks(scenario, places, 1)
    by_plan = choose_landmarks(plan(scenario), places, 1)
    assert (by_scenario.chosen, by_scenario.value) == (by_plan.chosen, by_plan.value)
    assert by_scenario.plan.prediction.rms is not None
    assert by_scenario.plan.synchronisation is not None


# --- errors -----------------------------------------------------------------------------------


def _pair() -> Scenario:
    return small(landmarks_m=[[0.0, 45.0]])


@pytest.mark.parametrize("choose", [0, -1, 3])
def test_a_number_of_sites_out_of_range_is_refused(choose: int) -> None:
    with pytest.raises(InputError, match=r"^choose: .*from 1 to the number of candidates, 2"):
        choose_landmarks(_pair(), np.array([[1.0, 2.0], [3.0, 4.0]]), choose)


@pytest.mark.parametrize(
    ("candidates", "problem"),
    [
        ({"v1": (1.0, 2.0), "a": (3.0, 4.0)}, "'v1': is used twice"),
        ({"L1": (1.0, 2.0), "a": (3.0, 4.0)}, "'L1': is used twice"),
        ({"a": (1.0, 2.0), "b": (1.0, 2.0)}, "a and b are at the same place"),
        ({"a": (0.0, 45.0)}, "L1 and a are at the same place"),
        ({"a": (float("nan"), 45.0)}, "finite"),
        ({"a": (1.0, 2.0, 3.0)}, "at most 2"),
        ({"a": (1e9, 0.0)}, "at most"),
        (np.zeros((0, 2)), "holds no sites"),
        (np.zeros(3), "must be"),
    ],
)
def test_unusable_candidates_are_refused_by_name(
    candidates: dict[str, Point] | Array, problem: str
) -> None:
    with pytest.raises(InputError, match=f"^candidates_m.*{problem}"):
        choose_landmarks(_pair(), candidates, 1)


def test_candidates_out_of_everyones_reach_are_no_solution_and_the_lack_is_named() -> None:
    places = np.array([[5000.0, 0.0], [5000.0, 70.0], [5000.0, 140.0]])
    with pytest.raises(NoSolutionError, match=r"even all 3 candidates leave rank \d+ of 18") as e:
        choose_landmarks(_without_landmarks("paper-grid-same"), places, 2)
    assert "cure" in str(e.value)


def test_too_few_sites_for_observability_are_no_solution() -> None:
    made, places = _surveyed("five-ring", 8, 1)
    assert np.isfinite(choose_landmarks(made, places, 3, bound="never").value)
    with pytest.raises(NoSolutionError, match=r"any 1 of 8 candidates leave rank 14 of 15: turn"):
        choose_landmarks(made, places, 1, bound="never")


# --- files and report -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "text", "names"),
    [
        ("a.yaml", "- [1, 2]\n- [3, 4.5]\n", ["S1", "S2"]),
        ("a.json", "[[1, 2], [3, 4.5]]", ["S1", "S2"]),
        ("b.yaml", "mast: [1, 2]\nrock: [3, 4.5]\n", ["mast", "rock"]),
        ("c.yaml", "candidates_m: [[1, 2], [3, 4.5]]\n", ["S1", "S2"]),
        ("c.json", '{"candidates_m": {"mast": [1, 2], "rock": [3, 4.5]}}', ["mast", "rock"]),
    ],
)
def test_files_hold_a_list_or_names_with_or_without_their_key(
    tmp_path: Path, name: str, text: str, names: list[str]
) -> None:
    file = tmp_path / name
    file.write_text(text)
    sites = load_candidates(file)
    assert list(sites) == names
    assert list(sites.values()) == [(1.0, 2.0), (3.0, 4.5)]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("- [1, 2]\n- [3, x]\n", r"bad.yaml: candidates_m\[1\]\[1\]: 'x': must be"),
        ("mast: 3\n", r"bad.yaml: candidates_m.mast: 3: must be"),
        ("[]\n", "bad.yaml: candidates_m: holds no sites"),
        ("just words\n", "bad.yaml: candidates_m: 'just words': must be"),
        ("a: [1, 2]\na: [3, 4]\n", "bad.yaml: line 2"),
    ],
)
def test_faults_of_a_file_name_file_key_and_value(tmp_path: Path, text: str, problem: str) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=problem):
        load_candidates(file)


def test_named_candidates_takes_arrays_among_names() -> None:
    assert named_candidates({"a": np.array([1, 2])}) == {"a": (1.0, 2.0)}


@pytest.fixture(scope="module")
def choice() -> SiteChoice:
    return choose_landmarks(*_surveyed("paper-grid-same", 8, 4), 3)


def test_the_document_carries_the_choice_and_a_scenario_that_plans_to_its_value(
    choice: SiteChoice,
) -> None:
    document = sites_document(choice)
    values = json.loads(json.dumps(document.as_json(), allow_nan=False))
    assert values["chosen"] == [f"S{k + 1}" for k in choice.chosen]
    assert values["before_m"] is None
    assert all(vehicle["before_m"] is None for vehicle in values["window_bounds"])
    assert sum(site["share"] for site in values["candidates"]) == pytest.approx(3.0)
    assert max(vehicle["after_m"] for vehicle in values["window_bounds"]) == values["value_m"]
    again = plan(values["plan"]["scenario"], bound="never")
    assert np.max(again.prediction.window) == pytest.approx(choice.value, rel=1e-9)


def test_the_table_names_the_chosen_sites(choice: SiteChoice) -> None:
    text = shown(sites_document(choice), 120)
    assert ", ".join(f"S{k + 1}" for k in choice.chosen) in text
    assert "undetermined" in text
