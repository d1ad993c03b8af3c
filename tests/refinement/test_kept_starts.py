"""A refinement that is interrupted and goes on comes to what one comes to that never was."""

import json
from collections.abc import Iterator
from typing import Any

import pytest

from syncplan.planning.plans import Plan
from syncplan.refinement import exact_search
from syncplan.refinement.refiner import BetterPlan
from syncplan.reports.plan_report import plan_document
from syncplan.runtime.files import as_text
from syncplan.runtime.task_crew import EarlierSearch
from tests.tools.on_paper import plan, refine
from tests.tools.scenarios import small

STARTS = 3
SEARCH: Any = {"vary": ["phases", "centers"], "starts": STARTS, "seed": 1, "time_limit_s": 3600.0}


@pytest.fixture(scope="module", autouse=True)
def random_moves_alone() -> Iterator[None]:
    """An exact search by random moves so small that some of them improve each optimum."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(exact_search, "_patterns", lambda looks, start, values: start)
        patch.setattr(exact_search, "_LEAST_STEP", 1e-6)
        patch.setattr(exact_search, "_LARGEST_MOVE", 1e-4)
        patch.setattr(exact_search, "_MOST_LOOKS", 20)
        yield


@pytest.fixture(scope="module")
def pair() -> Plan:
    return plan(small(landmarks_m=[[0.0, 40.0], [70.0, 40.0]], duration_s=30.0))


@pytest.fixture(scope="module")
def whole(pair: Plan) -> tuple[str, dict[int, bytes]]:
    """The document of a search that is never interrupted, and what it keeps."""
    return searched(pair, {})


def searched(
    pair: Plan, finished: dict[int, bytes], workers: int = 1, spent_s: float = 0.0
) -> tuple[str, dict[int, bytes]]:
    kept: dict[int, bytes] = {}
    earlier = EarlierSearch(finished, spent_s, kept.__setitem__)
    better = refine(pair, workers=workers, earlier=earlier, **SEARCH)
    return as_text(plan_document(better).as_json()), kept


def test_each_plan_that_is_the_best_so_far_is_heard_of_and_the_last_one_is_the_result(
    pair: Plan, whole: tuple[str, dict[int, bytes]]
) -> None:
    document, kept = whole
    for earlier in (None, EarlierSearch(kept)):
        heard: list[BetterPlan] = []
        found = refine(pair, workers=1, better=heard.append, earlier=earlier, **SEARCH)
        assert as_text(plan_document(found).as_json()) == document
        record = found.refinement
        assert record is not None
        errors = [one.after.predicted_rms for one in heard]
        assert heard[0].before == record.before
        assert record.before.predicted_rms > errors[0]
        assert errors == sorted(set(errors), reverse=True)
        assert heard[-1].after == record.after
        assert heard[-1].scenario == found.scenario
        assert (heard[-1].orbits.centers == found.orbits.centers).all()
        assert (heard[-1].orbits.phases == found.orbits.phases).all()


@pytest.mark.parametrize(("known", "workers"), [([0], 1), ([2], 2), ([0, 1, 2], 1)])
def test_kept_starts_are_not_made_again_and_the_result_is_the_same(
    pair: Plan, whole: tuple[str, dict[int, bytes]], known: list[int], workers: int
) -> None:
    expected, kept = whole
    document, made = searched(pair, {k: kept[k] for k in known}, workers)
    assert document == expected
    assert sorted(made) == [k for k in range(STARTS) if k not in known]


def test_the_time_that_was_spent_counts(pair: Plan, whole: tuple[str, dict[int, bytes]]) -> None:
    _, made = searched(pair, {}, spent_s=1e6)
    assert made == {}, "a start that was stopped is kept"
    document, made = searched(pair, {1: whole[1][1]}, spent_s=1e6)
    record = json.loads(document)["refinement"]
    assert record["cut_short"]
    assert [one["start"] for one in record["starts"]] == [1]
    assert made == {}
